//! The spread of the real values about the simulated ones: which noise the sensor has.
//!
//! Differences are high-passed over [`APART`] px along the row, so that a mean that is a little wrong counts little, and a
//! row's common value not at all; what a pixel keeps over the frames is told from what is new in each.

use std::collections::BTreeMap;

use super::discrepancy::SPREAD_ERROR;
use super::evidence::Evidence;
use super::intervals::Way;
use super::model::{P, Theta};
use super::packing::Packing;
use super::tone::{Tone, noise_gain, row_kept, row_seen, shared};
use crate::plane::Plane;
use crate::plane::stats::{LUMA, robust_variance};

/// Steepest slope of the simulated picture where noise is measured, DN over 2 px: beyond it renderers differ.
const FLAT_DN: f32 = 10.0;
/// Least share of the pixels to measure at: where texture is everywhere, the flattest of it has to do.
const LEAST_FLAT: f64 = 0.25;
/// Distance over which differences are taken, px; the second where demosaicking and sharpening mix pixels.
const APART: [usize; 2] = [2, 4];
/// Variance of a difference to the mean of two others.
const HIGH_PASS: f64 = 1.5;
/// Fewest values of a bin of brightness.
const FEWEST: usize = 200;
/// Bins of brightness.
const BINS: usize = 32;
/// Relative error of a bin's variance beyond chance.
pub(super) const BIN_ERROR: f64 = SPREAD_ERROR as f64;
/// The same behind compression: where it removes most of the noise the model was seen to be off by up to 13 %.
const PACKED_ERROR: f64 = 0.15;

/// Least mean of each of three colours whose noise is measured together, DN: noise in the dark is bent by the encoding.
const LEAST_OF_THREE: f32 = 24.0;

/// Frames whose values lie in such a range show a pixel's pattern alike, DN.
const ALIKE_DN: f32 = 16.0;

/// Noise before a compression over what is seen behind it, from which on the former is not known.
const MOST_REMOVED: f64 = 12.0;

/// Names of the candidates that change the spread.
pub(super) const NOISES: [&str; 5] =
    ["shot_noise", "fixed_pattern_noise", "row_noise", "read_noise", "hot_pixels"];

/// Variances in linear values of the sensor before the black level. Per bin: linear value, variance, number.
#[derive(Clone, Debug, Default)]
pub(super) struct NoiseData {
    /// Of single values about what their neighbours say.
    pub(super) total: Vec<[f64; 3]>,
    /// The part of it that is the same in every frame.
    pub(super) fixed: Vec<[f64; 3]>,
    /// Of rows beyond that of their pixels.
    pub(super) row2: f64,
    /// The variance of that figure.
    pub(super) row_error2: f64,
}

/// What is measured, before it is reduced.
struct Values {
    total: Vec<Vec<f32>>,
    /// Sum of the simulated values, DN.
    dn: Vec<f64>,
    /// Sum and difference of the means of one value over two halves of the frames in which it is about as bright, and the mean
    /// linear value.
    fixed: Vec<Vec<[f32; 3]>>,
    rows: Vec<f64>,
    /// Variance that a row's mean has from its pixels, sum and number.
    row_own: [f64; 2],
}

/// Where the simulated picture is flat.
pub(super) fn flat_map(mean: &Plane<f32>) -> Vec<bool> {
    let (w, h) = (mean.width, mean.height);
    let steep = |i: usize| -> f32 {
        let (x, y) = (i % w, i / w);
        if x < 2 || y < 2 || x + 2 >= w || y + 2 >= h {
            return f32::INFINITY;
        }
        let here = &mean.data[3 * i..3 * i + 3];
        let there = [-2, 2, -2 * w as i64, 2 * w as i64, -1 - w as i64, 1 + w as i64];
        let offs = there.iter().flat_map(|d| {
            let there = 3 * (i as i64 + d) as usize;
            (0..3).map(move |c| (mean.data[there + c] - here[c]).abs())
        });
        offs.fold(0.0, f32::max)
    };
    let slopes: Vec<f32> = (0..w * h).map(steep).collect();
    let mut sorted = slopes.clone();
    let at = (sorted.len() as f64 * LEAST_FLAT) as usize;
    let quarter = *sorted.select_nth_unstable_by(at.min(slopes.len() - 1), f32::total_cmp).1;
    let most = if quarter.is_finite() { quarter.max(FLAT_DN) } else { FLAT_DN };
    slopes.into_iter().map(|s| s < most).collect()
}

