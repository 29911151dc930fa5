//! Small squares of a picture and what they show: noise is measured in those that are flat.

use rayon::prelude::*;

use super::HIGH_PASS;
use shutterbug::plane::stats::{LUMA, luma};
use shutterbug::plane::{Plane, srgb_decode};

/// Side of a block, px.
pub(super) const BLOCK_PX: usize = 8;
/// From one block to the next, px.
pub(super) const STRIDE_PX: usize = 4;
/// Most clipped values of a block that is used: one in fifty.
const MOST_CLIPPED: usize = 3 * BLOCK_PX * BLOCK_PX / 50;
/// Variance that rounding three colours gives their brightness, DN^2.
const ROUNDING_DN2: f64 = (0.299 * 0.299 + 0.587 * 0.587 + 0.114 * 0.114) / 12.0;
/// Side of a cell, px.
const CELL_PX: usize = 2;
/// Cells of a block.
const CELLS: usize = (BLOCK_PX / CELL_PX) * (BLOCK_PX / CELL_PX);
/// Distance of these, px: noise that neighbours share counts whole.
pub(super) const APART: usize = 2;

/// What one block shows. Noise of brightness is made linear: over the sum of the squares of the slopes by which the
/// three colours make it, so that noise of a colour is that of a grey as bright.
pub(in super::super) struct Block {
    /// The sum of the squares of the slopes.
    pub(super) slopes2: f64,
    /// Linear brightness of that grey.
    pub(super) level: f64,
    /// Linear variance of cells about their rows and a common slope, for one pixel: chosen by.
    pub(super) cells: f64,
    /// Linear variance of the means of rows about a line, for one pixel: chosen by.
    pub(super) bands: f64,
    /// Linear variance of near pixels: measured.
    pub(super) fine: f64,
    /// What rounding adds to it.
    pub(super) rounding: f64,
    /// Differences of neighbours across and down, and of values further apart.
    pub(super) near: [f64; 2],
    pub(super) far: [f64; 2],
    /// Means of high-passed values by row, then by column, linear: what the three colours have in common.
    pub(super) rows: [f64; BLOCK_PX],
    pub(super) columns: [f64; BLOCK_PX],
    pub(super) at: [usize; 2],
}

/// All blocks of a picture (DN, shape `[height, width, 3]`) in which nothing is clipped.
pub(in super::super) fn blocks(dn: &Plane<f32>) -> Vec<Block> {
    let (w, h) = (dn.width, dn.height);
    let y: Vec<f32> = dn.data.chunks_exact(3).map(luma).collect();
    // None where not even one block fits.
    let begins = |side: usize| (0..(side + 1).saturating_sub(BLOCK_PX)).step_by(STRIDE_PX);
    let places: Vec<[usize; 2]> = begins(h).flat_map(|y| begins(w).map(move |x| [x, y])).collect();
    places.into_par_iter().filter_map(|at| block(dn, &y, at)).collect()
}

