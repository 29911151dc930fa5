//! The gap as a number: the continuous ranked probability score (CRPS, Gneiting and Raftery 2007) of a real frame under
//! the simulator's predictive distribution, of pixels and of a fixed bank of linear statistics.
//!
//! Real values are whole numbers of DN. What a model predicts of each is a mean and a spread: noise, rounding, and what
//! two correct simulations may differ by (see `expect::discrepancy`). A model without noise is no special case: its
//! spread is that of rounding and of the discrepancy. Every statistic is taken to be normal. Pixels count half, the
//! other families share the rest, so that row noise, fixed patterns and banding count, which single pixels cannot show.

mod alike;
mod bands;
mod lines;

use std::f64::consts::FRAC_1_SQRT_2;
use std::sync::{Arc, LazyLock};

use rayon::prelude::*;

use bands::bands;
use lines::lines;

use crate::diagnose::expect::discrepancy::{COLOUR_DN, DRAWS, REACH, edges};
use crate::diagnose::expect::pair::given::GivenValue;
use crate::diagnose::expect::rounding::{rounded, rounded_twice};
use crate::diagnose::expect::tone::{Tone, Variances};
use crate::diagnose::flips::Flips;
use shutterbug::chain::Left;
use shutterbug::plane::Plane;
use shutterbug::plane::stats::{FRAC_1_SQRT_TAU, erf_beside};

/// Families of statistics: pixels, three bands of a pyramid, row means, column means, differences between frames.
pub(crate) const FAMILIES: [(&str, f64); 7] = [
    ("pixels", 0.5),
    ("band 2 px", 1.0 / 12.0),
    ("band 4 px", 1.0 / 12.0),
    ("band 8 px", 1.0 / 12.0),
    ("rows", 1.0 / 12.0),
    ("columns", 1.0 / 12.0),
    ("frame differences", 1.0 / 12.0),
];

/// Columns of blocks over the width of a picture: what is in one block is not taken for independent.
const BLOCKS_ACROSS: usize = 16;
/// Fewest px of a block's side.
const FEWEST_PX: usize = 8;

/// What one family of statistics got.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Family {
    pub score: f64,
    /// What the model expects of its own frames, as far as the discrepancy goes as a rule.
    pub expected: f64,
    /// The same where the discrepancy goes as far as it may.
    pub bound: f64,
}

/// Score of one frame: what the real frame got, and what the model expects of its own frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct FrameScore {
    pub score: f64,
    pub expected: f64,
    pub bound: f64,
    /// The same by family, in the order of [`FAMILIES`]; nothing where the frame has no such statistic.
    pub families: [Option<Family>; 7],
    /// Blocks across the picture, where noise of rows makes those of a row one draw; else none.
    pub rows_of: Option<usize>,
    /// By family: what each block of the picture, then each group of rows and of columns, adds to `score`, `expected`
    /// and `bound`.
    pub blocks: [Vec<[f32; 3]>; 7],
}

impl FrameScore {
    /// [`FrameScore::blocks`] of all families together.
    pub(crate) fn over_families(&self) -> Vec<[f64; 3]> {
        let count = self.blocks.iter().map(Vec::len).max().unwrap_or(0);
        let mut sums = vec![[0.0; 3]; count];
        for (to, from) in self.blocks.iter().flat_map(|family| family.iter().enumerate()) {
            (0..3).for_each(|k| sums[to][k] += f64::from(from[k]));
        }
        sums
    }
}

/// A frame to be scored.
pub(crate) struct Scored<'a> {
    pub real: &'a Plane<f32>,
    pub mean: &'a Plane<f32>,
    /// How far the content moves while a pixel is exposed, px; nothing without an exposure.
    pub path: Option<&'a Plane<f32>>,
    /// 1 where compared.
    pub mask: Option<&'a Plane<f32>>,
    /// What compression leaves of the noise where; the same everywhere if that is not known.
    pub flips: Option<&'a Flips>,
    /// Draws of how far another correct simulation is from this one, DN: behind what rounds coarsely, and where the
    /// camera's path wanders within the frame; nothing without either.
    pub drawn: &'a [Arc<Plane<f32>>],
    /// Whether the draws say what edges may be off by: they do behind what rounds coarsely.
    pub edges_drawn: bool,
    /// How well values are known where the simulation is read from pictures.
    pub given: Option<&'a [GivenValue]>,
}

