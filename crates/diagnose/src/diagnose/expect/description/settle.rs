//! Where the camera was in each frame, for a given camera: the pose of a frame that is judged from half of its tiles,
//! of one that fits see from all of them; and how fits see what the description could do.

use std::borrow::Cow;
use std::sync::Arc;

use rayon::prelude::*;

use crate::diagnose::evidence::blocks::pooled;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::description::grid::NONE;
use crate::diagnose::expect::description::masks::is_paid;
use crate::diagnose::expect::description::poses::{PoseShare, UNITS, Usual, eliminated};
use crate::diagnose::expect::description::radiance::{STEP, Takeover};
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::linear::solve;
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::tone::Tone;
use crate::diagnose::expect::weighing::{FrameValues, Weighing};
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// Means over blocks that poses are solved at, px, one after another.
pub(crate) const BLOCKS: [usize; 4] = [4, 4, 2, 2];
/// The same ahead of these where a pose is as described, and may be off by some px: edges have to meet.
const FIRST_BLOCKS: [usize; 2] = [16, 8];
/// Cells of factors over the width of a picture, as a rule.
const CELLS: f64 = 40.0;
/// A step of less than this is the last, units (a few hundredths of a px).
const SMALL: f64 = 0.1;

impl Forward {
    /// `theta` with the poses of those of `frames` that are judged, each estimated from half of its tiles.
    pub(crate) fn settled<'a>(&mut self, frames: &[usize], theta: &'a Theta) -> Result<Cow<'a, Theta>> {
        if theta.room.poses.is_empty() {
            return Ok(Cow::Borrowed(theta));
        }
        let sources = self.description.sources.clone();
        let judged: Vec<usize> = frames.iter().copied().filter(|at| !sources.contains(at)).collect();
        let mut out = theta.clone();
        let keys: Vec<String> = judged.iter().map(|&at| self.pose_key(at, theta, &sources)).collect();
        let missing: Vec<usize> =
            (0..judged.len()).filter(|&i| !self.description.settled.contains_key(&keys[i])).collect();
        let places: Vec<usize> = missing.iter().map(|&i| judged[i]).collect();
        let usual = self.usual(theta);
        let solved = self.solved(&places, theta, &BLOCKS, (true, usual))?;
        for (&i, pose) in missing.iter().zip(solved) {
            self.description.settled.insert(keys[i].clone(), pose);
        }
        for (at, key) in judged.iter().zip(&keys) {
            out.room.poses[*at] = self.description.settled[key];
        }
        Ok(Cow::Owned(out))
    }

    /// All that the pose of a judged frame depends on.
    fn pose_key(&self, at: usize, theta: &Theta, sources: &[usize]) -> String {
        let mut own = theta.clone();
        let used = |i: usize| i == at || (theta.room.radiance && sources.contains(&i));
        for (_, p) in own.room.poses.iter_mut().enumerate().filter(|(i, _)| !used(*i)) {
            *p = [0.0; 6];
        }
        format!("{at} {own:?} {} {:?}", self.native, self.usual(theta))
    }

    /// How far the poses of the frames that fits see are off as a rule.
    fn usual(&self, theta: &Theta) -> Option<Usual> {
        Usual::of(self.description.sources.iter().map(|&at| &theta.room.poses[at]))
    }

    /// The poses of some frames that fits see that explain them best, beginning with those of `theta`. One that has
    /// gone further than the others is asked again, from the pose as described, and held by what is usual.
    pub(crate) fn track(
        &mut self,
        places: &[usize],
        theta: &Theta,
        blocks: &[usize],
    ) -> Result<Vec<[f64; 6]>> {
        let mut poses = self.solved(places, theta, blocks, (false, None))?;
        let Some(usual) = Usual::of(poses.iter()) else { return Ok(poses) };
        let astray: Vec<usize> = (0..places.len()).filter(|&i| usual.is_doubted(&poses[i])).collect();
        if !astray.is_empty() {
            let mut begun = theta.clone();
            astray.iter().for_each(|&i| begun.room.poses[places[i]] = [0.0; 6]);
            let again: Vec<usize> = astray.iter().map(|&i| places[i]).collect();
            let held = self.solved(&again, &begun, &BLOCKS, (false, Some(usual)))?;
            tracing::info!("poses of frames {again:?} are held by {usual:?}: {held:.4?}");
            astray.iter().zip(held).for_each(|(&i, pose)| poses[i] = pose);
        }
        Ok(poses)
    }

    /// The poses of some frames that explain them best, beginning with those of `theta`. `half`: from half of the
    /// tiles; `usual`: what holds them.
    fn solved(
        &mut self,
        places: &[usize],
        theta: &Theta,
        blocks: &[usize],
        (half, usual): (bool, Option<Usual>),
    ) -> Result<Vec<[f64; 6]>> {
        let mut theta = theta.clone();
        let begin: Vec<usize> =
            places.iter().copied().filter(|&at| theta.room.poses[at] == [0.0; 6]).collect();
        self.step_by_step(begin, &mut theta, &FIRST_BLOCKS, (half, usual))?;
        self.step_by_step(places.to_vec(), &mut theta, blocks, (half, usual))?;
        Ok(places.iter().map(|&at| theta.room.poses[at]).collect())
    }

    /// Moves the poses of some frames, each until a step is small or there are no more of the blocks.
    fn step_by_step(
        &mut self,
        mut open: Vec<usize>,
        theta: &mut Theta,
        blocks: &[usize],
        (half, usual): (bool, Option<Usual>),
    ) -> Result<()> {
        for &block in blocks {
            if open.is_empty() {
                break;
            }
            let radiance = self.lit(&open, theta, Quality::Fit)?;
            let shared = &*self;
            let steps: Vec<Option<[f64; 6]>> = (0..open.len())
                .into_par_iter()
                .map(|i| shared.pose_step(open[i], &radiance[i], theta, block, (half, usual)))
                .collect();
            let mut rest = Vec::new();
            for (&at, step) in open.iter().zip(steps) {
                let Some(step) = step else { continue };
                (0..6).for_each(|i| theta.room.poses[at][i] += UNITS[i] * step[i]);
                if step.iter().any(|s| s.abs() > SMALL) {
                    rest.push(at);
                }
            }
            open = rest;
        }
        Ok(())
    }

    /// A Gauss-Newton step of the pose of one frame, units.
    fn pose_step(
        &self,
        at: usize,
        radiance: &Plane<f32>,
        theta: &Theta,
        block: usize,
        (half, usual): (bool, Option<Usual>),
    ) -> Option<[f64; 6]> {
        let smooth = moved_by_poses(theta);
        let picture = self.develop(at, radiance, &smooth, &Tone::new(&smooth));
        let filed = (smooth != *theta).then(|| self.develop(at, radiance, theta, &Tone::new(theta)));
        let delivered = filed.as_ref().unwrap_or(&picture);
        let (w, h) = (picture.width, picture.height);
        let real = &self.description.real[at];
        // What no other frame saw has no brightness to go by.
        let covered = self.description.covered.get(&at).filter(|_| half && theta.room.radiance);
        let is_seen = |i: usize| covered.is_none_or(|c| c.data[i] > 0.5);
        let open = |i: usize| (!half || is_paid(i % w, i / w)) && is_seen(i);
        let small = |d: &[f32]| {
            let data: Vec<f32> =
                d.iter().enumerate().map(|(i, v)| if open(i / 3) { *v } else { 0.0 }).collect();
            pooled(&data, w, h, block)
        };
        let difference: Vec<f32> = real.data.iter().zip(&delivered.data).map(|(r, s)| r - s).collect();
        let r = small(&difference);
        let columns: Vec<Vec<f32>> =
            self.pose_columns(at, &picture, &smooth).iter().map(|d| small(d)).collect();
        let weighing =
            Weighing::new(&[] as &[Plane<f32>], &Tone::new(&Theta::neutral()), block, 1.0).chosen(&[&r]);
        let weights = weighing.weights(0, &r);
        let product = |a: &[f32], b: &[f32]| -> f64 {
            weights.iter().zip(a).zip(b).map(|((&w, &a), &b)| f64::from(w * a * b)).sum()
        };
        let mut a: Vec<Vec<f64>> =
            columns.iter().map(|i| columns.iter().map(|j| product(i, j)).collect()).collect();
        let mut b: Vec<f64> = columns.iter().map(|j| product(j, &r)).collect();
        if let Some(usual) = usual {
            // Costs are in DN: what is left as a rule is one standard deviation. It is alike in all that a cell of a
            // factor covers: a wall without a pattern says little, however many pixels it has.
            let as_a_rule_dn = 1.0 / f64::from(weights.iter().copied().fold(1e-6, f32::max));
            let alike = 3.0 * (w as f64 / CELLS / block as f64).max(1.0).powi(2);
            usual.hold(&mut a, &mut b, &theta.room.poses[at], alike * as_a_rule_dn);
        }
        let step = solve(&a, &b, 1e-4)?;
        Some(std::array::from_fn(|i| step[i]))
    }

    /// Takes out of the columns of a fit what the description could do in their place, and says what poses do then.
    pub(crate) fn beside_description(
        &mut self,
        frames: &[usize],
        theta: &Theta,
        radiance: &[Arc<Plane<f32>>],
        block: usize,
        weighing: &Weighing,
        values: &mut [FrameValues],
    ) -> Vec<PoseShare> {
        if !theta.room.radiance && theta.room.poses.is_empty() {
            return Vec::new();
        }
        let weights: Vec<Vec<f32>> =
            values.iter().enumerate().map(|(f, v)| weighing.weights(f, &v.0)).collect();
        if theta.room.radiance {
            let smooth = theta.with(P::Quality, 0.0);
            self.beside_factor(frames, &smooth, radiance, block, &weights, values);
        }
        if theta.room.poses.is_empty() {
            return Vec::new();
        }
        let (shared, moving) = (&*self, moved_by_poses(theta));
        let one = |f: usize, (r, columns): &mut FrameValues| {
            let picture = shared.develop(frames[f], &radiance[f], &moving, &Tone::new(&moving));
            let own = shared.pose_columns(frames[f], &picture, &moving);
            let own: Vec<_> = own.iter().map(|d| pooled(d, picture.width, picture.height, block)).collect();
            eliminated(frames[f], &own, &weights[f], r, columns)
        };
        values.par_iter_mut().enumerate().filter_map(|(f, v)| one(f, v)).collect()
    }

    fn beside_factor(
        &mut self,
        frames: &[usize],
        theta: &Theta,
        radiance: &[Arc<Plane<f32>>],
        block: usize,
        weights: &[Vec<f32>],
        values: &mut [FrameValues],
    ) {
        let surfaces: Vec<_> = frames.iter().map(|&at| self.surface(at, theta)).collect();
        let (shared, tone) = (&*self, Tone::new(theta));
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        let (cw, ch) = (w / block, h / block);
        let slopes: Vec<Vec<f32>> = (0..frames.len())
            .into_par_iter()
            .map(|f| {
                let mut lit = (*radiance[f]).clone();
                let now = shared.develop(frames[f], &lit, theta, &tone);
                lit.data.iter_mut().for_each(|l| *l *= STEP.exp());
                let then = shared.develop(frames[f], &lit, theta, &tone);
                let d: Vec<f32> = then.data.iter().zip(&now.data).map(|(a, b)| (a - b) / STEP).collect();
                pooled(&d, w, h, block)
            })
            .collect();
        let middle = |i: usize| (i / cw * block + block / 2) * w + i % cw * block + block / 2;
        let seen: Vec<(Vec<u32>, Vec<[f32; 3]>)> = surfaces
            .iter()
            .map(|s| {
                let cells = (0..cw * ch).map(|i| s.cell.get(middle(i)).copied().unwrap_or(NONE)).collect();
                (cells, (0..cw * ch).map(|i| s.local[middle(i)]).collect())
            })
            .collect();
        let count = values.first().map_or(0, |v| v.1.len());
        let mut columns: Vec<Vec<Vec<f32>>> =
            (0..count).map(|j| values.iter_mut().map(|v| std::mem::take(&mut v.1[j])).collect()).collect();
        let takeover = Takeover::new(&shared.description.grid, &seen, &slopes, weights);
        columns.par_iter_mut().for_each(|column| {
            let mut pictures: Vec<&mut Vec<f32>> = column.iter_mut().collect();
            takeover.take_out(&mut pictures);
        });
        for (j, column) in columns.into_iter().enumerate() {
            values.iter_mut().zip(column).for_each(|(v, d)| v.1[j] = d);
        }
    }
}

/// The camera whose pictures poses move: a compressor's steps have no slope, and what is stuck stays in its place.
fn moved_by_poses(theta: &Theta) -> Theta {
    theta.with(P::Quality, 0.0).with(P::Hot, 0.0)
}
