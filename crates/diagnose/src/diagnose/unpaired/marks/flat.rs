//! Which blocks are flat, told by the means of their cells, so that choosing flat places does not choose quiet ones. Texture is
//! stronger the coarser one looks, noise weaker: cells tell them apart.

use rayon::prelude::*;

use super::blocks::Block;

/// Standard deviation of the variance of a block's cells about a plane, as a part of it: sixteen cells, three numbers a plane.
const SCATTER: f64 = 0.39;
/// A block is flat if its cells vary by no more than so many of these above what noise makes of them.
const FLAT: f64 = 2.0;
/// Shapes of noise over brightness that are tried: the part that grows with it.
const SHAPES: [f64; 8] = [0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0];
/// Levels of noise that are tried for each.
const LEVELS: usize = 60;
/// Rounds in which the shape is refined.
const ROUNDS: usize = 15;

/// Which blocks are flat: their cells vary no more than noise makes them. Flat blocks are alike in that and textured ones are not:
/// over brightness, in some proportion of a constant and a part that grows with it, they lie close together, with few above them.
pub(in super::super) fn flat(frames: &[Vec<Block>]) -> Vec<Vec<bool>> {
    let all: Vec<&Block> = frames.iter().flatten().collect();
    if all.len() < 10 {
        return frames.iter().map(|f| vec![false; f.len()]).collect();
    }
    let noise = refined(&all, crowded(&all));
    frames.iter().map(|f| f.iter().map(|b| is_flat(b, noise)).collect()).collect()
}

/// Whether the cells of a block vary no more than noise (its constant part, and that which grows with brightness) makes them.
fn is_flat(b: &Block, noise: [f64; 2]) -> bool {
    b.cells <= (1.0 + FLAT * SCATTER) * (noise[0] + noise[1] * b.level) + b.rounding
}

/// The noise about which most blocks lie close together, less those that lie a little above.
fn crowded(all: &[&Block]) -> [f64; 2] {
    // A constant beside the noise at a tenth of full scale.
    let shape = |growing: f64| [0.1 * (1.0 - growing), growing];
    let above = (1.0 + FLAT * SCATTER).ln();
    let tried = SHAPES.into_par_iter().map(|growing| {
        let [c, s] = shape(growing);
        let log = |b: &&Block| ((b.cells + 0.3 * b.rounding) / (c + s * b.level).max(1e-9)).ln();
        let mut logs: Vec<f64> = all.iter().map(log).collect();
        logs.sort_by(f64::total_cmp);
        let (from, to) = (logs[logs.len() / 300], logs[logs.len() / 2]);
        let below = |v: f64| logs.partition_point(|l| *l < v) as f64;
        let score = |m: f64| 2.0 * below(m + above) - below(m - 2.0 * above) - below(m + 3.0 * above);
        let levels = (0..LEVELS).map(|k| from + (to - from) * k as f64 / LEVELS as f64);
        let best = levels.map(|m| (score(m), m)).max_by(|a, b| a.0.total_cmp(&b.0)).expect("some are tried");
        (best.0, shape(growing).map(|v| v * best.1.exp()))
    });
    let tried: Vec<(f64, [f64; 2])> = tried.collect();
    tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).expect("some are tried").1
}

/// The same from the cells of all flat blocks, by least squares.
fn refined(all: &[&Block], begin: [f64; 2]) -> [f64; 2] {
    let mut noise = begin;
    for _ in 0..ROUNDS {
        let (mut a, mut v) = ([[0.0; 2]; 2], [0.0; 2]);
        for b in all.iter().filter(|b| is_flat(b, noise)) {
            let own = noise[0] + noise[1] * b.level + b.rounding;
            let (weight, g) = (1.0 / (own * own), [1.0, b.level]);
            for i in 0..2 {
                v[i] += weight * g[i] * b.cells;
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
