//! `scene_radiance`: a constant factor on the radiance of every surface point, estimated from the frames themselves.
//!
//! The factor is no parameter of a fit: for every camera it is worked out anew from the frames that fits see, so that
//! what a camera cannot explain in all of them alike is left. Its logarithm is linear between the corners of the cells
//! of a [`Grid`], see [`super::reconstruct`].

use std::collections::HashMap;

use rayon::prelude::*;

use super::grid::{Grid, NONE, PARTS, Part, Surface, weights};
use super::reconstruct::{Places, mixed};
use shutterbug::plane::{Plane, three};
use shutterbug::reference::moments::Lattice;

/// Logarithm by which pictures are brightened to see what a factor does.
pub(crate) const STEP: f32 = 0.05;
/// Newton steps: a factor of two is not linear in DN.
pub(crate) const STEPS: usize = 3;
/// Most of them, while much is far from done.
const MOST_STEPS: usize = 6;
/// Slope of a delivered value by the logarithm of its radiance just below the end of the range (sRGB), DN: at the end
/// there is none, but it is known where it has to go.
const SLOPE_BELOW_WHITE: f32 = 255.0 * 1.055 / 2.4;
/// Less than that is none, DN.
const NO_SLOPE: f32 = 1.0;
/// Passes of the reconstruction a step.
const PASSES: usize = 4;
/// Most that a step changes a logarithm by.
const MOST: f32 = 0.7;
/// Samples across a picture that factors are estimated from: cells are much larger than pixels.
const ACROSS: usize = 107;
/// Every so many pixels are looked at where only means are asked for.
const EVERY: usize = 7;
/// Differences from here on count less, DN: edges out of place.
const LARGE_DN: f32 = 4.0;

/// The factor's logarithm by corner and colour, and how much was seen of each corner.
#[derive(Default)]
pub(crate) struct Map {
    pub log: Vec<[f32; 3]>,
    pub seen: Vec<f32>,
    /// The logarithm before the last step.
    before: Vec<[f32; 3]>,
}

/// What one place of one frame says.
struct Sample {
    cell: u32,
    local: [f32; 3],
    weight: [f32; 3],
    left: [f32; 3],
    /// Whether a colour is simulated at the end of the range, and is not there.
    clipped: bool,
}

/// Takes Newton steps, `least` or more, each told its number; it answers whether much is far from done (see
/// [`Map::learn`]). What has only just left the end of the range is not where it goes yet: then as many follow as
/// without.
pub(crate) fn in_steps(least: usize, mut step: impl FnMut(usize) -> bool) {
    let mut left = least;
    for number in 0..MOST_STEPS {
        left = if step(number) { least } else { left - 1 };
        if left == 0 {
            return;
        }
    }
}

/// A frame to learn from: what it shows, what is simulated of the pixels of [`lattice`], and that brightened by
/// [`STEP`].
pub(crate) struct Lesson<'a> {
    pub surface: &'a Surface,
    pub real: &'a Plane<f32>,
    pub simulated: &'a Plane<f32>,
    pub brighter: &'a Plane<f32>,
}