impl NoiseData {
    /// Measures. `means`: simulated values of `frames` (places), DN.
    pub(super) fn measure(
        evidence: &Evidence,
        frames: &[usize],
        means: &[Plane<f32>],
        theta: &Theta,
        masks: Option<&[Plane<f32>]>,
    ) -> Self {
        let tone = Tone::new(theta);
        let (w, h) = (means[0].width, means[0].height);
        let flats: Vec<Vec<bool>> = frames
            .iter()
            .zip(means)
            .map(|(&at, mean)| {
                let mut flat = flat_map(mean);
                if let Some(m) = masks.map(|m| &m[at]) {
                    flat.iter_mut().zip(&m.data).for_each(|(f, m)| *f &= *m > 0.5);
                }
                flat
            })
            .collect();
        let mut values = Values {
            total: vec![Vec::new(); BINS],
            dn: vec![0.0; BINS],
            fixed: vec![Vec::new(); BINS],
            rows: Vec::new(),
            row_own: [0.0; 2],
        };
        // By whole DN: linear values, and their slope by DN.
        let linear: Vec<[f32; 3]> = (0..257).map(|dn| [0, 1, 2].map(|c| tone.decode(dn as f32, c))).collect();
        let slopes: Vec<[f32; 3]> =
            (0..256).map(|dn| [0, 1, 2].map(|c| tone.slope_at(dn as f32, c))).collect();
        let decode = |dn: f32, c: usize| {
            let i = dn as usize;
            linear[i][c] + (linear[i + 1][c] - linear[i][c]) * (dn - i as f32)
        };
        // Linear error, and the simulated value, DN.
        let error = |f: usize, i: usize| -> Option<[f32; 2]> {
            let (r, m) = (evidence.frames[frames[f]].dn.data[i], means[f].data[i]);
            // Values near the ends are clipped, and their spread with them.
            if !flats[f][i / 3] || !(12.0..=240.0).contains(&m) || r <= 0.0 || r >= 255.0 {
                return None;
            }
            let slope = slopes[m as usize][i % 3];
            // Never out of the table: values at its ends were left out above.
            let r = r + dither(frames[f], i);
            (slope > 20.0).then(|| [decode(r, i % 3) - decode(m, i % 3), m])
        };
        // Where pixels share their chroma each still has its own brightness: that has the noise of the three colours, each by
        // its slope, and stands for a colour as bright as they are on such a mean. Noise of rows is common to the three.
        let luma = is_luma(theta);
        let brightness = |f: usize, i: usize, common: bool| -> Option<[f32; 2]> {
            let (mut sum, mut slope2, mut slope, mut linear) = (0.0, 0.0, 0.0, 0.0);
            for (c, weight) in LUMA.into_iter().enumerate() {
                let m = means[f].data[i + c];
                // A value at the end of its range keeps the others: without such pixels the rest would have less noise.
                if !flats[f][i / 3] || !(LEAST_OF_THREE..=240.0).contains(&m) {
                    return None;
                }
                // In DN: what colours have taken from each other is no error of brightness.
                let off = evidence.frames[frames[f]].dn.data[i + c] + dither(frames[f], i + c) - m;
                let steep = weight * slopes[m as usize][c];
                sum += weight * off;
                slope += steep;
                slope2 += steep * steep;
                linear += steep * steep * decode(m, c);
            }
            let own = if common { slope } else { slope2.sqrt() };
            Some([sum / own, tone.dn_of(linear / slope2)])
        };
        let seen_at = |f: usize, i: usize, common: bool| -> Option<[f32; 2]> {
            match (luma, i % 3) {
                (false, _) => error(f, i),
                (true, 0) => brightness(f, i, common),
                (true, _) => None,
            }
        };
        let mixed = theta.is_on(P::Mosaic) || theta.is_on(P::Sharpen);
        let apart = APART[usize::from(mixed)];
        let rows_apart = if mixed { APART[1] } else { 1 };
        for y in 0..h {
            for x in apart..w.saturating_sub(apart) {
                for c in 0..3 {
                    let i = 3 * (y * w + x) + c;
                    let mut seen: Vec<[f32; 3]> = Vec::with_capacity(frames.len());
                    for f in 0..frames.len() {
                        let [a, e, b] = [i - 3 * apart, i, i + 3 * apart].map(|i| seen_at(f, i, false));
                        if let (Some([e, m]), Some([a, _]), Some([b, _])) = (e, a, b) {
                            seen.push([e - 0.5 * (a + b), m, decode(m, if luma { 1 } else { c })]);
                        }
                    }
                    values.add(&seen);
                }
            }
        }
        for f in 0..frames.len() {
            values.add_rows([w, h], rows_apart, |i| seen_at(f, i, true).map(|e| e[0]));
        }
        values.reduce(&tone, theta, usize::from(apart == APART[1]))
    }

