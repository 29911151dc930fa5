//! Means over blocks of pixels beside those over larger ones: what is coarser than a pixel and finer than a picture.

use super::alike::beside_larger;
use super::{Blocks, SeenIn, Sums};
use crate::diagnose::evidence::blocks::pooled as averages;
use crate::diagnose::expect::discrepancy::DRAWS;

/// Sums over a block of pixels: errors, number, what correct simulations may differ by in single values and in colours,
/// and by band what it sees of noise and rounding, and of noise of rows.
type Pooled = [f64; 10];

/// Differences between means over blocks of 2, 4, 8 px and the means over the block that is twice as large.
pub(super) fn bands(frame: &SeenIn, blocks: Blocks, sums: &mut [Sums]) {
    let ([whole_w, whole_h], unsure) = (frame.size, f64::from(frame.unsure));
    let (mut w, mut h) = (whole_w, whole_h);
    let one = |i: usize| match &frame.values[i] {
        Some(v) => {
            let [a, b, c] = v.bands.map(f64::from);
            let rows = frame.row_bands.get(i).copied().unwrap_or([v.row; 3]);
            let [ra, rb, rc] = rows.map(f64::from);
            [v.error.into(), 1.0, v.single.into(), v.common.into(), a, b, c, ra, rb, rc]
        }
        None => [0.0; 10],
    };
    let mut level: Vec<Pooled> = Vec::new();
    for (band, size) in [2usize, 4, 8].into_iter().enumerate() {
        // Sums of single values are not kept: they would take more than all else of a large picture.
        let fine = match band {
            0 => pooled(one, w, h),
            _ => pooled(|i| level[i], w, h),
        };
        (w, h) = (w / 2, h / 2);
        if w < 2 || h < 2 {
            return;
        }
        let coarse = pooled(|i| fine[i], w, h);
        let full = (size * size) as f64;
        let averaged = |side: usize| -> Vec<Vec<f32>> {
            frame.drawn.iter().map(|draw| averages(&draw.data, whole_w, whole_h, side)).collect()
        };
        let drawn = [averaged(size), averaged(2 * size)];
        let alike = if frame.given { beside_larger(&frame.values, frame.size, size) } else { Vec::new() };
        for (y, x, c) in (0..h / 2 * 2).flat_map(|y| (0..w / 2 * 6).map(move |i| (y, i / 3, i % 3))) {
            let (at, around) = ((y * w + x) * 3 + c, ((y / 2) * (w / 2) + x / 2) * 3 + c);
            let (f, g) = (fine[at], coarse[around]);
            if f[1] < full || g[1] < 4.0 * full {
                continue;
            }
            let error = f[0] / f[1] - g[0] / g[1];
            // Three quarters of the variance of a block's mean remain beside the mean over four of them; of row noise,
            // which is common to both blocks of a row, one half, and as much of a colour's error.
            let free = 0.75 * f[4 + band] / (f[1] * f[1]);
            let row = 0.5 * f[7 + band] / f[1] / size as f64;
            let differ = drawn[0].iter().zip(&drawn[1]).map(|(f, g)| f64::from(f[at] - g[around]).powi(2));
            let alike = alike.get(at).copied().map_or(0.0, f64::from);
            let off =
                0.75 * f[2] / (f[1] * f[1]) + 0.5 * f[3] / f[1] + alike + differ.sum::<f64>() / DRAWS as f64;
            let known = off + unsure * (free + row);
            sums[band].add(blocks.at(x * size, y * size), error, free + row + off, known);
        }
        level = fine;
    }
}

/// Sums over blocks of two by two of what is `at` the places of a picture of `w` by `h` px.
fn pooled(at: impl Fn(usize) -> Pooled, w: usize, h: usize) -> Vec<Pooled> {
    let mut out = vec![[0.0; 10]; (w / 2) * (h / 2) * 3];
    for y in 0..h / 2 * 2 {
        for x in 0..w / 2 * 2 {
            for c in 0..3 {
                let to = &mut out[((y / 2) * (w / 2) + x / 2) * 3 + c];
                let value = at((y * w + x) * 3 + c);
                (0..10).for_each(|k| to[k] += value[k]);
            }
        }
    }
    out
}