/// CRPS of `error` (real minus mean) under a normal distribution of that variance; the absolute error without one.
pub(crate) fn crps(error: f64, variance: f64) -> f64 {
    if variance < 1e-6 {
        return error.abs();
    }
    let sigma = variance.sqrt();
    let z = (error / sigma).abs();
    let at = z * PER_DEVIATION;
    let i = at as i32 as usize;
    if i >= DEVIATIONS * PER_DEVIATION as usize {
        return sigma * (z - FRAC_1_SQRT_PI);
    }
    let (table, f) = (&*STANDARD, at - i as f64);
    sigma * (table[i] * (1.0 - f) + table[i + 1] * f)
}

/// Standard deviations up to which the score is tabled, and entries of the table in one: read linearly it is within
/// 2e-6.
const DEVIATIONS: usize = 8;
/// See [`DEVIATIONS`].
const PER_DEVIATION: f64 = 256.0;

/// CRPS of an error under a normal distribution of variance 1.
static STANDARD: LazyLock<Vec<f64>> = LazyLock::new(|| {
    let of = |z: f64| {
        let bell = (-0.5 * z * z).exp();
        z * erf_beside(z * FRAC_1_SQRT_2, bell) + 2.0 * bell * FRAC_1_SQRT_TAU - FRAC_1_SQRT_PI
    };
    (0..=DEVIATIONS * PER_DEVIATION as usize).map(|i| of(i as f64 / PER_DEVIATION)).collect()
});

const FRAC_1_SQRT_PI: f64 = 0.564_189_583_547_756_3;

/// What a value drawn from the distribution itself scores on average.
fn expected(variance: f64) -> f64 {
    if variance < 1e-6 { 0.0 } else { variance.sqrt() * FRAC_1_SQRT_PI }
}

/// How a picture is cut into blocks.
#[derive(Clone, Copy)]
struct Blocks {
    side: usize,
    across: usize,
    down: usize,
}

impl Blocks {
    fn of(w: usize, h: usize) -> Self {
        let side = w.div_ceil(BLOCKS_ACROSS).max(FEWEST_PX);
        Self { side, across: w.div_ceil(side), down: h.div_ceil(side) }
    }

    fn at(&self, x: usize, y: usize) -> usize {
        y / self.side * self.across + x / self.side
    }

    fn row(&self, y: usize) -> usize {
        self.across * self.down + y / self.side
    }

    fn column(&self, x: usize) -> usize {
        self.across * self.down + self.down + x / self.side
    }

    fn count(&self) -> usize {
        self.across * self.down + self.down + self.across
    }
}

/// Sums of scores, of what is expected and of how far that may go, by block, and the number.
struct Sums {
    blocks: Vec<[f64; 3]>,
    count: f64,
}

impl Sums {
    fn new(blocks: Blocks) -> Self {
        Self { blocks: vec![[0.0; 3]; blocks.count()], count: 0.0 }
    }

    /// Adds a statistic with `variance`, of which `discrepancy` is what correct simulations may differ by as a rule.
    fn add(&mut self, block: usize, error: f64, variance: f64, discrepancy: f64) {
        let sums = &mut self.blocks[block];
        sums[0] += crps(error, variance);
        sums[1] += expected(variance);
        sums[2] += expected(variance + (REACH * REACH - 1.0) * discrepancy);
        self.count += 1.0;
    }

    fn done(&self) -> Option<Family> {
        let sum = |k: usize| self.blocks.iter().map(|b| b[k]).sum::<f64>() / self.count;
        (self.count > 0.0).then(|| Family { score: sum(0), expected: sum(1), bound: sum(2) })
    }
}

