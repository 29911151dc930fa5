//! The gap as a number: the continuous ranked probability score (CRPS, Gneiting and Raftery 2007) of a real frame under
//! the simulator's predictive distribution, of pixels and of a fixed bank of linear statistics.
//!
//! Without noise the error of a value is its distance to the values that round to the real one, unless the real frames
//! are dithered: noise makes rounding one more, independent, error of variance 1/12, for models with noise and without.
//! The distribution of every statistic is taken to be normal with the mean and the spread that the model gives; without
//! noise the score is the absolute error. Pixels count half, the other families share the rest, so that row noise, fixed
//! patterns and banding count, which single pixels cannot show.

use std::f64::consts::FRAC_1_SQRT_2;

use super::flips::Flips;
use super::tone::{Tone, Variances};
use crate::chain::Left;
use crate::plane::Plane;
use crate::plane::stats::erf_beside;

/// Families of statistics: pixels, three bands of a pyramid, row means, column means, differences between frames.
pub(super) const FAMILIES: [(&str, f64); 7] = [
    ("pixels", 0.5),
    ("band 2 px", 1.0 / 12.0),
    ("band 4 px", 1.0 / 12.0),
    ("band 8 px", 1.0 / 12.0),
    ("rows", 1.0 / 12.0),
    ("columns", 1.0 / 12.0),
    ("frame differences", 1.0 / 12.0),
];

/// Score of one frame: what the real frame got, and what the model expects of its own frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FrameScore {
    pub score: f64,
    pub expected: f64,
    /// The same by family, in the order of [`FAMILIES`]; nothing where the frame has no such statistic.
    pub families: [Option<[f64; 2]>; 7],
}

/// A frame to be scored.
pub(super) struct Scored<'a> {
    pub real: &'a Plane<f32>,
    pub mean: &'a Plane<f32>,
    /// 1 where compared.
    pub mask: Option<&'a Plane<f32>>,
    /// Whether the real frames are dithered.
    pub dithered: bool,
    /// What compression leaves of the noise where; the same everywhere if that is not known.
    pub flips: Option<&'a Flips>,
}

/// CRPS of `error` (real minus mean) under a normal distribution of that variance; the absolute error without one.
pub(super) fn crps(error: f64, variance: f64) -> f64 {
    if variance < 1e-6 {
        return error.abs();
    }
    let sigma = variance.sqrt();
    let z = error / sigma;
    // The density and the distribution share their exponential.
    let bell = (-0.5 * z * z).exp();
    sigma * (z * erf_beside(z * FRAC_1_SQRT_2, bell) + 2.0 * bell * FRAC_1_SQRT_TAU - FRAC_1_SQRT_PI)
}

const FRAC_1_SQRT_PI: f64 = 0.564_189_583_547_756_3;

/// What a value drawn from the distribution itself scores on average.
fn expected(variance: f64) -> f64 {
    if variance < 1e-6 { 0.0 } else { variance.sqrt() * FRAC_1_SQRT_PI }
}

const FRAC_1_SQRT_TAU: f64 = 0.398_942_280_401_432_7;

/// Mean of scores and of what is expected.
#[derive(Default)]
struct Mean {
    score: f64,
    expected: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, error: f64, variance: f64) {
        self.score += crps(error, variance);
        self.expected += expected(variance);
        self.count += 1.0;
    }

    fn done(&self) -> Option<[f64; 2]> {
        (self.count > 0.0).then(|| [self.score / self.count, self.expected / self.count])
    }
}