    /// Parameters of the given noise effects, by weighted least squares that keeps them from going negative; those of the
    /// others are as in `base`.
    pub(super) fn fit(&self, theta: &Theta, base: &Theta, names: &[&str]) -> Theta {
        let on = |name: &str| names.contains(&name);
        let mut theta = theta.clone();
        for p in [P::Shot, P::Read, P::Row, P::Dsnu, P::Prnu, P::Hot] {
            theta.set(p, base.get(p));
        }
        if on("row_noise") {
            theta.set(P::Row, self.row2.sqrt());
        }
        if on("fixed_pattern_noise") {
            let [dsnu2, prnu2] = line(&self.unclipped_fixed(), PATTERN).0;
            // A pattern is a part of the spread: where single frames have none, it is what renderers differ by at places that
            // stay in sight.
            if theta.is_on(P::Quality) || self.holds(|l| dsnu2 + prnu2 * l * l) {
                theta.set(P::Dsnu, dsnu2.sqrt());
                theta.set(P::Prnu, prnu2.sqrt());
            }
        }
        let known = |l: f64| {
            let read2 = if on("read_noise") { 0.0 } else { base.get(P::Read).powi(2) };
            let shot = if on("shot_noise") { 0.0 } else { l * base.get(P::Shot) };
            // A model without a pattern takes its spread for noise that is new in every frame.
            read2 + shot + theta.get(P::Dsnu).powi(2) + (theta.get(P::Prnu) * l).powi(2)
        };
        let rest: Vec<[f64; 3]> =
            self.unclipped().iter().map(|&[l, v, n]| [l, (v - known(l)).max(0.0), n]).collect();
        let [read2, inverse] = match (on("read_noise"), on("shot_noise")) {
            (true, true) => line(&rest, |l| [1.0, l]).0,
            (true, false) => line(&rest, |_| [1.0, 0.0]).0,
            (false, true) => line(&rest, |l| [0.0, l]).0,
            (false, false) => [0.0, 0.0],
        };
        if on("read_noise") {
            theta.set(P::Read, read2.sqrt());
        }
        if on("shot_noise") {
            theta.set(P::Shot, inverse);
        }
        // Less than a few hundredths of a DN is no noise but the arithmetic of rounding.
        for (p, least) in [(P::Read, 2e-4), (P::Shot, 1e-6), (P::Row, 2e-4), (P::Dsnu, 2e-4), (P::Prnu, 5e-4)]
        {
            if theta.get(p) < least {
                theta.set(p, 0.0);
            }
        }
        theta
    }
}

impl NoiseData {
    /// Whether single frames spread by no less than half of that variance, by the linear value, on average.
    fn holds(&self, variance: impl Fn(f64) -> f64) -> bool {
        let bins = self.unclipped();
        let [seen, told] = bins.iter().fold([0.0; 2], |[s, t], &[l, v, n]| [s + n * v, t + n * variance(l)]);
        told <= 2.0 * seen
    }

    /// Bins whose spread the darkest value does not cut off; the brightest ones where that leaves too few.
    pub(super) fn unclipped(&self) -> Vec<[f64; 3]> {
        let inside = |[l, v, _]: &&[f64; 3]| {
            let reach = 2.5 * (v + self.row2).sqrt();
            *l > reach && *l < 1.0 - reach
        };
        let free = self.total.iter().filter(inside);
        let free: Vec<_> = free.copied().collect();
        if free.len() >= 4 { free } else { self.total[self.total.len().saturating_sub(4)..].to_vec() }
    }