/// What a model says of one value, and how far off it is. Large pictures have millions of them.
#[derive(Clone, Copy, Default)]
struct Seen {
    /// Real minus mean, DN.
    error: f32,
    /// Variances of all noise, of rounding too, DN^2: in this value, and in what differs from the frame before.
    noise: f32,
    change: f32,
    /// What bands and lines have of the noise, but for that of rows, DN^2.
    bands: [f32; 3],
    lines: [f32; 2],
    /// Of the noise of rows: variance in this value, and in the mean of a row, DN^2.
    row: f32,
    in_row: f32,
    /// Standard deviation of the pattern that the frame before has too, DN.
    pattern: f32,
    /// What correct simulations may differ by, DN^2: in this value alone, and in all of its colour.
    single: f32,
    common: f32,
    /// Variance that all values have in common whose picture has the same `value`, DN^2; see [`GivenValue`].
    alike: f32,
    value: u8,
}

/// What differences to the next frame need of a value.
#[derive(Clone, Copy)]
struct Kept {
    error: f32,
    change: f32,
    pattern: f32,
    /// What correct simulations may differ by, DN^2.
    off: f32,
    alike: f32,
    value: u8,
}

fn seen(frame: &Scored<'_>, tone: &Tone, edges: &[f32], i: usize) -> Seen {
    let mean = frame.mean.data[i];
    let (noise, in_row, left) =
        if tone.is_noisy() { noise_seen(frame, tone, i) } else { (Variances::default(), 0.0, Left::ALL) };
    let given = frame.given.map(|g| g[i]);
    let single = if frame.edges_drawn { 0.0 } else { edges[i] } + given.map_or(0.0, |g| g.single);
    let drawn = frame.drawn.iter().map(|draw| draw.data[i].powi(2)).sum::<f32>() / DRAWS as f32;
    let variance = left.pixel * (noise.free + noise.fixed) + single + drawn;
    let whole = match given {
        Some(g) => rounded_twice(mean, variance + noise.row, g.step),
        None => rounded(mean, variance + noise.row),
    };
    // Of what is common the colours' own error is; the rest is rounding.
    let common =
        if given.is_some() { whole.common.min((COLOUR_DN * COLOUR_DN) as f32) } else { whole.common };
    let rounding = (whole.free - variance - noise.row).max(0.0);
    let kept = |share: f32| share * (noise.free + noise.fixed) + rounding;
    let new_pattern = (left.pixel - left.steady).max(0.0) * noise.fixed;
    Seen {
        error: frame.real.data[i] - whole.mean,
        noise: left.pixel * (noise.free + noise.fixed) + noise.row + rounding,
        change: left.pixel * noise.free + new_pattern + noise.row + rounding,
        bands: left.bands.map(kept),
        lines: left.lines.map(kept),
        row: noise.row,
        in_row,
        pattern: (left.steady * noise.fixed).sqrt(),
        single,
        common,
        alike: whole.common - common,
        value: given.map_or(0, |g| g.value),
    }
}

/// Noise of a value, what the mean of its row has of that of rows, and what is left of the rest.
fn noise_seen(frame: &Scored<'_>, tone: &Tone, i: usize) -> (Variances, f32, Left) {
    let colour = &frame.mean.data[i - i % 3..i - i % 3 + 3];
    let mut noise = tone.spread_of(colour, i % 3);
    let Some(flips) = frame.flips else {
        let [in_pixel, in_row] = tone.rows_left(colour, i % 3).map(|share| share * noise.row);
        noise.row = in_pixel;
        return (noise, in_row, tone.left(colour, i % 3));
    };
    let left = flips.left(frame.real.width, i, noise.free + noise.fixed);
    (noise.row, _) = flips.rows(frame.real.width, i);
    (noise, noise.row, left)
}