impl Map {
    /// Improves the factor by what frames leave; whether that is far from done, because more than a hundredth is
    /// simulated at the end of the range, or has to go further than a step goes (deep shadows).
    pub(crate) fn learn(&mut self, grid: &Grid, lessons: &[Lesson<'_>]) -> bool {
        self.log.resize(grid.count(), [0.0; 3]);
        let samples: Vec<Sample> = lessons.par_iter().flat_map_iter(samples).collect();
        let places = Places::new(grid, samples.iter().map(|s| (s.cell, s.local, s.weight)));
        let mut left: Vec<[f32; 3]> = samples.iter().map(|s| s.left).collect();
        let change = places.reconstructed(&mut left, PASSES);
        self.before.clone_from(&self.log);
        self.log
            .iter_mut()
            .zip(&change)
            .for_each(|(a, b)| (0..3).for_each(|c| a[c] += b[c].clamp(-MOST, MOST)));
        self.seen = places.seen();
        let clipped = samples.iter().filter(|s| s.clipped).count();
        let corners = || change.iter().zip(&self.seen).filter(|(_, seen)| **seen >= LEAST_SEEN);
        let cut_off = corners().filter(|(by, _)| by.iter().any(|v| v.abs() >= MOST)).count();
        100 * clipped > samples.len() || 100 * cut_off > corners().count()
    }

    /// As it was before its last step: the same step with another camera, and both have come as far.
    pub(crate) fn before_last_step(&self) -> Self {
        Self { log: self.before.clone(), ..Self::default() }
    }

    /// Gives corners that nothing was seen of what their group has, or their surface, or all.
    pub(crate) fn fill(&mut self, grid: &Grid) {
        let mut sums: HashMap<[u32; 2], [f32; 4]> = HashMap::new();
        let kinds = |group: u32| [[0, group], [1, grid.surface[group as usize]], [2, 0]];
        for ((log, seen), &group) in self.log.iter().zip(&self.seen).zip(&grid.group) {
            for kind in kinds(group).into_iter().filter(|_| *seen >= LEAST_SEEN) {
                let sum = sums.entry(kind).or_default();
                (0..3).for_each(|c| sum[c] += seen * log[c]);
                sum[3] += seen;
            }
        }
        for ((log, seen), &group) in self.log.iter_mut().zip(&self.seen).zip(&grid.group) {
            if *seen < LEAST_SEEN
                && let Some([r, g, b, n]) = kinds(group).iter().find_map(|k| sums.get(k))
            {
                *log = [r / n, g / n, b / n];
            }
        }
    }

    /// Whether frames that were learnt from saw a place.
    pub(crate) fn covers(&self, grid: &Grid, cell: u32, local: [f32; 3]) -> bool {
        let parts = grid.of_cell[cell as usize].iter().zip(weights(local));
        let seen = |corner: u32| self.seen.get(corner as usize).is_some_and(|s| *s >= LEAST_SEEN);
        parts.map(|(&corner, part)| if seen(corner) { part } else { 0.0 }).sum::<f32>() >= 0.5
    }

    /// Some of the pixels, evenly spread, whose surface frames that were learnt from saw, and the logarithm of the
    /// factor there.
    pub(crate) fn seen_in<'a>(
        &'a self,
        grid: &'a Grid,
        surface: &'a Surface,
    ) -> impl Iterator<Item = (usize, [f32; 3])> + 'a {
        let places = surface.cell.iter().zip(&surface.local).enumerate().step_by(EVERY);
        let seen = places.filter(|(_, (cell, local))| **cell != NONE && self.covers(grid, **cell, **local));
        seen.map(|(i, (&cell, &local))| (i, mixed(grid, &self.log, cell, local)))
    }

    /// Puts the factor on the radiance of some pixels of a picture of `size` (columns, rows). Of a part of the picture,
    /// borders between surfaces are left as if they saw one.
    pub(crate) fn light(
        &self,
        grid: &Grid,
        surface: &Surface,
        (on, size): (Lattice, [usize; 2]),
        radiance: &mut Plane<f32>,
    ) {
        if on == Lattice::WHOLE {
            let factor = self.factor(grid, surface, size);
            return radiance.data.iter_mut().zip(&factor.data).for_each(|(l, f)| *l *= f);
        }
        for (light, i) in radiance.data.chunks_exact_mut(3).zip(on.places(size)) {
            let factor = self.factor_at(grid, surface, i);
            (0..3).for_each(|c| light[c] *= factor[c]);
        }
    }

    fn factor_at(&self, grid: &Grid, surface: &Surface, i: usize) -> [f32; 3] {
        match surface.cell[i] {
            NONE => [1.0; 3],
            cell => mixed(grid, &self.log, cell, surface.local[i]).map(f32::exp),
        }
    }

    /// The factor on each value of a picture, shape `[height, width, 3]`.
    pub(crate) fn factor(&self, grid: &Grid, surface: &Surface, [w, h]: [usize; 2]) -> Plane<f32> {
        let mut out = Plane::new(w, h, 3);
        let pixels = out.data.par_chunks_exact_mut(3).enumerate().with_min_len(1024);
        pixels.for_each(|(i, to)| to.copy_from_slice(&self.factor_at(grid, surface, i)));
        let of_parts = |parts: &[Part; PARTS]| {
            let mut sum = [0.0f32; 3];
            for part in parts.iter().filter(|p| p.cell != NONE) {
                let log = mixed(grid, &self.log, part.cell, part.local);
                (0..3).for_each(|c| sum[c] += part.share[c] * log[c].exp());
            }
            sum
        };
        let borders: Vec<[f32; 3]> =
            surface.mixed.par_iter().with_min_len(256).map(|(_, parts)| of_parts(parts)).collect();
        for ((i, _), sum) in surface.mixed.iter().zip(borders) {
            out.data[3 * *i as usize..3 * *i as usize + 3].copy_from_slice(&sum);
        }
        out
    }
}

