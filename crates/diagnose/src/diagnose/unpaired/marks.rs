//! What pictures show whatever they are pictures of: the marks that a camera leaves, measured in single frames.
//!
//! Noise is measured between near pixels of blocks that are flat by the means of their cells, so that choosing flat places does
//! not choose quiet ones. Texture is stronger the coarser one looks, noise weaker: cells tell them apart.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::diagnose::pair::slopes_to;
use shutterbug::plane::Plane;
use shutterbug::plane::srgb_decode;
use shutterbug::plane::stats::{LUMA, luma};

/// Side of a block, px.
const BLOCK_PX: usize = 8;
/// From one block to the next, px.
const STRIDE_PX: usize = 4;
/// Most clipped values of a block that is used: one in fifty.
const MOST_CLIPPED: usize = 3 * BLOCK_PX * BLOCK_PX / 50;
/// Variance that rounding three colours gives their brightness, DN^2.
const ROUNDING_DN2: f64 = (0.299 * 0.299 + 0.587 * 0.587 + 0.114 * 0.114) / 12.0;
/// Side of a cell, px.
const CELL_PX: usize = 2;
/// Cells of a block.
const CELLS: usize = (BLOCK_PX / CELL_PX) * (BLOCK_PX / CELL_PX);
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
/// Fewest flat blocks of a frame and brightness.
const FEWEST_BLOCKS: usize = 3;
/// Bins of brightness, and the width of one, DN.
pub(super) const BINS: usize = 10;
const BIN_DN: f64 = 24.0;
/// Brightness of the first bin's begin, DN.
const FIRST_DN: f64 = 8.0;
/// Variance of a value less the mean of two others.
const HIGH_PASS: f64 = 1.5;
/// Distance of these, px: noise that neighbours share counts whole.
const APART: usize = 2;
/// Linear variances are told in squares of a 255th of full scale.
pub(super) const LINEAR: f64 = 255.0 * 255.0;
/// Least contrast of an edge whose width is measured, DN.
const EDGE_DN: f32 = 40.0;
/// Px to each side of an edge that belong to it.
const EDGE_PX: usize = 4;
/// Share of the edges that are sharpest: what is blurred by its own nature is not among them.
const SHARPEST: f64 = 0.02;
/// Fewest edges.
const FEWEST_EDGES: usize = 100;

/// The marks of a frame, in this order.
pub(super) const MARKS: usize = BINS + 8;
pub(super) const NEIGHBOURS: [usize; 2] = [BINS, BINS + 1];
pub(super) const LINES: [usize; 2] = [BINS + 2, BINS + 3];
pub(super) const EDGES: [usize; 2] = [BINS + 4, BINS + 5];
pub(super) const LATERAL: [usize; 2] = [BINS + 6, BINS + 7];

/// What a mark is called.
pub(super) fn name(mark: usize) -> String {
    match mark {
        m if m < BINS => {
            let [from, to] = bin_dn(m);
            format!("noise at {from:.0} to {to:.0} DN (linear variance, squares of 1/255)")
        }
        m if m == NEIGHBOURS[0] => "noise of neighbours across, over that of values 2 px apart".to_owned(),
        m if m == NEIGHBOURS[1] => "noise of neighbours down, over that of values 2 px apart".to_owned(),
        m if m == LINES[0] => "noise of rows (linear variance, squares of 1/255)".to_owned(),
        m if m == LINES[1] => "noise of columns (linear variance, squares of 1/255)".to_owned(),
        m if m == EDGES[0] => "width of the sharpest edges across, px".to_owned(),
        m if m == EDGES[1] => "width of the sharpest edges down, px".to_owned(),
        m if m == LATERAL[0] => "magnification of red over green".to_owned(),
        _ => "magnification of blue over green".to_owned(),
    }
}

/// Brightness of a bin, DN.
pub(super) fn bin_dn(bin: usize) -> [f64; 2] {
    [0.0, 1.0].map(|k| FIRST_DN + BIN_DN * (bin as f64 + k))
}

/// A mark of one frame, and how much it saw of it; nothing where it saw none.
pub(super) type Mark = Option<[f64; 2]>;

/// What one block shows. Noise of brightness is made linear: over the sum of the squares of the slopes by which the three colours
/// make it, so that noise of a colour is that of a grey as bright.
pub(super) struct Block {
    /// Linear brightness of that grey.
    level: f64,
    /// Linear variance of cells about a plane, for one pixel: chosen by.
    cells: f64,
    /// Linear variance of near pixels: measured.
    fine: f64,
    /// What rounding adds to it.
    rounding: f64,
    /// Differences of neighbours across and down, and of values further apart.
    near: [f64; 2],
    far: [f64; 2],
    /// Means of high-passed values by row, then by column, linear.
    rows: [f64; BLOCK_PX],
    columns: [f64; BLOCK_PX],
    at: [usize; 2],
}