/// All values of a frame as a model sees them; nothing where they are not compared.
pub(crate) struct SeenIn {
    size: [usize; 2],
    /// How well the variance of noise is known, as a part of it.
    unsure: f32,
    values: Vec<Option<Seen>>,
    /// By value the variances of noise of rows that would give as much in the three bands, DN^2, where a file has left
    /// that; nothing where it is what the pixels have.
    row_bands: Vec<[f32; 3]>,
    /// Whether values are read from a simulator's pictures, whose equal values are off alike.
    given: bool,
    /// See [`Scored::drawn`].
    drawn: Vec<Arc<Plane<f32>>>,
}

/// What a model says of the values of a frame.
pub(crate) fn seen_in(frame: &Scored<'_>, tone: &Tone) -> SeenIn {
    let size = [frame.real.width, frame.real.height];
    let edges = edges(frame.mean, frame.path);
    let open = |i: usize| frame.mask.is_none_or(|m| m.data[i / 3] > 0.5);
    let value = |i: usize| open(i).then(|| seen(frame, tone, &edges, i));
    let values: Vec<Option<Seen>> = (0..size[0] * size[1] * 3).into_par_iter().map(value).collect();
    let given = frame.given.is_some();
    let has_rows = || values.iter().flatten().any(|v| v.row > 0.0);
    let row_bands = match frame.flips.filter(|_| has_rows()) {
        Some(flips) => (0..values.len()).map(|i| flips.rows(size[0], i).1).collect(),
        None => Vec::new(),
    };
    SeenIn { size, unsure: tone.uncertainty(), values, row_bands, given, drawn: frame.drawn.to_vec() }
}

/// What differences to the next frame need of a frame: less than half of [`SeenIn`].
pub(crate) struct KeptOf {
    values: Vec<Option<Kept>>,
    drawn: Vec<Arc<Plane<f32>>>,
}

impl SeenIn {
    /// What the next frame needs of this one.
    pub(crate) fn kept(&self) -> KeptOf {
        let one = |v: &Seen| Kept {
            error: v.error,
            change: v.change,
            pattern: v.pattern,
            off: v.single + v.common,
            alike: v.alike,
            value: v.value,
        };
        KeptOf {
            values: self.values.par_iter().map(|v| v.as_ref().map(one)).collect(),
            drawn: self.drawn.clone(),
        }
    }
}

/// Scores a frame; `before` is the frame before it, where that is held out too.
pub(crate) fn score_frame(frame: &SeenIn, before: Option<&KeptOf>) -> FrameScore {
    let blocks = Blocks::of(frame.size[0], frame.size[1]);
    let mut sums: [Sums; 7] = std::array::from_fn(|_| Sums::new(blocks));
    let (near, rest) = sums.split_at_mut(1);
    let (coarse, rest) = rest.split_at_mut(3);
    let (in_lines, changes) = rest.split_at_mut(2);
    rayon::join(
        || bands(frame, blocks, coarse),
        || {
            pixels(frame, blocks, &mut near[0]);
            lines(frame, blocks, in_lines);
            before.into_iter().for_each(|before| differences(frame, before, blocks, &mut changes[0]));
        },
    );
    let has_rows = frame.values.iter().flatten().any(|v| v.row > 0.0);
    FrameScore { rows_of: has_rows.then_some(blocks.across), ..together(&sums) }
}

/// Single values.
fn pixels(frame: &SeenIn, blocks: Blocks, sums: &mut Sums) {
    let w = frame.size[0];
    for (i, v) in frame.values.iter().enumerate() {
        let Some(v) = v else { continue };
        let noise = v.noise;
        let off = v.single + v.common + v.alike + mean_square(&frame.drawn, |draw| draw.data[i]);
        let known = off + frame.unsure * noise;
        sums.add(blocks.at(i / 3 % w, i / 3 / w), v.error.into(), (noise + off).into(), known.into());
    }
}