fn block(dn: &Plane<f32>, luma: &[f32], [x0, y0]: [usize; 2]) -> Option<Block> {
    let w = dn.width;
    let n = (BLOCK_PX * BLOCK_PX) as f64;
    let inside = || {
        (0..BLOCK_PX * BLOCK_PX)
            .map(|k| (k % BLOCK_PX, k / BLOCK_PX, (y0 + k / BLOCK_PX) * w + x0 + k % BLOCK_PX))
    };
    let (mut mean, mut cells, mut bands, mut clipped) = ([0.0; 3], [0.0; CELLS], [0.0; BLOCK_PX], 0);
    for (dx, dy, i) in inside() {
        let p = &dn.data[3 * i..3 * i + 3];
        clipped += p.iter().filter(|v| **v <= 0.5 || **v >= 254.5).count();
        (0..3).for_each(|c| mean[c] += f64::from(p[c]) / n);
        cells[dy / CELL_PX * (BLOCK_PX / CELL_PX) + dx / CELL_PX] +=
            f64::from(luma[i]) / CELL_PX.pow(2) as f64;
        bands[dy] += f64::from(luma[i]) / BLOCK_PX as f64;
    }
    // Values at the end of their range have lost their noise: one in a while is nothing, and strong noise has some
    // everywhere.
    if clipped > MOST_CLIPPED {
        return None;
    }
    let [slopes2, slopes, light] = grey(mean);
    let mut b = Block {
        slopes2,
        level: light / slopes2,
        cells: CELL_PX.pow(2) as f64 * about_rows(&cells) / slopes2,
        bands: BLOCK_PX as f64 * about_a_line(&bands) / slopes2,
        fine: 0.0,
        rounding: ROUNDING_DN2 / slopes2,
        near: [0.0; 2],
        far: [0.0; 2],
        rows: [0.0; BLOCK_PX],
        columns: [0.0; BLOCK_PX],
        at: [x0 / STRIDE_PX, y0 / STRIDE_PX],
    };
    // Values whose neighbours lie in the block too: what is beside it is another thing.
    let inner = APART..BLOCK_PX - APART;
    let share = 1.0 / (inner.len() * BLOCK_PX) as f64;
    let passed =
        |f: &dyn Fn(usize) -> f32, i: usize, by: usize| f64::from(f(i) - 0.5 * (f(i - by) + f(i + by)));
    let value = |i: usize| luma[i];
    for (dx, dy, i) in inside() {
        if inner.contains(&dx) {
            let across = passed(&value, i, APART);
            b.far[0] += share * across * across;
            b.near[0] += share * passed(&value, i, 1).powi(2);
            b.columns[dx] += across / BLOCK_PX as f64 / slopes;
        }
        if inner.contains(&dy) {
            let down = passed(&value, i, APART * w);
            b.far[1] += share * down * down;
            b.near[1] += share * passed(&value, i, w).powi(2);
            b.rows[dy] += down / BLOCK_PX as f64 / slopes;
        }
    }
    // Along rows, which noise of rows leaves as they are.
    b.fine = b.far[0] / HIGH_PASS / slopes2;
    Some(b)
}

/// Variance of the cells of a block about the mean of their row and a slope that all rows share: noise of rows is no
/// texture.
fn about_rows(cells: &[f64; CELLS]) -> f64 {
    let side = BLOCK_PX / CELL_PX;
    let place = |x: usize| x as f64 - 0.5 * (side as f64 - 1.0);
    let rows = || cells.chunks_exact(side);
    let off = |row: &[f64], x: usize| row[x] - row.iter().sum::<f64>() / side as f64;
    let own: f64 = (0..side).map(|x| place(x).powi(2)).sum();
    let slope =
        rows().flat_map(|row| (0..side).map(|x| place(x) * off(row, x))).sum::<f64>() / own / side as f64;
    let left = rows().flat_map(|row| (0..side).map(|x| (off(row, x) - slope * place(x)).powi(2)));
    left.sum::<f64>() / (CELLS - side - 1) as f64
}

/// Variance of the means of the rows of a block about the line that fits them best.
fn about_a_line(bands: &[f64; BLOCK_PX]) -> f64 {
    let place = |y: usize| y as f64 - 0.5 * (BLOCK_PX as f64 - 1.0);
    let mean = bands.iter().sum::<f64>() / BLOCK_PX as f64;
    let own: f64 = (0..BLOCK_PX).map(|y| place(y).powi(2)).sum();
    let slope = (0..BLOCK_PX).map(|y| place(y) * bands[y]).sum::<f64>() / own;
    (0..BLOCK_PX).map(|y| (bands[y] - mean - slope * place(y)).powi(2)).sum::<f64>() / (BLOCK_PX - 2) as f64
}

/// Of a colour (DN): sum of the squares of the slopes by which linear values make its brightness, sum of the slopes,
/// and the sum of the squares times the values.
fn grey(mean: [f64; 3]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (v, weight) in mean.iter().zip(LUMA) {
        let linear = f64::from(srgb_decode((*v / 255.0) as f32));
        let more = f64::from(srgb_decode(((*v + 1.0) / 255.0) as f32));
        let slope = f64::from(weight) / (more - linear).max(1e-6);
        sums[0] += slope * slope;
        sums[1] += slope;
        sums[2] += slope * slope * linear;
    }
    sums
}
