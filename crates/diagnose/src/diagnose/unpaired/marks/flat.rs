//! Which blocks are flat, told by the means of their cells, so that choosing flat places does not choose quiet ones.
//! Texture is stronger the coarser one looks, noise weaker: cells tell them apart.

use rayon::prelude::*;

use super::blocks::Block;

/// A block is flat if it varies by no more than so many standard deviations above what noise makes of it.
const FLAT: f64 = 2.0;
/// Shapes of noise over brightness that are tried: the part that grows with it.
const SHAPES: [f64; 8] = [0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0];
/// Levels of noise that are tried for each.
const LEVELS: usize = 60;
/// Rounds in which the shape is refined.
const ROUNDS: usize = 15;
/// Fewest blocks from which noise is told.
const FEWEST: usize = 10;

/// One way in which a block may vary.
#[derive(Clone, Copy)]
struct Varying {
    /// Linear variance, for one pixel.
    of: fn(&Block) -> f64,
    /// Standard deviation of it where there is only noise, as a part of it: the root of two over the degrees of
    /// freedom.
    scatter: f64,
}

/// Cells beside each other: sixteen, less four rows and a slope.
const ACROSS: Varying = Varying { of: |b| b.cells, scatter: 0.43 };
/// Rows below each other: eight, less a line.
const DOWN: Varying = Varying { of: |b| b.bands, scatter: 0.58 };

/// Which blocks are flat: they vary no more than noise makes them, within rows and from row to row. Flat blocks are
/// alike in that and textured ones are not: over brightness, in some proportion of a constant and a part that grows
/// with it, they lie close together, with few above them. Rows have a noise of their own, so that the two are apart.
pub(in super::super) fn flat(frames: &[Vec<Block>]) -> Vec<Vec<bool>> {
    let all: Vec<&Block> = frames.iter().flatten().collect();
    let across = ACROSS.noise(&all);
    let even: Vec<&Block> =
        all.iter().copied().filter(|b| across.is_some_and(|n| ACROSS.is_flat(b, n))).collect();
    let down = DOWN.noise(&even);
    let is_flat =
        |b: &Block| across.is_some_and(|n| ACROSS.is_flat(b, n)) && down.is_some_and(|n| DOWN.is_flat(b, n));
    frames.iter().map(|f| f.iter().map(is_flat).collect()).collect()
}

impl Varying {
    /// The noise of flat blocks (a constant part, and that which grows with brightness); nothing from too few.
    fn noise(self, all: &[&Block]) -> Option<[f64; 2]> {
        (all.len() >= FEWEST).then(|| self.refined(all, self.crowded(all)))
    }

    /// Whether a block varies no more than that noise makes it.
    fn is_flat(self, b: &Block, noise: [f64; 2]) -> bool {
        (self.of)(b) <= (1.0 + FLAT * self.scatter) * (noise[0] + noise[1] * b.level) + b.rounding
    }

    /// The noise about which most blocks lie close together, less those that lie a little above.
    fn crowded(self, all: &[&Block]) -> [f64; 2] {
        // A constant beside the noise at a tenth of full scale.
        let shape = |growing: f64| [0.1 * (1.0 - growing), growing];
        let above = (1.0 + FLAT * self.scatter).ln();
        let tried = SHAPES.into_par_iter().map(|growing| {
            let [c, s] = shape(growing);
            let log = |b: &&Block| (((self.of)(b) + 0.3 * b.rounding) / (c + s * b.level).max(1e-9)).ln();
            let mut logs: Vec<f64> = all.iter().map(log).collect();
            logs.sort_by(f64::total_cmp);
            let (from, to) = (logs[logs.len() / 300], logs[logs.len() / 2]);
            let below = |v: f64| logs.partition_point(|l| *l < v) as f64;
            let score = |m: f64| 2.0 * below(m + above) - below(m - 2.0 * above) - below(m + 3.0 * above);
            let levels = (0..LEVELS).map(|k| from + (to - from) * k as f64 / LEVELS as f64);
            let best =
                levels.map(|m| (score(m), m)).max_by(|a, b| a.0.total_cmp(&b.0)).expect("some are tried");
            (best.0, shape(growing).map(|v| v * best.1.exp()))
        });
        let tried: Vec<(f64, [f64; 2])> = tried.collect();
        tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).expect("some are tried").1
    }

    /// The same from all flat blocks, by least squares.
    fn refined(self, all: &[&Block], begin: [f64; 2]) -> [f64; 2] {
        let mut noise = begin;
        for _ in 0..ROUNDS {
            let (mut a, mut v) = ([[0.0; 2]; 2], [0.0; 2]);
            for b in all.iter().filter(|b| self.is_flat(b, noise)) {
                let own = noise[0] + noise[1] * b.level + b.rounding;
                let (weight, g) = (1.0 / (own * own), [1.0, b.level]);
                for i in 0..2 {
                    v[i] += weight * g[i] * (self.of)(b);
                    (0..2).for_each(|j| a[i][j] += weight * g[i] * g[j]);
                }
            }
            let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
            let both = [(v[0] * a[1][1] - v[1] * a[0][1]) / det, (v[1] * a[0][0] - v[0] * a[1][0]) / det];
            // Neither part is negative: then the other alone.
            noise = match both {
                [c, s] if c >= 0.0 && s >= 0.0 => both,
                [c, _] if c < 0.0 => [0.0, v[1] / a[1][1]],
                _ if a[0][0] > 0.0 => [v[0] / a[0][0], 0.0],
                _ => return noise,
            };
        }
        noise
    }
}
