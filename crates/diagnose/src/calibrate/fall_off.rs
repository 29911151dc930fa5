//! How the light of an even surface falls off towards the corners, from means over blocks.

use nalgebra::{DMatrix, DVector};

use super::blocks::BLOCK_PX;
use shutterbug::plane::Plane;

/// Side of the cells whose means a smooth surface is fitted to, px.
const CELL_PX: usize = 16;
/// Powers of the two directions in a surface of the fourth degree.
const POWERS: [[i32; 2]; 15] = [
    [0, 0],
    [1, 0],
    [0, 1],
    [2, 0],
    [1, 1],
    [0, 2],
    [3, 0],
    [2, 1],
    [1, 2],
    [0, 3],
    [4, 0],
    [3, 1],
    [2, 2],
    [1, 3],
    [0, 4],
];

/// Sums over pictures.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    size: [usize; 2],
    /// Of block means (linear): dark pictures tell less.
    sums: Vec<f64>,
    /// Blocks that are cut off at white in one of the pictures.
    white: Vec<bool>,
}

impl Blocks {
    pub(super) fn new(width: usize, height: usize) -> Self {
        let blocks = (width / BLOCK_PX) * (height / BLOCK_PX);
        Self { size: [width, height], sums: vec![0.0; blocks], white: vec![false; blocks] }
    }

    /// Sum of the pictures' means over the blocks that are not white.
    pub(super) fn level(&self) -> f64 {
        let kept: Vec<f64> =
            self.sums.iter().zip(&self.white).filter(|(_, w)| !**w).map(|(s, _)| *s).collect();
        kept.iter().sum::<f64>() / kept.len().max(1) as f64
    }

    pub(super) fn count(&self) -> usize {
        self.sums.len()
    }

    /// Share of the blocks that are left out.
    pub(super) fn white_share(&self) -> f64 {
        self.white.iter().filter(|w| **w).count() as f64 / self.white.len().max(1) as f64
    }

    /// Whether a pixel, by its index, lies in a block that is left out.
    pub(super) fn is_white(&self, pixel: usize) -> bool {
        let [across, down] = self.size.map(|s| s / BLOCK_PX);
        let [x, y] = [pixel % self.size[0] / BLOCK_PX, pixel / self.size[0] / BLOCK_PX];
        x < across && y < down && self.white[y * across + x]
    }

    /// Sets what is left out of a pattern to nothing.
    pub(super) fn clear_white(&self, pattern: &mut Plane<f32>) {
        for block in (0..self.white.len()).filter(|b| self.white[*b]) {
            self.rows(block).for_each(|row| pattern.data[row].fill(0.0));
        }
    }

    fn rows(&self, block: usize) -> impl Iterator<Item = std::ops::Range<usize>> + use<> {
        let [width, _] = self.size;
        let across = width / BLOCK_PX;
        let (x0, y0) = (block % across * BLOCK_PX, block / across * BLOCK_PX);
        (y0..y0 + BLOCK_PX).map(move |y| y * width + x0..y * width + x0 + BLOCK_PX)
    }

    /// Adds a picture: linear, one channel.
    pub(super) fn add(&mut self, light: &Plane<f32>) {
        for block in 0..self.sums.len() {
            let values = self.rows(block).flat_map(|row| &light.data[row]);
            self.sums[block] += values.map(|v| f64::from(*v)).sum::<f64>() / (BLOCK_PX * BLOCK_PX) as f64;
        }
    }

    /// Leaves the blocks out in which two neighbours of a row have a channel at `white` or beyond: one alone is a stuck
    /// pixel.
    pub(super) fn leave_out_white(&mut self, encoded: &Plane<f32>, white: f32) {
        let n = encoded.channels;
        for block in 0..self.white.len() {
            let is_white = |pixel: usize, c: usize| encoded.data[pixel * n + c] >= white;
            let pair = |row: std::ops::Range<usize>| {
                (row.start..row.end - 1).any(|i| (0..n).any(|c| is_white(i, c) && is_white(i + 1, c)))
            };
            self.white[block] |= self.rows(block).any(pair);
        }
    }

    /// Leaves out the blocks that others of the same pictures leave out.
    pub(super) fn leave_out_as(&mut self, other: &Self) {
        self.white.clone_from(&other.white);
    }

