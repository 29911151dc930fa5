//! What may be wrong with the description and not with the camera: how bright surfaces are, and where the camera was.
//!
//! Neither is a number that a search could try. Both are worked out anew for every camera that is considered, from
//! frames that it is not judged by: factors on the radiance from the frames that fits see, the pose of a judged frame
//! from half of its tiles, while the other half is scored. Each camera is scored by the residual after its best-fitting
//! description. So neither can hide the other, where frames tell them apart.

pub(crate) mod by_value;
pub(crate) mod grid;
pub(crate) mod known;
pub(crate) mod masks;
pub(crate) mod poses;
pub(crate) mod radiance;
pub(crate) mod rays;
pub(crate) mod reconstruct;
pub(crate) mod seen_in_pictures;
pub(crate) mod settle;
pub(crate) mod surface;
pub(crate) mod wander;

use std::sync::Arc;

use rayon::prelude::*;

use super::forward::Forward;
use super::model::{P, Theta};
use super::settings::without_neighbours;
use super::tone::Tone;
use crate::diagnose::evidence::quality::Quality;
use shutterbug::error::Result;
use shutterbug::plane::Plane;
use shutterbug::reference::moments::Lattice;

use grid::{Grid, Surface};
pub(crate) use known::Known;
pub(crate) use masks::Kind;
pub(crate) use poses::PoseShare;
use radiance::{Lesson, Map, STEP, STEPS, in_steps, lattice};
use rays::Body;
use surface::CELL;

/// Most bytes of surfaces that are kept.
const KEPT_BYTES: usize = 256 << 20;
/// What is seen is worked out for places so far apart, px: factors hardly change over it, and edges of what is
/// simulated are where they are all the same.
const NEARBY_PX: f64 = 0.06;

impl Forward {
    /// Linear radiance as the sensor sees it, shape `[height, width, 3]`, of several frames (by place), with the
    /// description as `theta` has it.
    pub(crate) fn radiance(
        &mut self,
        frames: &[usize],
        theta: &Theta,
        quality: Quality,
    ) -> Result<Vec<Arc<Plane<f32>>>> {
        let theta = self.settled(frames, theta)?;
        self.lit(frames, &theta, quality)
    }

    /// The same at the poses of `theta`.
    pub(crate) fn lit(
        &mut self,
        frames: &[usize],
        theta: &Theta,
        quality: Quality,
    ) -> Result<Vec<Arc<Plane<f32>>>> {
        self.lit_as(frames, theta, theta, quality)
    }

    /// What the camera of `theta` sees of surfaces as bright as the factors that go with the camera of `lights` say.
    pub(crate) fn lit_as(
        &mut self,
        frames: &[usize],
        theta: &Theta,
        lights: &Theta,
        quality: Quality,
    ) -> Result<Vec<Arc<Plane<f32>>>> {
        let bare = self.bare_radiance(frames, theta, quality)?;
        if !lights.room.radiance {
            return Ok(bare);
        }
        let map = self.map_of(lights, quality)?;
        let surfaces: Vec<_> = frames.iter().map(|&at| self.surface(at, lights)).collect();
        let size = [self.intrinsics.width as usize, self.intrinsics.height as usize];
        let grid = &self.description.grid;
        let lit = bare.iter().zip(&surfaces).map(|(plane, surface)| {
            let mut lit = (**plane).clone();
            map.light(grid, surface, (Lattice::WHOLE, size), &mut lit);
            Arc::new(lit)
        });
        Ok(lit.collect())
    }