    /// The same bins of the fixed pattern.
    fn unclipped_fixed(&self) -> Vec<[f64; 3]> {
        let free = self.unclipped();
        let from = free.first().map_or(0.0, |b| b[0]);
        let to = free.last().map_or(1.0, |b| b[0]);
        let inside: Vec<_> =
            self.fixed.iter().filter(|b| (0.98 * from..=1.02 * to).contains(&b[0])).copied().collect();
        if inside.len() >= 2 { inside } else { self.fixed.clone() }
    }

    /// Standard errors of the parameters of `names` from those of the bins.
    pub(super) fn errors(&self, theta: &Theta, names: &[&str]) -> BTreeMap<P, f64> {
        let on = |name: &str| names.contains(&name);
        let mut out = BTreeMap::new();
        // A parameter is the root of its coefficient.
        let root = |p: P, variance: f64| (p, variance.sqrt() / (2.0 * theta.get(p)).max(1e-6));
        if on("fixed_pattern_noise") {
            let variances = line(&self.unclipped_fixed(), PATTERN).1;
            out.extend([root(P::Dsnu, variances[0]), root(P::Prnu, variances[1])]);
        }
        let (read, shot) = (f64::from(u8::from(on("read_noise"))), f64::from(u8::from(on("shot_noise"))));
        if read + shot > 0.0 {
            let variances = line(&self.unclipped(), |l| [read, shot * l]).1;
            if read > 0.0 {
                out.extend([root(P::Read, variances[0])]);
            }
            if shot > 0.0 {
                out.insert(P::Shot, variances[1].sqrt());
            }
        }
        out
    }

    /// Where what is measured lies between the noise of two models; nothing where they have the same.
    pub(super) fn way(&self, from: &Theta, to: &Theta) -> Option<Way> {
        let share = if to.is_on(P::Quality) { PACKED_ERROR } else { BIN_ERROR };
        let pattern = |t: &Theta, l: f64| t.get(P::Dsnu).powi(2) + (t.get(P::Prnu) * l).powi(2);
        let single = |t: &Theta, l: f64| t.get(P::Read).powi(2) + l * t.get(P::Shot) + pattern(t, l);
        // What is seen, what either model says, and the variance of what is seen.
        let mut seen: Vec<[f64; 4]> = Vec::new();
        for [l, v, n] in self.unclipped() {
            let [a, b] = [from, to].map(|t| single(t, l));
            let level = v.max(a).max(b);
            seen.push([v, a, b, (level * share).powi(2) + 3.0 / n * level * level]);
        }
        for [l, v, n] in self.unclipped_fixed() {
            let [a, b] = [from, to].map(|t| pattern(t, l));
            // A pattern is what is left of all noise: it is known no better than that.
            let level = self.total.iter().map(|b| b[1]).fold(v.max(a).max(b), f64::max);
            seen.push([v, a, b, (v.max(b) * share).powi(2) + 3.0 / n * level * level]);
        }
        let [a, b] = [from, to].map(|t| t.get(P::Row).powi(2));
        let level = self.row2.max(a).max(b);
        seen.push([self.row2, a, b, (level * share).powi(2) + self.row_error2]);
        let (mut slope, mut weight) = (0.0, 0.0);
        for [v, a, b, error2] in seen {
            slope += (v - a) * (b - a) / error2.max(1e-24);
            weight += (b - a).powi(2) / error2.max(1e-24);
        }
        (weight > 0.0).then(|| Way { share: slope / weight, half: 2.0 / weight.sqrt() })
    }
}

