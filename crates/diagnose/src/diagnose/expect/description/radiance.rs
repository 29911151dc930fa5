//! `scene_radiance`: a constant factor on the radiance of every surface point, estimated from the frames themselves.
//!
//! The factor is no parameter of a fit: for every camera it is worked out anew from the frames that fits see, so that
//! what a camera cannot explain in all of them alike is left. Its logarithm is linear between the corners of the cells
//! of a [`Grid`], and solved for by simultaneous iterative reconstruction (each corner moves by the weighed mean of
//! what is left around it), which needs no matrix.

use std::collections::HashMap;

use rayon::prelude::*;

use super::grid::{Grid, NONE, Surface, weights};
use shutterbug::plane::Plane;

/// Logarithm by which pictures are brightened to see what a factor does.
pub(crate) const STEP: f32 = 0.05;
/// Newton steps: a factor of two is not linear in DN.
const STEPS: usize = 3;
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
/// Differences from here on count less, DN: edges out of place.
const LARGE_DN: f32 = 4.0;

/// The factor's logarithm by corner and colour, and how much was seen of each corner.
#[derive(Default)]
pub(crate) struct Map {
    pub log: Vec<[f32; 3]>,
    pub seen: Vec<f32>,
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

/// Takes Newton steps, each told its number; it answers whether much is far from done (see [`Map::learn`]). What has
/// only just left the end of the range is not where it goes yet: then as many follow as without.
pub(crate) fn in_steps(mut step: impl FnMut(usize) -> bool) {
    let mut left = STEPS;
    for number in 0..MOST_STEPS {
        left = if step(number) { STEPS } else { left - 1 };
        if left == 0 {
            return;
        }
    }
}

/// A frame to learn from: what it shows, what is simulated, and that brightened by [`STEP`].
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
        let mut samples: Vec<Sample> = lessons.iter().flat_map(samples).collect();
        let mut total = vec![[0.0f32; 3]; grid.count()];
        let mut seen = vec![0.0f32; grid.count()];
        for s in &samples {
            for (&corner, part) in grid.of_cell[s.cell as usize].iter().zip(weights(s.local)) {
                (0..3).for_each(|c| total[corner as usize][c] += part * s.weight[c]);
                seen[corner as usize] += part;
            }
        }
        let mut change = vec![[0.0f32; 3]; grid.count()];
        for _ in 0..PASSES {
            let step = means(grid, &samples, &total);
            for s in &mut samples {
                let by = mixed(grid, &step, s.cell, s.local);
                (0..3).for_each(|c| s.left[c] -= by[c]);
            }
            change.iter_mut().zip(&step).for_each(|(a, b)| (0..3).for_each(|c| a[c] += b[c]));
        }
        self.log
            .iter_mut()
            .zip(&change)
            .for_each(|(a, b)| (0..3).for_each(|c| a[c] += b[c].clamp(-MOST, MOST)));
        self.seen = seen;
        let clipped = samples.iter().filter(|s| s.clipped).count();
        let corners = || change.iter().zip(&self.seen).filter(|(_, seen)| **seen >= LEAST_SEEN);
        let cut_off = corners().filter(|(by, _)| by.iter().any(|v| v.abs() >= MOST)).count();
        100 * clipped > samples.len() || 100 * cut_off > corners().count()
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

    /// The factor on each value of a picture, shape `[height, width, 3]`.
    pub(crate) fn factor(&self, grid: &Grid, surface: &Surface, [w, h]: [usize; 2]) -> Plane<f32> {
        let of = |(&cell, &local): (&u32, &[f32; 3])| {
            if cell == NONE { [1.0; 3] } else { mixed(grid, &self.log, cell, local).map(f32::exp) }
        };
        let data: Vec<f32> = surface.cell.par_iter().zip(&surface.local).flat_map_iter(of).collect();
        let mut out = Plane { width: w, height: h, channels: 3, data };
        for (i, parts) in &surface.mixed {
            let to = &mut out.data[3 * *i as usize..3 * *i as usize + 3];
            to.fill(0.0);
            for part in parts.iter().filter(|p| p.cell != NONE) {
                let log = mixed(grid, &self.log, part.cell, part.local);
                (0..3).for_each(|c| to[c] += part.share[c] * log[c].exp());
            }
        }
        out
    }
}

/// Samples around a corner that make it seen.
const LEAST_SEEN: f32 = 1.0;

/// What a field over corners is at a place.
pub(crate) fn mixed(grid: &Grid, field: &[[f32; 3]], cell: u32, local: [f32; 3]) -> [f32; 3] {
    let mut sum = [0.0f32; 3];
    for (&corner, part) in grid.of_cell[cell as usize].iter().zip(weights(local)) {
        let Some(value) = field.get(corner as usize) else { continue };
        (0..3).for_each(|c| sum[c] += part * value[c]);
    }
    sum
}