/// Samples around a corner that make it seen.
const LEAST_SEEN: f32 = 1.0;

/// The pixels that factors are estimated from.
pub(crate) fn lattice(width: usize) -> Lattice {
    let step = (width / ACROSS).max(1);
    Lattice { first: step / 2, step }
}

fn samples(lesson: &Lesson<'_>) -> Vec<Sample> {
    let (w, h) = (lesson.real.width, lesson.real.height);
    let one = |(sample, i): (usize, usize)| {
        let cell = lesson.surface.cell[i];
        if cell == NONE || !lesson.surface.clean[i] {
            return None;
        }
        let (mut weight, mut left, mut clipped) = ([0.0; 3], [0.0; 3], false);
        for c in 0..3 {
            let simulated = lesson.simulated.data[3 * sample + c];
            let off = lesson.real.data[3 * i + c] - simulated;
            let mut slope = (lesson.brighter.data[3 * sample + c] - simulated) / STEP;
            if slope < NO_SLOPE && simulated > 128.0 && off < -1.0 {
                (slope, clipped) = (SLOPE_BELOW_WHITE, true);
            }
            // Least squares far from a bright solution would be drawn by it: large differences count by their size.
            weight[c] = slope * slope / (1.0 + (off / LARGE_DN).abs()) + 1e-3;
            left[c] = (off * slope / (slope * slope + 1.0)).clamp(-MOST, MOST);
        }
        Some(Sample { cell, local: lesson.surface.local[i], weight, left, clipped })
    };
    lattice(w).places([w, h]).enumerate().filter_map(one).collect()
}

/// What a factor could take over of pictures.
pub(crate) struct Takeover<'a> {
    /// By frame: cells that the values' pixels see, and places within them.
    seen: &'a [(Vec<u32>, Vec<[f32; 3]>)],
    /// By frame: what a factor's logarithm moves values by.
    slopes: &'a [Vec<f32>],
    places: Places,
}

impl<'a> Takeover<'a> {
    pub(crate) fn new(
        grid: &Grid,
        seen: &'a [(Vec<u32>, Vec<[f32; 3]>)],
        slopes: &'a [Vec<f32>],
        weights: &[Vec<f32>],
    ) -> Self {
        let weight = |(f, i): (usize, usize)| {
            let value = |c: usize| weights[f][3 * i + c] * slopes[f][3 * i + c].powi(2) + 1e-9;
            (seen[f].0[i], seen[f].1[i], three(value))
        };
        Self { seen, slopes, places: Places::new(grid, places_of(seen).map(weight)) }
    }

    /// Takes it out of some pictures, one a frame.
    pub(crate) fn take_out(&self, pictures: &mut [&mut Vec<f32>]) {
        let left = |(f, i): (usize, usize)| {
            let value = |c: usize| {
                let slope = self.slopes[f][3 * i + c];
                slope * pictures[f][3 * i + c] / (slope.powi(2) + 1.0)
            };
            three(value)
        };
        let mut left: Vec<[f32; 3]> = places_of(self.seen).map(left).collect();
        let field = self.places.reconstructed(&mut left, 2 * PASSES);
        for ((f, i), by) in places_of(self.seen).zip(self.places.of(&field)) {
            (0..3).for_each(|c| pictures[f][3 * i + c] -= self.slopes[f][3 * i + c] * by[c]);
        }
    }
}