/// All blocks of a picture (DN, shape `[height, width, 3]`) in which nothing is clipped.
pub(super) fn blocks(dn: &Plane<f32>) -> Vec<Block> {
    let (w, h) = (dn.width, dn.height);
    let y: Vec<f32> = dn.data.chunks_exact(3).map(luma).collect();
    let begins = |side: usize| (0..=side.saturating_sub(BLOCK_PX)).step_by(STRIDE_PX);
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
    let (mut mean, mut cells, mut clipped) = ([0.0; 3], [0.0; CELLS], 0);
    for (dx, dy, i) in inside() {
        let p = &dn.data[3 * i..3 * i + 3];
        clipped += p.iter().filter(|v| **v <= 0.5 || **v >= 254.5).count();
        (0..3).for_each(|c| mean[c] += f64::from(p[c]) / n);
        cells[dy / CELL_PX * (BLOCK_PX / CELL_PX) + dx / CELL_PX] +=
            f64::from(luma[i]) / CELL_PX.pow(2) as f64;
    }
    // Values at the end of their range have lost their noise: one in a while is nothing, and strong noise has some everywhere.
    if clipped > MOST_CLIPPED {
        return None;
    }
    let [slopes2, light] = grey(mean);
    let mut b = Block {
        level: light / slopes2,
        cells: CELL_PX.pow(2) as f64 * about_a_plane(&cells) / slopes2,
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
            b.columns[dx] += across / BLOCK_PX as f64 / slopes2.sqrt();
        }
        if inner.contains(&dy) {
            let down = passed(&value, i, APART * w);
            b.far[1] += share * down * down;
            b.near[1] += share * passed(&value, i, w).powi(2);
            b.rows[dy] += down / BLOCK_PX as f64 / slopes2.sqrt();
        }
    }
    // Along rows, which noise of rows leaves as they are.
    b.fine = b.far[0] / HIGH_PASS / slopes2;
    Some(b)
}

/// Variance of the cells of a block about the plane that fits them best.
fn about_a_plane(cells: &[f64; CELLS]) -> f64 {
    let side = BLOCK_PX / CELL_PX;
    let place = |i: usize| [1.0, (i % side) as f64 - 1.5, (i / side) as f64 - 1.5];
    // The three are at right angles to each other on a square.
    let part = |k: usize| {
        let (sum, own) = cells.iter().enumerate().fold((0.0, 0.0), |(s, o), (i, v)| {
            let p = place(i)[k];
            (s + p * v, o + p * p)
        });
        sum / own
    };
    let plane = [part(0), part(1), part(2)];
    let left = |(i, v): (usize, &f64)| (v - (0..3).map(|k| plane[k] * place(i)[k]).sum::<f64>()).powi(2);
    cells.iter().enumerate().map(left).sum::<f64>() / (CELLS - 3) as f64
}

/// Of a colour (DN): sum of the squares of the slopes by which linear values make its brightness, and the same times the values.
fn grey(mean: [f64; 3]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (v, weight) in mean.iter().zip(LUMA) {
        let linear = f64::from(srgb_decode((*v / 255.0) as f32));
        let more = f64::from(srgb_decode(((*v + 1.0) / 255.0) as f32));
        let slope2 = (f64::from(weight) / (more - linear).max(1e-6)).powi(2);
        sums[0] += slope2;
        sums[1] += slope2 * linear;
    }
    sums
}