/// Weighed means of what is left around each corner.
fn means(grid: &Grid, samples: &[Sample], total: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut sums = vec![[0.0f32; 3]; total.len()];
    for s in samples {
        for (&corner, part) in grid.of_cell[s.cell as usize].iter().zip(weights(s.local)) {
            (0..3).for_each(|c| sums[corner as usize][c] += part * s.weight[c] * s.left[c]);
        }
    }
    for (sum, total) in sums.iter_mut().zip(total) {
        (0..3).for_each(|c| sum[c] /= total[c].max(1e-6));
    }
    sums
}

/// Px from one sample to the next.
pub(crate) fn stride(width: usize) -> usize {
    (width / ACROSS).max(1)
}

fn samples(lesson: &Lesson<'_>) -> Vec<Sample> {
    let (w, h) = (lesson.real.width, lesson.real.height);
    let s = stride(w);
    let one = |i: usize| {
        let cell = lesson.surface.cell[i];
        if cell == NONE || !lesson.surface.clean[i] {
            return None;
        }
        let (mut weight, mut left, mut clipped) = ([0.0; 3], [0.0; 3], false);
        for c in 0..3 {
            let v = 3 * i + c;
            let off = lesson.real.data[v] - lesson.simulated.data[v];
            let mut slope = (lesson.brighter.data[v] - lesson.simulated.data[v]) / STEP;
            if slope < NO_SLOPE && lesson.simulated.data[v] > 128.0 && off < -1.0 {
                (slope, clipped) = (SLOPE_BELOW_WHITE, true);
            }
            // Least squares far from a bright solution would be drawn by it: large differences count by their size.
            weight[c] = slope * slope / (1.0 + (off / LARGE_DN).abs()) + 1e-3;
            left[c] = (off * slope / (slope * slope + 1.0)).clamp(-MOST, MOST);
        }
        Some(Sample { cell, local: lesson.surface.local[i], weight, left, clipped })
    };
    let places = (s / 2..h).step_by(s).flat_map(|y| (s / 2..w).step_by(s).map(move |x| y * w + x));
    places.filter_map(one).collect()
}

/// What of some pictures (values that a factor's logarithm moves by `slope` each) a factor could take over, taken out
/// of them. `surfaces` are at the size of the pictures.
pub(crate) fn without_factor(
    grid: &Grid,
    seen: &[(Vec<u32>, Vec<[f32; 3]>)],
    slopes: &[Vec<f32>],
    weights_of: &[Vec<f32>],
    pictures: &mut [&mut Vec<f32>],
) {
    let mut samples = Vec::new();
    for (f, (cells, locals)) in seen.iter().enumerate() {
        for (i, (&cell, &local)) in cells.iter().zip(locals).enumerate().filter(|(_, c)| *c.0 != NONE) {
            let at = |c: usize| (slopes[f][3 * i + c], pictures[f][3 * i + c], weights_of[f][3 * i + c]);
            let weight = [0, 1, 2].map(|c| at(c).2 * at(c).0.powi(2) + 1e-9);
            let left = [0, 1, 2].map(|c| at(c).0 * at(c).1 / (at(c).0.powi(2) + 1.0));
            samples.push(Sample { cell, local, weight, left, clipped: false });
        }
    }
    let mut total = vec![[0.0f32; 3]; grid.count()];
    for s in &samples {
        for (&corner, part) in grid.of_cell[s.cell as usize].iter().zip(weights(s.local)) {
            (0..3).for_each(|c| total[corner as usize][c] += part * s.weight[c]);
        }
    }
    let mut field = vec![[0.0f32; 3]; grid.count()];
    for _ in 0..2 * PASSES {
        let step = means(grid, &samples, &total);
        for s in &mut samples {
            let by = mixed(grid, &step, s.cell, s.local);
            (0..3).for_each(|c| s.left[c] -= by[c]);
        }
        field.iter_mut().zip(&step).for_each(|(a, b)| (0..3).for_each(|c| a[c] += b[c]));
    }
    for (f, (cells, locals)) in seen.iter().enumerate() {
        for (i, (&cell, &local)) in cells.iter().zip(locals).enumerate().filter(|(_, c)| *c.0 != NONE) {
            let by = mixed(grid, &field, cell, local);
            (0..3).for_each(|c| pictures[f][3 * i + c] -= slopes[f][3 * i + c] * by[c]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::description::grid::Part;

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
        in_steps(|step| {
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