/// Differences of single values from the frame before.
fn differences(frame: &SeenIn, before: &KeptOf, blocks: Blocks, sums: &mut Sums) {
    let w = frame.size[0];
    for (i, (a, b)) in frame.values.iter().zip(&before.values).enumerate() {
        let (Some(a), Some(b)) = (a, b) else { continue };
        let drawn = (0..frame.drawn.len()).map(|k| frame.drawn[k].data[i] - before.drawn[k].data[i]);
        let drawn = drawn.map(|d| d * d).sum::<f32>() / DRAWS as f32;
        let alike = match a.value == b.value {
            true => (a.alike.sqrt() - b.alike.sqrt()).powi(2),
            false => a.alike + b.alike,
        };
        let off = drawn + alike + ((a.single + a.common) + b.off);
        // A fixed pattern is the same in both, as strong as their values make it, but for what a file has made of it.
        let noise = a.change + b.change + (a.pattern - b.pattern).powi(2);
        let known = off + frame.unsure * noise;
        let block = blocks.at(i / 3 % w, i / 3 / w);
        sums.add(block, (a.error - b.error).into(), (noise + off).into(), known.into());
    }
}

/// The families by their weights.
fn together(sums: &[Sums; 7]) -> FrameScore {
    let mut total = FrameScore { families: std::array::from_fn(|i| sums[i].done()), ..FrameScore::default() };
    let weight: f64 = (0..7).filter(|&i| total.families[i].is_some()).map(|i| FAMILIES[i].1).sum();
    total.blocks = std::array::from_fn(|i| {
        let part = FAMILIES[i].1 / weight / sums[i].count.max(1.0);
        sums[i].blocks.iter().map(|b| b.map(|v| (part * v) as f32)).collect()
    });
    for (family, (_, share)) in total.families.iter().zip(FAMILIES) {
        if let Some(f) = family {
            total.score += share / weight * f.score;
            total.expected += share / weight * f.expected;
            total.bound += share / weight * f.bound;
        }
    }
    total
}