    /// Fall-off, what it leaves in the corners, tilt and the rest: values with standard deviations, where they have
    /// one. `levels`: the sum of the pictures' levels. `rounding`: the most that each block may be off by, of
    /// the level.
    pub(super) fn shape(&self, levels: f64, rounding: f64) -> [[f64; 2]; 5] {
        let [w, h] = self.size.map(|s| s as f64);
        let across = self.size[0] / BLOCK_PX;
        let half = 0.5 * w.hypot(h);
        let spread = ((BLOCK_PX * BLOCK_PX) as f64 - 1.0) / 12.0 / (half * half);
        let columns = |k: usize, [a1, a2]: [f64; 2]| {
            let middle = |i: usize| (i as f64 + 0.5) * BLOCK_PX as f64;
            let x = (middle(k % across) - 0.5 * w) / half;
            let y = (middle(k / across) - 0.5 * h) / half;
            // Means over the block: of x^2, and of x^4 of a uniform spread.
            let [x2, y2] = [x, y].map(|v| v * v + spread);
            let fourth = |v: f64| v.powi(4) + 6.0 * v * v * spread + 1.8 * spread * spread;
            let (q, q2) = (x2 + y2, fourth(x) + 2.0 * x2 * y2 + fourth(y));
            // The light's tilt falls off with the rest of it.
            let fall = 1.0 + a1 * q + a2 * q2;
            [1.0, q, q2, x * fall, y * fall]
        };
        let kept: Vec<usize> = (0..self.sums.len()).filter(|k| !self.white[*k]).collect();
        let rows = kept.len();
        let b = DVector::from_iterator(rows, kept.iter().map(|k| self.sums[*k] / levels));
        let solved = |known: [f64; 2]| {
            let a = DMatrix::from_fn(rows, 5, |k, c| columns(kept[k], known)[c]);
            let solver = (a.transpose() * &a).try_inverse()? * a.transpose();
            let x = &solver * &b;
            let left = (&b - &a * &x).norm_squared();
            Some((x, solver, left))
        };
        let first = solved([0.0; 2]).map(|(x, _, _)| [x[1] / x[0], x[2] / x[0]]);
        let Some((x, solver, left)) = first.and_then(solved) else { return [[0.0; 2]; 5] };
        let variance = left / (rows as f64 - 5.0).max(1.0);
        let by = |i: usize| {
            let row = solver.row(i);
            // By rounding all blocks are off together.
            let together = rounding * row.iter().map(|v| v.abs()).sum::<f64>() / 1.96;
            [x[i] / x[0], (variance.sqrt() * row.norm() + together) / x[0]]
        };
        let both = solver.row(1) + solver.row(2);
        let together = rounding * both.iter().map(|v| v.abs()).sum::<f64>() / 1.96;
        let corner = [(x[0] + x[1] + x[2]) / x[0], (variance.sqrt() * both.norm() + together) / x[0]];
        let uneven = (left / rows as f64).sqrt() / x[0];
        [by(1), by(2), corner, [x[3].hypot(x[4]) / x[0], 0.0], [uneven, 0.0]]
    }
}

/// A picture over the surface of the fourth degree that is nearest to it: what a lens and an uneven light make of it
/// bends within the surroundings of a pixel, and is cut off with them at the border. `blocks`: what of it is white.
pub(super) fn without_fall_off(light: &Plane<f32>, blocks: &Blocks) -> Plane<f32> {
    let (w, h) = (light.width, light.height);
    let [across, down] = [w, h].map(|n| n / CELL_PX);
    let along = |i: f64, n: usize| 2.0 * (i + 0.5) / n as f64 - 1.0;
    let middle = |cell: usize, n: usize| along((cell * CELL_PX) as f64 + 0.5 * (CELL_PX as f64 - 1.0), n);
    let cell = |k: usize| {
        let (x0, y0) = (k % across * CELL_PX, k / across * CELL_PX);
        let rows = (y0..y0 + CELL_PX).flat_map(|y| &light.row(y)[x0..x0 + CELL_PX]);
        rows.map(|v| f64::from(*v)).sum::<f64>() / (CELL_PX * CELL_PX) as f64
    };
    let is_white = |k: &usize| blocks.is_white(k / across * CELL_PX * w + k % across * CELL_PX);
    let cells: Vec<usize> = (0..across * down).filter(|k| !is_white(k)).collect();
    let places: Vec<[f64; 2]> =
        cells.iter().map(|k| [middle(k % across, w), middle(k / across, h)]).collect();
    if places.len() < 2 * POWERS.len() {
        return light.clone();
    }
    let terms = DMatrix::from_fn(places.len(), POWERS.len(), |k, c| term(places[k], POWERS[c]));
    let means = DVector::from_iterator(cells.len(), cells.iter().map(|k| cell(*k)));
    let Some(solved) = (terms.tr_mul(&terms)).cholesky().map(|a| a.solve(&terms.tr_mul(&means))) else {
        return light.clone();
    };
    let top = means.max();
    let at = |x: usize, y: usize| {
        let place = [along(x as f64, w), along(y as f64, h)];
        POWERS.iter().zip(&solved).map(|(powers, c)| c * term(place, *powers)).sum::<f64>()
    };
    // Never near nothing, where there is no light.
    Plane::from_fn(w, h, |x, y| [(f64::from(light.row(y)[x]) * top / at(x, y).max(1e-3 * top)) as f32])
}