/// Scores a frame; `before` is the frame before it, where that is held out too.
pub(super) fn score_frame(frame: &Scored<'_>, before: Option<&Scored<'_>>, tone: &Tone) -> FrameScore {
    let (w, h) = (frame.real.width, frame.real.height);
    let rounds = !tone.is_noisy() && !frame.dithered;
    let error_of = |f: &Scored<'_>, i: usize| -> f32 {
        let error = f.real.data[i] - f.mean.data[i];
        // Without noise every value that rounds to the real one is right. (Rounding the mean instead would make a
        // thousandth of gain worth a whole DN wherever a colour lies between two.)
        if rounds { error.signum() * (error.abs() - 0.5).max(0.0) } else { error }
    };
    let open = |f: &Scored<'_>, i: usize| f.mask.is_none_or(|m| m.data[i / 3] > 0.5);
    // What compression leaves of the noise depends on what is looked at.
    let noisy = tone.is_noisy();
    // Rounding to whole DN adds its own 1/12.
    let rounding = if rounds { 0.0 } else { 1.0 / 12.0 };
    let at = |i: usize| -> (Variances, Left) {
        if noisy {
            let spread = tone.spread(frame.mean.data[i], i % 3);
            let left = tone.left(&frame.mean.data[i - i % 3..i - i % 3 + 3], i % 3);
            let local = frame.flips.map(|f| f.left(w, i, spread.free + spread.fixed));
            (spread, local.unwrap_or(left))
        } else {
            (Variances::default(), Left::ALL)
        }
    };
    let part = |v: &Variances, share: f32| -> Variances {
        Variances { free: v.free * share + rounding, fixed: v.fixed * share, row: v.row }
    };
    let mut means: [Mean; 7] = Default::default();
    for i in (0..w * h * 3).filter(|&i| open(frame, i)) {
        let (v, left) = at(i);
        let v = part(&v, left.pixel);
        means[0].add(error_of(frame, i).into(), (v.free + v.row + v.fixed).into());
    }
    bands(w, h, &mut means[1..4], |i| {
        open(frame, i).then(|| {
            let (v, left) = at(i);
            (error_of(frame, i), left.bands.map(|share| part(&v, share)))
        })
    });
    lines(w, h, &mut means[4..6], |i| {
        open(frame, i).then(|| {
            let (v, left) = at(i);
            (error_of(frame, i), left.lines.map(|share| part(&v, share)))
        })
    });
    if let Some(before) = before {
        for i in (0..w * h * 3).filter(|&i| open(frame, i) && open(before, i)) {
            let (v, left) = at(i);
            let v = part(&v, left.pixel);
            let error = error_of(frame, i) - error_of(before, i);
            means[6].add(error.into(), (2.0 * (v.free + v.row)).into());
        }
    }
    let (mut total, mut weight) = (FrameScore::default(), 0.0);
    for (i, (mean, (_, share))) in means.iter().zip(FAMILIES).enumerate() {
        total.families[i] = mean.done();
        if let Some([score, expected]) = total.families[i] {
            total.score += share * score;
            total.expected += share * expected;
            weight += share;
        }
    }
    if weight > 0.0 {
        total.score /= weight;
        total.expected /= weight;
    }
    total
}

/// Differences between means over blocks of 2, 4, 8 px and the means over the block that is twice as large.
fn bands(w: usize, h: usize, means: &mut [Mean], value: impl Fn(usize) -> Option<(f32, [Variances; 3])>) {
    // Sum of errors, of row variance (already over the rows), number, and of free variance as each band sees it.
    let mut level: Vec<[f64; 6]> = (0..w * h * 3)
        .map(|i| match value(i) {
            Some((e, v)) => {
                let [a, b, c] = v.map(|v| f64::from(v.free + v.fixed));
                [e.into(), v[0].row.into(), 1.0, a, b, c]
            }
            None => [0.0; 6],
        })
        .collect();
    let (mut w, mut h) = (w, h);
    for (band, size) in [2usize, 4, 8].into_iter().enumerate() {
        let fine = pooled(&level, w, h);
        (w, h) = (w / 2, h / 2);
        if w < 2 || h < 2 {
            return;
        }
        let coarse = pooled(&fine, w, h);
        let full = (size * size) as f64;
        for y in 0..h / 2 * 2 {
            for x in 0..w / 2 * 2 {
                for c in 0..3 {
                    let f = fine[(y * w + x) * 3 + c];
                    let g = coarse[((y / 2) * (w / 2) + x / 2) * 3 + c];
                    if f[2] < full || g[2] < 4.0 * full {
                        continue;
                    }
                    let error = f[0] / f[2] - g[0] / g[2];
                    // Three quarters of the variance of a block's mean remain beside the mean over four of them; of
                    // row noise, which is common to both blocks of a row, one half.
                    let free = 0.75 * f[3 + band] / (f[2] * f[2]);
                    let row = 0.5 * f[1] / f[2] / size as f64;
                    means[band].add(error, free + row);
                }
            }
        }
        level = fine;
    }
}