/// Frames and pixels of them that see a surface.
fn places_of(seen: &[(Vec<u32>, Vec<[f32; 3]>)]) -> impl Iterator<Item = (usize, usize)> + '_ {
    seen.iter().enumerate().flat_map(|(f, (cells, _))| {
        cells.iter().enumerate().filter(|(_, cell)| **cell != NONE).map(move |(i, _)| (f, i))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall of 4 m seen twice, 40 px a meter.
    fn wall(grid: &mut Grid, shift_m: f32) -> Surface {
        let (w, h) = (160, 40);
        let mut surface = Surface {
            cell: vec![NONE; w * h],
            local: vec![[0.0; 3]; w * h],
            clean: vec![true; w * h],
            mixed: Vec::<(u32, [Part; 8])>::new(),
        };
        for i in 0..w * h {
            let at = glam::Vec3::new((i % w) as f32 / 40.0 + shift_m, (i / w) as f32 / 40.0, 0.05);
            (surface.cell[i], surface.local[i]) = grid.place_for_tests(at);
        }
        surface
    }

    /// The factor, its mean over a wall, that real frames of 120 DN ask of one that is simulated as so many DN, if it
    /// were not for the end of the range.
    fn learnt_of_a_bright_wall(simulated_dn: f32) -> f32 {
        let mut grid = Grid::new(0.2);
        let surface = wall(&mut grid, 0.0);
        let (mut map, real) = (Map::default(), Plane::from_fn(160, 40, |_, _| [120.0; 3]));
        let mean = |map: &Map| {
            let factor = map.factor(&grid, &surface, [160, 40]).data;
            factor.iter().sum::<f32>() / factor.len() as f32
        };
        in_steps(STEPS, |step| {
            let factor = if step == 0 { 1.0 } else { mean(&map) };
            let picture = |by: f32| {
                Plane::from_fn(160, 40, |_, _| [(simulated_dn * by * factor.powf(1.0 / 2.4)).min(255.0); 3])
            };
            let (simulated, brighter) = (picture(1.0), picture((STEP / 2.4).exp()));
            let lesson =
                Lesson { surface: &surface, real: &real, simulated: &simulated, brighter: &brighter };
            map.learn(&grid, &[lesson])
        });
        mean(&map)
    }

    #[test]
    fn what_is_simulated_at_the_end_of_the_range_is_darkened_too() {
        // The last two leave the range; the last needs a factor of a twentieth.
        for simulated_dn in [200.0f32, 280.0, 400.0] {
            let (factor, want) = (learnt_of_a_bright_wall(simulated_dn), (120.0 / simulated_dn).powf(2.4));
            assert!((factor / want - 1.0).abs() < 0.1, "{simulated_dn} DN: {factor} for {want}");
        }
    }

    #[test]
    fn a_lamp_on_a_wall_is_learnt_and_a_detail_is_not() {
        let mut grid = Grid::new(0.2);
        let surfaces = [wall(&mut grid, 0.0), wall(&mut grid, 0.1)];
        // Brightness in DN, with a slope of 100 DN a unit of the logarithm.
        let lamp = |x: f32| 0.3 * (1.5 * x).sin();
        let detail = |x: f32| 0.1 * (x * 40.0 * 1.6).sin();
        let picture = |shift: f32, f: &dyn Fn(f32) -> f32| {
            Plane::from_fn(160, 40, |x, _| [100.0 + 100.0 * f(x as f32 / 40.0 + shift); 3])
        };
        let learnt = |f: &dyn Fn(f32) -> f32| {
            let (real, plain) = ([picture(0.0, f), picture(0.1, f)], picture(0.0, &|_| 0.0));
            let brighter = picture(0.0, &|_| STEP);
            let lesson = |i: usize| Lesson {
                surface: &surfaces[i],
                real: &real[i],
                simulated: &plain,
                brighter: &brighter,
            };
            let mut map = Map::default();
            map.learn(&grid, &[lesson(0), lesson(1)]);
            map.factor(&grid, &surfaces[0], [160, 40])
                .data
                .iter()
                .step_by(3)
                .map(|v| v.ln())
                .collect::<Vec<_>>()
        };
        let off = |found: &[f32], f: &dyn Fn(f32) -> f32| {
            let all = found.iter().enumerate().map(|(i, v)| (v - f((i % 160) as f32 / 40.0)).powi(2));
            (all.sum::<f32>() / found.len() as f32).sqrt()
        };
        let seen = learnt(&lamp);
        assert!(off(&seen, &lamp) < 0.03, "{}", off(&seen, &lamp));
        let fine = learnt(&detail);
        assert!(
            off(&fine, &|_| 0.0) < 0.02,
            "control: a factor follows a detail by {}",
            off(&fine, &|_| 0.0)
        );
    }
}