impl Values {
    /// The differences of one value in all frames, with the simulated value of each, DN and linear.
    fn add(&mut self, seen: &[[f32; 3]]) {
        let bin = |m: f32| ((m / 8.0) as usize).min(BINS - 1);
        for [e, m, _] in seen {
            self.total[bin(*m)].push(*e);
            self.dn[bin(*m)] += f64::from(*m);
        }
        // What a pixel sees changes as the camera moves, and with it the part of its pattern that grows with the light: only
        // frames in which it is about as bright are put together. (In the dark errors are clipped: together with those a mean
        // had a spread of its own, and a prnu of 4.5 % was measured as 5.9.)
        let mut by_value = seen.to_vec();
        by_value.sort_by(|a, b| a[1].total_cmp(&b[1]));
        let mut rest = by_value.as_slice();
        while let Some(first) = rest.first() {
            let (alike, brighter) = rest.split_at(rest.partition_point(|s| s[1] < first[1] + ALIKE_DN));
            rest = brighter;
            if alike.len() >= 2 {
                let mean = |i: usize| alike.iter().map(|s| s[i]).sum::<f32>() / alike.len() as f32;
                let half = |from: usize| {
                    let half = alike.iter().skip(from).step_by(2);
                    half.clone().map(|s| s[0]).sum::<f32>() / half.count() as f32
                };
                let (a, b) = (half(0), half(1));
                self.fixed[bin(mean(1))].push([a + b, a - b, mean(2)]);
            }
        }
    }

    /// Means of rows, high-passed over rows so far apart.
    fn add_rows(&mut self, [w, h]: [usize; 2], apart: usize, error: impl Fn(usize) -> Option<f32>) {
        let rows: Vec<Option<[f64; 2]>> = (0..h)
            .map(|y| {
                let (mut sum, mut square, mut n) = (0.0, 0.0, 0.0);
                for i in 3 * y * w..3 * (y + 1) * w {
                    if let Some(e) = error(i) {
                        let e = f64::from(e);
                        (sum, square, n) = (sum + e, square + e * e, n + 1.0);
                    }
                }
                let mean = sum / f64::max(n, 1.0);
                (n > 60.0).then(|| [mean, (square / n - mean * mean) / n])
            })
            .collect();
        for y in apart..h.saturating_sub(apart) {
            if let (Some(a), Some(b), Some(c)) = (rows[y - apart], rows[y], rows[y + apart]) {
                self.rows.push(b[0] - 0.5 * (a[0] + c[0]));
                self.row_own[0] += b[1] + 0.25 * (a[1] + c[1]);
                self.row_own[1] += 1.0;
            }
        }
    }

    fn reduce(mut self, tone: &Tone, theta: &Theta, kind: usize) -> NoiseData {
        let gain = noise_gain(theta).iter().map(|g| f64::from(*g)).sum::<f64>() / 3.0;
        // Chroma shared behind a compression: what is measured is single colours.
        let gain = gain * f64::from(shared(theta).filter(|_| !is_luma(theta)).map_or(1.0, kept));
        let mean_dn: Vec<f32> =
            self.dn.iter().zip(&self.total).map(|(s, v)| (s / v.len().max(1) as f64) as f32).collect();
        let linear = |bin: usize| f64::from(tone.decode(mean_dn[bin], 1)).max(0.0);
        // Of rounding, and of dither.
        let quantum = |bin: usize| {
            let slope = f64::from(tone.slope_at(mean_dn[bin], 1));
            2.0 / 12.0 / (slope * slope).max(1e-9)
        };
        // What compression has left of the noise is a part of it.
        let packed = theta.is_on(P::Quality).then(|| Packing::of(theta.get(P::Quality) as u8));
        let removed = |bin: usize, variance: f64| {
            let dn2 = variance * f64::from(tone.slope_at(mean_dn[bin], 1)).powi(2);
            packed.as_ref().map_or(1.0, |p| f64::from(p.restored(dn2 as f32, kind)))
        };
        let mut whole = vec![1.0; BINS];
        let mut data = NoiseData::default();
        for (bin, v) in self.total.iter_mut().enumerate().filter(|(_, v)| v.len() >= FEWEST) {
            let seen = (robust_variance(v) / HIGH_PASS - quantum(bin)).max(0.0);
            whole[bin] = removed(bin, seen);
            let variance = seen * whole[bin] / gain;
            // Where compression removes nearly all of it nothing is known: that little is seen says nothing then.
            if whole[bin] < MOST_REMOVED {
                data.total.push([linear(bin), variance, v.len() as f64]);
            }
        }
        let known = |bin: &usize| whole[*bin] < MOST_REMOVED;
        for (bin, v) in self.fixed.iter().enumerate().filter(|(b, v)| v.len() >= FEWEST && known(b)) {
            let linear = v.iter().map(|v| f64::from(v[2])).sum::<f64>() / v.len() as f64;
            // Free noise makes as much of a sum of two halves as of their difference, a pattern is in the sum alone, twice.
            let [sum, difference] =
                [0, 1].map(|i| robust_variance(&mut v.iter().map(|v| v[i]).collect::<Vec<f32>>()));
            let variance = (sum - difference).max(0.0) / (4.0 * HIGH_PASS);
            data.fixed.push([linear.max(0.0), variance * whole[bin] / gain, v.len() as f64]);
        }
        if self.rows.len() >= 20 {
            let mut rows: Vec<f32> = self.rows.iter().map(|v| *v as f32).collect();
            // Neighbours that share their noise leave more of it to a row's mean.
            let own = row_kept(theta) * self.row_own[0] / self.row_own[1];
            let (seen, scale) = (robust_variance(&mut rows), HIGH_PASS * f64::from(row_seen(theta)));
            data.row2 = ((seen - own) / scale).max(0.0);
            data.row_error2 = 3.0 / rows.len() as f64 * (seen / scale).powi(2);
        }
        data
    }
}