/// Mean over draws of the square of what a statistic sees of them, DN^2.
fn mean_square(drawn: &[Arc<Plane<f32>>], of: impl Fn(&Plane<f32>) -> f32) -> f32 {
    drawn.iter().map(|draw| of(draw).powi(2)).sum::<f32>() / DRAWS as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::model::{P, Theta};
    use shutterbug::plane::stats::erf;

    #[test]
    fn the_score_of_a_normal_variable_is_lowest_at_its_own_spread() {
        // Mean over quantiles of the standard normal distribution scaled by 3.
        let draws: Vec<f64> = (0..4000)
            .map(|i| {
                let u = (f64::from(i) + 0.5) / 4000.0;
                // Inverse of the distribution by bisection of erf.
                let (mut lo, mut hi) = (-6.0, 6.0);
                for _ in 0..60 {
                    let mid = 0.5 * (lo + hi);
                    if 0.5 * (1.0 + erf(mid * std::f64::consts::FRAC_1_SQRT_2)) < u {
                        lo = mid
                    } else {
                        hi = mid
                    }
                }
                3.0 * lo
            })
            .collect();
        let mean = |sigma: f64, shift: f64| {
            draws.iter().map(|d| crps(d + shift, sigma * sigma)).sum::<f64>() / draws.len() as f64
        };
        let right = mean(3.0, 0.0);
        assert!((right - 3.0 * FRAC_1_SQRT_PI).abs() < 2e-3, "{right}");
        for (sigma, shift) in [(2.0, 0.0), (4.5, 0.0), (0.0, 0.0), (3.0, 1.0)] {
            assert!(mean(sigma, shift) > right + 0.02, "{sigma} {shift}");
        }
    }

    /// Values about `mean`, spread by `sigma_dn` and rounded.
    fn delivered(mean: f32, sigma_dn: f64) -> Plane<f32> {
        let draw = |x: usize, y: usize, c: usize| {
            let bits = shutterbug::chain::rng::random_bits([x as u32, y as u32], c as u32, 7, [1, 2]);
            let sum = bits.iter().map(|b| f64::from(*b) / f64::from(u32::MAX) - 0.5).sum::<f64>();
            sigma_dn * sum * 3.0_f64.sqrt()
        };
        Plane::from_fn(64, 64, |x, y| [0, 1, 2].map(|c| (mean + draw(x, y, c) as f32).round()))
    }

    fn read_noise(sigma_dn: f64) -> Tone {
        let slope = f64::from(Tone::new(&Theta::neutral()).slope_at(128.0, 1));
        Tone::new(&Theta::neutral().with(P::Read, sigma_dn / slope))
    }

    #[test]
    fn little_noise_lowers_the_score_of_frames_that_have_it_and_not_of_others() {
        // A solid colour between two whole DN: a model without noise expects one whole value everywhere.
        for mean in [128.0, 128.3, 128.45] {
            let flat = Plane::from_fn(64, 64, |_, _| [mean; 3]);
            let gain = |sigma_dn: f64| {
                let real = delivered(mean, sigma_dn);
                let scored = Scored {
                    real: &real,
                    mean: &flat,
                    path: None,
                    mask: None,
                    flips: None,
                    drawn: &[],
                    edges_drawn: false,
                    given: None,
                };
                let [none, noisy] =
                    [0.0, 1.0].map(|s| score_frame(&seen_in(&scored, &read_noise(s)), None).score);
                1.0 - noisy / none
            };
            assert!(gain(1.0) > 0.1, "{mean}: {}", gain(1.0));
            assert!(gain(0.0) < 0.0, "control, {mean}: {}", gain(0.0));
        }
    }

    #[test]
    fn frames_of_the_model_itself_score_what_it_expects() {
        for (mean, sigma_dn) in [(128.2, 0.6), (128.5, 2.0), (128.0, 5.0)] {
            let (real, flat) = (delivered(mean, sigma_dn), Plane::from_fn(64, 64, |_, _| [mean; 3]));
            let scored = Scored {
                real: &real,
                mean: &flat,
                path: None,
                mask: None,
                flips: None,
                drawn: &[],
                edges_drawn: false,
                given: None,
            };
            let seen = score_frame(&seen_in(&scored, &read_noise(sigma_dn)), None).families[0]
                .expect("pixels are there");
            assert!((seen.score / seen.expected - 1.0).abs() < 0.05, "{mean} {sigma_dn}: {seen:?}");
            let wrong = score_frame(&seen_in(&scored, &read_noise(0.5 * sigma_dn)), None).families[0]
                .expect("as above");
            assert!(wrong.score > 1.1 * wrong.expected, "control: {wrong:?}");
        }
    }

    #[test]
    fn row_noise_is_seen_by_row_means_and_not_by_pixels_alone() {
        // Errors that are equal along a row, under a model with white noise of the same spread per pixel.
        let real = Plane::from_fn(64, 64, |_, y| [128.0 + [4.0f32, -4.0][y % 2]; 3]);
        let mean = Plane::from_fn(64, 64, |_, _| [128.0f32; 3]);
        let scored = Scored {
            real: &real,
            mean: &mean,
            path: None,
            mask: None,
            flips: None,
            drawn: &[],
            edges_drawn: false,
            given: None,
        };
        let slope = f64::from(Tone::new(&Theta::neutral()).slope_at(128.0, 1));
        let white = Tone::new(&Theta::neutral().with(P::Read, 4.0 / slope));
        let row = Tone::new(&Theta::neutral().with(P::Row, 4.0 / slope));
        let (white, row) =
            (score_frame(&seen_in(&scored, &white), None), score_frame(&seen_in(&scored, &row), None));
        assert!(row.score < 0.95 * white.score, "{row:?} {white:?}");
        // The family that it is about tells clearly; single pixels cannot tell at all.
        let family = |s: &FrameScore, i: usize| s.families[i].expect("there").score;
        assert!(family(&row, 4) < 0.8 * family(&white, 4), "{row:?} {white:?}");
        assert!((family(&row, 0) / family(&white, 0) - 1.0).abs() < 0.02, "{row:?} {white:?}");
    }
}