/// Which blocks are flat: their cells vary no more than noise makes them. Flat blocks are alike in that and textured ones are not:
/// over brightness, in some proportion of a constant and a part that grows with it, they lie close together, with few above them.
pub(super) fn flat(frames: &[Vec<Block>]) -> Vec<Vec<bool>> {
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

/// The marks of a picture and of its flat blocks.
pub(super) fn marks(dn: &Plane<f32>, flat: &[&Block]) -> Vec<Mark> {
    let mut out = vec![None; MARKS];
    noise_marks(flat, &mut out);
    line_marks(flat, &mut out);
    let y: Vec<f32> = dn.data.chunks_exact(3).map(luma).collect();
    for (k, mark) in EDGES.into_iter().enumerate() {
        out[mark] = edge_width(&y, dn.width, dn.height, k == 1);
    }
    for (channel, mark) in [0, 2].into_iter().zip(LATERAL) {
        out[mark] = lateral(dn, channel);
    }
    out
}

fn noise_marks(flat: &[&Block], out: &mut [Mark]) {
    for (bin, mark) in out.iter_mut().enumerate().take(BINS) {
        let [from, to] = bin_dn(bin).map(|dn| f64::from(srgb_decode((dn / 255.0) as f32)));
        let own: Vec<f64> = flat.iter().filter(|b| (from..to).contains(&b.level)).map(|b| b.fine).collect();
        if own.len() >= FEWEST_BLOCKS {
            *mark = Some([LINEAR * own.iter().sum::<f64>() / own.len() as f64, own.len() as f64]);
        }
    }
    let n = flat.len() as f64;
    if flat.len() < FEWEST_BLOCKS {
        return;
    }
    let sum = |f: &dyn Fn(&Block) -> f64| flat.iter().map(|b| f(b)).sum::<f64>();
    // Without noise a ratio says nothing: what rounding leaves counts as some.
    let rounding = n * HIGH_PASS / 24.0;
    for k in 0..2 {
        out[NEIGHBOURS[k]] = Some([(sum(&|b| b.near[k]) + rounding) / (sum(&|b| b.far[k]) + rounding), n]);
    }
}

/// Variance of what the pixels of a row, or of a column, have in common: products of neighbouring flat blocks, so that the
/// pixels' own noise has no part in it.
fn line_marks(flat: &[&Block], out: &mut [Mark]) {
    let mut sums = [[0.0; 2]; 2];
    let of: HashMap<[usize; 2], &&Block> = flat.iter().map(|b| (b.at, b)).collect();
    for b in flat {
        let [x, y] = b.at;
        let right = (2..24).find_map(|d| of.get(&[x + d, y]));
        let below = (2..24).find_map(|d| of.get(&[x, y + d]));
        let product = |a: &[f64; BLOCK_PX], b: &[f64; BLOCK_PX]| {
            a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / BLOCK_PX as f64
        };
        for (sum, value) in sums
            .iter_mut()
            .zip([right.map(|o| product(&b.rows, &o.rows)), below.map(|o| product(&b.columns, &o.columns))])
        {
            let Some(value) = value else { continue };
            sum[0] += value;
            sum[1] += 1.0;
        }
    }
    for k in 0..2 {
        if sums[k][1] >= FEWEST_BLOCKS as f64 {
            out[LINES[k]] = Some([LINEAR * sums[k][0] / sums[k][1] / HIGH_PASS, sums[k][1]]);
        }
    }
}

/// Width of the sharpest edges: contrast over the steepest slope, px. A step between two pixels has 2.
fn edge_width(y: &[f32], w: usize, h: usize, down: bool) -> Mark {
    let (step, along, lines) = if down { (w, h, w) } else { (1, w, h) };
    let reach = EDGE_PX + 3;
    let mut widths: Vec<f64> = Vec::new();
    for line in 0..lines {
        let begin = if down { line } else { line * w };
        for k in reach..along.saturating_sub(reach) {
            let at = |d: isize| y[(begin as isize + (k as isize + d) * step as isize) as usize];
            let slope = |d: isize| 0.5 * (at(d + 1) - at(d - 1)).abs();
            let steep = slope(0);
            if steep < 0.1 * EDGE_DN || steep < slope(1) || steep <= slope(-1) {
                continue;
            }
            let e = EDGE_PX as isize;
            let contrast = at(e) - at(-e);
            // Flat on either side: two things beside each other, and nothing else.
            let flat = (at(e + 3) - at(e)).abs() + (at(-e - 3) - at(-e)).abs();
            if contrast.abs() >= EDGE_DN && flat < 0.15 * contrast.abs() {
                widths.push(f64::from(contrast.abs() / steep));
            }
        }
    }
    if widths.len() < FEWEST_EDGES {
        return None;
    }
    let place = (SHARPEST * widths.len() as f64) as usize;
    let width = *widths.select_nth_unstable_by(place, f64::total_cmp).1;
    Some([width, widths.len() as f64])
}

/// How much larger a colour's picture is than that of green, less 1.
fn lateral(dn: &Plane<f32>, channel: usize) -> Mark {
    let only = |c: usize| Plane { data: dn.data.chunks_exact(3).flat_map(|p| [p[c]; 3]).collect(), ..*dn };
    let (green, other) = (only(1), only(channel));
    let (mut ab, mut aa) = (0.0, 0.0);
    let centre = [0.5 * dn.width as f64, 0.5 * dn.height as f64];
    for (middle, a, b) in slopes_to(&green, &other) {
        let r = [middle[0] - centre[0], middle[1] - centre[1]];
        ab += r[0] * b[0] + r[1] * b[1];
        aa += a[0] * r[0] * r[0] + 2.0 * a[1] * r[0] * r[1] + a[2] * r[1] * r[1];
    }
    (aa > 0.0).then(|| [ab / aa, aa])
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_normal;

    fn noisy(sigma: impl Fn(f32) -> f32, row: f32) -> Plane<f32> {
        Plane::from_fn(320, 240, |x, y| {
            let ramp = 40.0 + 150.0 * x as f32 / 320.0 + if (x / 40 + y / 40) % 2 == 0 { 20.0 } else { 0.0 };
            let [r, g, b, _] = random_normal([x as u32, y as u32], 0, 5, [1, 2]);
            let [of_row, ..] = random_normal([y as u32, 9], 0, 6, [1, 2]);
            [r, g, b].map(|n| (ramp + sigma(ramp) * n + row * of_row).round())
        })
    }

    fn of(p: &Plane<f32>) -> Vec<Mark> {
        let all = vec![blocks(p)];
        let flat = flat(&all);
        marks(p, &all[0].iter().zip(&flat[0]).filter(|(_, f)| **f).map(|(b, _)| b).collect::<Vec<_>>())
    }

    #[test]
    fn noise_is_measured_by_brightness_and_that_of_rows_apart_from_it() {
        let found = of(&noisy(|dn| 0.02 * dn, 1.5));
        for bin in 2..6 {
            let [from, to] = bin_dn(bin);
            let dn = 0.5 * (from + to);
            let slope =
                f64::from(srgb_decode(((dn + 1.0) / 255.0) as f32) - srgb_decode((dn / 255.0) as f32));
            let truth = (255.0 * slope).powi(2) * ((0.02 * dn).powi(2) + 1.0 / 12.0);
            let [v, _] = found[bin].expect("seen");
            assert!((v / truth - 1.0).abs() < 0.15, "bin {bin}: {v} for {truth}");
        }
        let ([rows, _], [columns, _]) = (found[LINES[0]].expect("seen"), found[LINES[1]].expect("seen"));
        assert!(rows > 0.3 && columns.abs() < 0.15 * rows, "{rows} {columns}");
        let [near, _] = found[NEIGHBOURS[0]].expect("seen");
        assert!((near - 1.0).abs() < 0.06, "{near}");
    }

    #[test]
    fn texture_beside_flat_places_is_no_noise() {
        let share = |amplitude: f32| {
            let p = noisy(|_| 2.0, 0.0);
            let textured = Plane::from_fn(320, 240, |x, y| {
                let more = if (x / 64 + y / 64) % 2 == 0 { amplitude * (1.3 * x as f32).sin() } else { 0.0 };
                [0, 1, 2].map(|c| p.pixel(x, y)[c] + more)
            });
            of(&textured)[4].expect("seen")[0]
        };
        assert!((share(8.0) / share(0.0) - 1.0).abs() < 0.1, "{} {}", share(8.0), share(0.0));
        let all = blocks(&noisy(|_| 2.0, 0.0));
        assert!(flat(&[all])[0].iter().filter(|f| **f).count() > 500, "control: flat blocks are found");
    }

    #[test]
    fn a_blurred_edge_is_wider_and_noise_of_neighbours_then_alike() {
        let sharp = noisy(|_| 2.0, 0.0);
        let boxes = |sigma: f64| {
            let p = Plane::from_fn(320, 240, |x, y| {
                [if (x / 40 + y / 40) % 2 == 0 { 60.0 } else { 160.0f32 }; 3]
            });
            if sigma > 0.0 { shutterbug::effects::gaussian::blurred(&p, sigma) } else { p }
        };
        let width = |p: &Plane<f32>| of(p)[EDGES[0]].expect("edges")[0];
        assert!((width(&boxes(0.0)) - 2.0).abs() < 0.01, "{}", width(&boxes(0.0)));
        // Contrast over the slope of a Gaussian edge: sigma times the root of 2 pi, the pixels' own width with it.
        let wide = width(&boxes(1.5));
        assert!(
            (wide / (1.5f64.powi(2) + 1.0 / 12.0 + 1.0 / 3.0).sqrt() / 2.507 - 1.0).abs() < 0.08,
            "{wide}"
        );
        let soft = shutterbug::effects::gaussian::blurred(&sharp, 1.0);
        let near = |p: &Plane<f32>| of(p)[NEIGHBOURS[1]].expect("seen")[0];
        assert!(near(&soft) < 0.6 * near(&sharp), "{} {}", near(&soft), near(&sharp));
    }
}