    /// Factors on the radiance that go with a camera, learnt from the frames that fits see.
    pub(crate) fn map_of(&mut self, theta: &Theta, quality: Quality) -> Result<Arc<Map>> {
        let quality = quality.min(Quality::Fit);
        let mut own = theta.clone();
        let sources = self.description.sources.clone();
        let only = |(at, p): (usize, &mut [f64; 6])| {
            if !sources.contains(&at) {
                *p = [0.0; 6]
            }
        };
        own.room.poses.iter_mut().enumerate().for_each(only);
        let key = format!("{own:?} {quality:?} {}", self.native);
        if let Some(known) = self.description.maps.get(&key) {
            return Ok(known.clone());
        }
        // A compressor's steps have no slope, and cells are larger than its blocks.
        let smooth = own.with(P::Quality, 0.0);
        let single = without_neighbours(&smooth);
        let mixes = single != smooth;
        // What mixes neighbours keeps the mean of a cell: only the last step is taken with it.
        let mut map = if mixes { self.map_of(&single, quality)?.before_last_step() } else { Map::default() };
        let bare = self.bare_radiance(&sources, &own, quality)?;
        let surfaces: Vec<_> = sources.iter().map(|&at| self.surface(at, &own)).collect();
        let size = [self.intrinsics.width, self.intrinsics.height].map(|side| side as usize);
        // Where nothing mixes neighbours, only what is compared is developed.
        let samples = lattice(size[0]);
        let on = if mixes { Lattice::WHOLE } else { samples };
        let bare: Vec<_> = bare.par_iter().map(|b| on.of(b)).collect();
        let tone = Tone::new(&smooth);
        in_steps(if mixes { 1 } else { STEPS }, |step| {
            let shared = &*self;
            let twice = |i: usize| {
                let mut lit = bare[i].clone();
                if mixes || step > 0 {
                    map.light(&shared.description.grid, &surfaces[i], (on, size), &mut lit);
                }
                let both = shared.twice(sources[i], lit, on, &smooth, &tone);
                if mixes { both.map(|picture| samples.of(&picture)) } else { both }
            };
            let drawn: Vec<[Plane<f32>; 2]> = (0..sources.len()).into_par_iter().map(twice).collect();
            let lessons: Vec<Lesson<'_>> = (0..sources.len())
                .map(|i| Lesson {
                    surface: &surfaces[i],
                    real: &shared.description.real[sources[i]],
                    simulated: &drawn[i][0],
                    brighter: &drawn[i][1],
                })
                .collect();
            map.learn(&shared.description.grid, &lessons)
        });
        map.fill(&self.description.grid);
        let map = Arc::new(map);
        if self.description.maps.len() > 64 {
            self.description.maps.clear();
        }
        self.description.maps.insert(key, map.clone());
        Ok(map)
    }

    /// Some pixels of a frame, and a little brighter, DN.
    fn twice(
        &self,
        at: usize,
        mut lit: Plane<f32>,
        on: Lattice,
        theta: &Theta,
        tone: &Tone,
    ) -> [Plane<f32>; 2] {
        let simulated = self.develop_on(at, &lit, on, theta, tone);
        let up = STEP.exp();
        lit.data.iter_mut().for_each(|l| *l *= up);
        [simulated, self.develop_on(at, &lit, on, theta, tone)]
    }

    /// What the pixels of a frame see, kept for as long as the geometry stays.
    pub(crate) fn surface(&mut self, at: usize, theta: &Theta) -> Arc<Surface> {
        let theta = &self.nearby(theta);
        let key = format!("{:?}", self.sight_key(at, theta));
        if let Some(known) = self.description.surfaces.get(&key) {
            return known.clone();
        }
        let bodies = self.bodies();
        let mut grid = std::mem::take(&mut self.description.grid);
        if grid.count() == 0 {
            grid = Grid::new(self.cell_m());
        }
        let surface = Arc::new(match &self.outside {
            Some(outside) => self.surface_of_pictures(outside, &mut grid, at, theta),
            None => self.surface_of(&bodies, &mut grid, at, theta),
        });
        self.description.grid = grid;
        self.description.kept += surface.bytes();
        if self.description.kept > KEPT_BYTES {
            self.description.surfaces.clear();
            self.description.kept = surface.bytes();
        }
        self.description.surfaces.insert(key, surface.clone());
        surface
    }

    /// `theta` with its geometry rounded to what moves a picture by [`NEARBY_PX`].
    fn nearby(&self, theta: &Theta) -> Theta {
        let to = |v: f64, step: f64| (v / step).round() * step;
        let angle = NEARBY_PX / self.intrinsics.fx;
        let mut out = theta.clone();
        for p in [P::RotX, P::RotY, P::RotZ, P::Focal, P::K1, P::K2, P::P1, P::P2, P::K3] {
            out.set(p, to(theta.get(p), angle));
        }
        // A head that turns by 2 rad a second.
        for p in [P::Offset, P::Readout, P::Exposure] {
            out.set(p, to(theta.get(p), 0.5 * angle));
        }
        for pose in &mut out.room.poses {
            // Things are some meters away.
            (0..6).for_each(|i| pose[i] = to(pose[i], if i < 3 { angle } else { 3.0 * angle }));
        }
        out
    }

    fn bodies(&mut self) -> Arc<Vec<Body>> {
        let scene = self.scene.clone();
        self.description.bodies.get_or_insert_with(|| Arc::new(Body::all(&scene))).clone()
    }

    /// Side of the cells, m.
    fn cell_m(&self) -> f32 {
        let every = |s: &super::sharp::Sharp| {
            s.depth.data.iter().copied().filter(|d| d.is_finite()).step_by(97).collect::<Vec<f32>>()
        };
        let mut depths: Vec<f32> = self.sharp.iter().flat_map(every).collect();
        if depths.is_empty() {
            return 1.0;
        }
        let middle = depths.len() / 2;
        let depth_m = *depths.select_nth_unstable_by(middle, f32::total_cmp).1;
        (CELL * f64::from(self.intrinsics.width) / self.intrinsics.fx) as f32 * depth_m
    }
}