fn pooled(from: &[[f64; 6]], w: usize, h: usize) -> Vec<[f64; 6]> {
    let mut out = vec![[0.0; 6]; (w / 2) * (h / 2) * 3];
    for y in 0..h / 2 * 2 {
        for x in 0..w / 2 * 2 {
            for c in 0..3 {
                let to = &mut out[((y / 2) * (w / 2) + x / 2) * 3 + c];
                let value = &from[(y * w + x) * 3 + c];
                (0..6).for_each(|k| to[k] += value[k]);
            }
        }
    }
    out
}

/// Means over rows and over columns.
fn lines(w: usize, h: usize, means: &mut [Mean], value: impl Fn(usize) -> Option<(f32, [Variances; 2])>) {
    let mut rows = vec![[0.0f64; 4]; h * 3];
    let mut columns = vec![[0.0f64; 4]; w * 3];
    for y in 0..h {
        for x in 0..w {
            for c in 0..3 {
                let Some((e, v)) = value((y * w + x) * 3 + c) else { continue };
                for (sums, v) in [&mut rows[y * 3 + c], &mut columns[x * 3 + c]].into_iter().zip(v) {
                    let add = [e, v.free + v.fixed, v.row, 1.0].map(f64::from);
                    (0..4).for_each(|k| sums[k] += add[k]);
                }
            }
        }
    }
    for r in rows.iter().filter(|r| r[3] >= 0.25 * w as f64) {
        means[0].add(r[0] / r[3], r[1] / (r[3] * r[3]) + r[2] / r[3]);
    }
    for r in columns.iter().filter(|r| r[3] >= 0.25 * h as f64) {
        means[1].add(r[0] / r[3], (r[1] + r[2]) / (r[3] * r[3]));
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::{P, Theta};
    use super::*;
    use crate::plane::stats::erf;

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

    #[test]
    fn little_noise_lowers_the_score_of_frames_that_have_it() {
        // 1 DN of spread about values between two whole ones, rounded: without noise in the model its error would be
        // counted from the nearest half, and no noise of this size could ever gain.
        let draw = |x: usize, y: usize, c: usize| {
            let bits = crate::chain::rng::random_bits([x as u32, y as u32], c as u32, 7, [1, 2]);
            bits.iter().map(|b| f64::from(*b) / f64::from(u32::MAX) - 0.5).sum::<f64>() * 3.0_f64.sqrt()
        };
        let real = Plane::from_fn(64, 64, |x, y| [0, 1, 2].map(|c| (128.3 + draw(x, y, c) as f32).round()));
        let mean = Plane::from_fn(64, 64, |_, _| [128.3f32; 3]);
        let slope = f64::from(Tone::new(&Theta::neutral()).slope_at(128.0, 1));
        let gain = |dithered: bool| {
            let scored = Scored { real: &real, mean: &mean, mask: None, dithered, flips: None };
            let [none, right] = [0.0, 1.0 / slope].map(|sigma| {
                score_frame(&scored, None, &Tone::new(&Theta::neutral().with(P::Read, sigma))).score
            });
            1.0 - right / none
        };
        assert!(gain(true) > 0.1, "{}", gain(true));
        // Control: counted from the nearest half.
        assert!(gain(false) < 0.02, "{}", gain(false));
    }

    #[test]
    fn row_noise_is_seen_by_row_means_and_not_by_pixels_alone() {
        // Errors that are equal along a row, under a model with white noise of the same spread per pixel.
        let real = Plane::from_fn(64, 64, |_, y| [128.0 + [4.0f32, -4.0][y % 2]; 3]);
        let mean = Plane::from_fn(64, 64, |_, _| [128.0f32; 3]);
        let scored = Scored { real: &real, mean: &mean, mask: None, dithered: false, flips: None };
        let slope = f64::from(Tone::new(&Theta::neutral()).slope_at(128.0, 1));
        let white = Tone::new(&Theta::neutral().with(P::Read, 4.0 / slope));
        let row = Tone::new(&Theta::neutral().with(P::Row, 4.0 / slope));
        let (white, row) = (score_frame(&scored, None, &white), score_frame(&scored, None, &row));
        assert!(row.score < 0.95 * white.score, "{row:?} {white:?}");
        // The family that it is about tells clearly; single pixels cannot tell at all.
        let family = |s: &FrameScore, i: usize| s.families[i].expect("there")[0];
        assert!(family(&row, 4) < 0.8 * family(&white, 4), "{row:?} {white:?}");
        assert!((family(&row, 0) / family(&white, 0) - 1.0).abs() < 0.02, "{row:?} {white:?}");
    }
}