/// Whether noise is measured of brightness: where pixels share their chroma and nothing is compressed.
fn is_luma(theta: &Theta) -> bool {
    theta.is_on(P::Chroma) && !theta.is_on(P::Quality)
}

/// What equal noise in all colours keeps where pixels share their chroma, on average.
fn kept(shared: [[f32; 3]; 3]) -> f32 {
    shared.iter().flatten().sum::<f32>() / 3.0
}

/// Half a DN to either side, by value and frame: between whole values quantiles would jump. Where a scene has solid colours, whose
/// values all share their fraction, a variance of 5 DN^2 came out up to 30 % off without it.
fn dither(frame: usize, value: usize) -> f32 {
    let mut bits = (value as u32).wrapping_mul(0x9E37_79B1) ^ (frame as u32).wrapping_mul(0x85EB_CA77);
    for factor in [0x7FEB_352D_u32, 0x846C_A68B] {
        bits = (bits ^ (bits >> 16)).wrapping_mul(factor);
    }
    ((bits ^ (bits >> 16)) >> 8) as f32 / (1 << 24) as f32 - 0.5
}

/// How the variance of a fixed pattern grows with brightness.
const PATTERN: fn(f64) -> [f64; 2] = |l| [1.0, l * l];

/// Two coefficients, neither negative, of `variance = x . f(linear)`, weighted by number over squared variance, and the
/// variances of the coefficients.
fn line(bins: &[[f64; 3]], f: impl Fn(f64) -> [f64; 2]) -> ([f64; 2], [f64; 2]) {
    let equations = |previous: [f64; 2]| {
        let (mut a, mut b) = ([[0.0; 2]; 2], [0.0; 2]);
        for &[l, v, n] in bins {
            let g = f(l);
            let model = (previous[0] * g[0] + previous[1] * g[1]).max(0.1 * v).max(1e-9);
            let weight = 1.0 / (model * model * (BIN_ERROR * BIN_ERROR + 3.0 / n));
            for i in 0..2 {
                b[i] += weight * g[i] * v;
                (0..2).for_each(|j| a[i][j] += weight * g[i] * g[j]);
            }
        }
        (a, b)
    };
    let solve = |use_: [bool; 2], previous: [f64; 2]| -> [f64; 2] {
        let (a, b) = equations(previous);
        let one = |i: usize| if a[i][i] > 0.0 { b[i] / a[i][i] } else { 0.0 };
        match use_ {
            [true, true] => {
                let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
                if det.abs() <= 1e-12 * a[0][0] * a[1][1] {
                    return [one(0), 0.0];
                }
                [(b[0] * a[1][1] - b[1] * a[0][1]) / det, (b[1] * a[0][0] - b[0] * a[1][0]) / det]
            }
            [true, false] => [one(0), 0.0],
            _ => [0.0, one(1)],
        }
    };
    let probe = f(0.5);
    let both = [probe[0] > 0.0, probe[1] > 0.0];
    let mut x = [0.0; 2];
    for _ in 0..6 {
        x = solve(both, x);
        if x[0] < 0.0 {
            x = solve([false, true], [0.0, x[1].max(0.0)]);
        } else if x[1] < 0.0 {
            x = solve([true, false], [x[0], 0.0]);
        }
        x = x.map(|v| v.max(0.0));
    }
    let (a, _) = equations(x);
    let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    let variances = [0, 1].map(|i| {
        let j = 1 - i;
        if x[j] > 0.0 && det > 1e-12 * a[0][0] * a[1][1] { a[j][j] / det } else { 1.0 / a[i][i].max(1e-30) }
    });
    (x, variances)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is measured of normal noise of `sigma_dn` on a solid colour that is `fraction` above a whole DN.
    fn measured_dn2(sigma_dn: f32, fraction: f32) -> f64 {
        let theta = Theta::neutral();
        let mean = Plane::from_fn(160, 120, |_, _| [120.0 + fraction; 3]);
        let real = Plane::from_fn(160, 120, |x, y| {
            [0u32, 1, 2].map(|c| {
                let bits = |k: u32| crate::chain::rng::random_bits([x as u32, y as u32], c, k, [5, 6]);
                let sum: f32 = (0..3).flat_map(bits).map(|b| b as f32 / u32::MAX as f32 - 0.5).sum();
                (120.0 + fraction + sigma_dn * sum).round()
            })
        });
        let data = NoiseData::measure(&Evidence::of_one(real), &[0], &[mean], &theta, None);
        data.total[0][1] * f64::from(Tone::new(&theta).slope_at(120.0, 1)).powi(2)
    }

    #[test]
    fn the_spread_of_solid_colours_does_not_depend_on_their_fraction_of_a_dn() {
        for sigma_dn in [0.8f32, 1.2, 2.4] {
            let truth = f64::from(sigma_dn).powi(2);
            for fraction in [0.0, 0.2, 0.35, 0.5] {
                let seen = measured_dn2(sigma_dn, fraction);
                assert!((seen / truth - 1.0).abs() < 0.07, "{sigma_dn} {fraction}: {seen} DN^2 for {truth}");
            }
        }
        assert!(measured_dn2(0.0, 0.3) < 0.03, "rounding alone is no noise: {}", measured_dn2(0.0, 0.3));
    }

    #[test]
    fn a_pattern_is_a_part_of_the_spread_of_single_frames() {
        let dsnu = |seen: f64| {
            let bins = |v: f64| (1..20).map(|i| [f64::from(i) / 20.0, v, 1000.0]).collect::<Vec<_>>();
            let data = NoiseData { total: bins(seen), fixed: bins(4e-6), row2: 0.0, row_error2: 0.0 };
            data.fit(&Theta::neutral(), &Theta::neutral(), &["fixed_pattern_noise"]).get(P::Dsnu)
        };
        assert_eq!(dsnu(0.0), 0.0);
        assert!((dsnu(5e-6) / 2e-3 - 1.0).abs() < 1e-3, "control: {}", dsnu(5e-6));
    }

    #[test]
    fn coefficients_are_recovered_and_never_negative() {
        let bins: Vec<[f64; 3]> =
            (1..20).map(|i| f64::from(i) / 20.0).map(|l| [l, 3e-5 + l / 800.0, 1000.0]).collect();
        let ([read2, inverse], errors) = line(&bins, |l| [1.0, l]);
        assert!(errors[0] > 0.0 && errors[0] < read2.powi(2) && errors[1] < inverse.powi(2), "{errors:?}");
        assert!((read2 - 3e-5).abs() < 1e-8 && (inverse - 1.0 / 800.0).abs() < 1e-8, "{read2} {inverse}");
        let falling: Vec<[f64; 3]> =
            (1..20).map(|i| [f64::from(i) / 20.0, 1e-3 - 4e-5 * f64::from(i), 1e3]).collect();
        let ([read2, inverse], _) = line(&falling, |l| [1.0, l]);
        assert!(read2 > 0.0 && inverse == 0.0);
    }
}