fn term([x, y]: [f64; 2], [i, j]: [i32; 2]) -> f64 {
    x.powi(i) * y.powi(j)
}

#[cfg(test)]
mod tests {
    use super::super::flat::{Flat, FlatSums};
    use super::super::frames::Encoding;
    use super::*;
    use shutterbug::chain::rng::random_normal;
    use shutterbug::error::Result;

    /// Four pictures of light that reaches `top` in the middle, of gains that differ by 0.6 %.
    fn measured(top: f32) -> Result<Flat> {
        let (w, h) = (384, 320);
        let mut sums = FlatSums::new(w, h, Encoding::Linear, 0.0);
        for frame in 0..4u32 {
            let picture = Plane::from_fn(w, h, |x, y| {
                let dice = |stream: u32| random_normal([x as u32, y as u32], 0, stream, [3, 5])[0];
                let (dx, dy) = ((x as f32 + 0.5 - 192.0) / 250.0, (y as f32 + 0.5 - 160.0) / 250.0);
                let light = top * (1.0 - 0.3 * (dx * dx + dy * dy)) * (1.0 + 0.006 * dice(99));
                [((light + 0.004 * dice(frame)) * 255.0).round().clamp(0.0, 255.0) / 255.0]
            });
            sums.add(&picture, 1.0 / 255.0);
        }
        sums.measure(std::path::Path::new("flat"))
    }

    /// Without gains of its own a sensor has no pattern, whatever the lens does.
    #[test]
    fn a_fall_off_is_no_pattern() {
        let (w, h) = (240, 180);
        let flat = |a1: f32, prnu: f32| {
            let mut sums = FlatSums::new(w, h, Encoding::Linear, 0.0);
            for frame in 0..4 {
                let picture = Plane::from_fn(w, h, |x, y| {
                    let dice = |stream: u32| random_normal([x as u32, y as u32], 0, stream, [4, 5])[0];
                    let (dx, dy) = ((x as f32 + 0.5 - 120.0) / 150.0, (y as f32 + 0.5 - 90.0) / 150.0);
                    let light = 0.5 * (1.0 + a1 * (dx * dx + dy * dy)) * (1.0 + prnu * dice(99));
                    [light + 0.003 * dice(frame)]
                });
                sums.add(&picture, 1.0 / 65535.0);
            }
            sums.measure(std::path::Path::new("flat")).expect("a flat field")
        };
        for a1 in [0.0, -0.4, -0.6] {
            let none = flat(a1, 0.0).prnu;
            assert!(!none.is_some(), "{a1}: {none:?}");
            let some = flat(a1, 0.005).prnu;
            assert!(some.ci95[0] <= 0.005 && 0.005 <= some.ci95[1], "control, {a1}: {some:?}");
        }
    }

    #[test]
    fn what_white_cuts_off_is_left_out_of_fall_off_and_pattern() {
        let holds = |m: &super::super::flat::Measured, truth: f64| m.ci95[0] <= truth && truth <= m.ci95[1];
        for (top, share) in [(0.8, 0.0..=0.0), (1.05, 0.15..=0.6)] {
            let flat = measured(top).unwrap();
            assert!(share.contains(&flat.white), "{top}: {}", flat.white);
            assert!(
                holds(&flat.a1, -0.3) && holds(&flat.prnu, 0.006),
                "{top}: {:?} {:?}",
                flat.a1,
                flat.prnu
            );
            assert!((flat.a1.value + 0.3).abs() < 0.01, "{top}: {:?}", flat.a1);
        }
        let refused = measured(1.6).unwrap_err().to_string();
        assert!(refused.contains("white"), "{refused}");
    }
}
