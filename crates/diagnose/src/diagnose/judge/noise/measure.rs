//! What differences between real and simulated values say of noise: variances by brightness, before any model of noise.

use std::borrow::Borrow;

use rayon::prelude::*;

use super::NoiseData;
use super::coefficients::{Blocks, Shares, shows_coefficients};
use super::steps::Steps;
use super::tables::{BINS, Tables, bin_of};
use crate::diagnose::evidence::Evidence;
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::tone::{
    Tone, noise_gain, noise_gains, noiseless, row_kept, row_seen, shared, shows_steps,
};
use crate::diagnose::packing::Packing;
use shutterbug::plane::stats::{LUMA, robust_variance};
use shutterbug::plane::{Plane, three};
use shutterbug::reference::moments::Sources;

/// Steepest slope of the simulated picture where noise is measured, DN over 2 px: beyond it renderers differ.
const FLAT_DN: f32 = 10.0;
/// Least share of the pixels to measure at: where texture is everywhere, the flattest of it has to do.
const LEAST_FLAT: f64 = 0.25;
/// Distance over which differences are taken, px; the second where demosaicking and sharpening mix pixels.
const APART: [usize; 2] = [2, 4];
/// Variance of a difference to the mean of two others.
const HIGH_PASS: f64 = 1.5;
/// Least own value, over the one whose noise it has: darker ones have less, for black cuts it off.
const LEAST_OF_SOURCE: f32 = 0.5;
/// Fewest values of a bin of brightness.
const FEWEST: usize = 200;
/// Least mean of each of three colours whose noise is measured together, DN: noise in the dark is bent by the encoding.
const LEAST_OF_THREE: f32 = 24.0;
/// Frames whose values lie in such a range show a pixel's pattern alike, DN.
const ALIKE_DN: f32 = 16.0;
/// Noise before a compression over what is seen behind it, from which on the former is not known.
const MOST_REMOVED: f64 = 12.0;

/// Least distance of two steps of a converter that are told apart, DN: what is delivered is rounded besides.
const LEAST_STEP_DN: f32 = 3.0;

/// Noise by which colours are compared with greys, a fraction of full scale.
const LITTLE: f64 = 4e-3;

/// The frames that noise is measured in.
struct Compared<'a, M> {
    evidence: &'a Evidence,
    /// Places.
    frames: &'a [usize],
    means: &'a [M],
    flats: Vec<Vec<bool>>,
    tables: Tables,
    tone: &'a Tone,
    /// What takes back that colours are made of each other behind the encoding, `[of][from]`; nothing where they are
    /// not.
    unmix: Option<[[f32; 3]; 3]>,
    /// Where colours have each other's noise: whose, and by colour what single values are to be multiplied with, so
    /// that equal noise on the sensor is as much in each.
    sources: Option<(Sources, [f32; 3])>,
    /// Whether noise is measured of brightness.
    luma: bool,
    /// The simulated values ahead of a coarse converter, DN; nothing where its steps are not seen one by one.
    ahead: Option<&'a [M]>,
}

impl<M: Borrow<Plane<f32>> + Sync> Compared<'_, M> {
    /// Linear error of a value, and the simulated one, DN.
    fn error(&self, f: usize, i: usize) -> Option<[f32; 2]> {
        let [r, m] = self.values(f, i).filter(|_| self.flats[f][i / 3])?;
        // Values near the ends are clipped, and their spread with them.
        if !(12.0..=240.0).contains(&m) {
            return None;
        }
        let slope = self.tables.slopes[m as usize][i % 3];
        // Never out of the table: values at its ends were left out above.
        let own = (slope > 20.0).then(|| [self.tables.decode(r, i % 3), self.tables.decode(m, i % 3)])?;
        let Some((sources, factors)) = &self.sources else { return Some([own[0] - own[1], m]) };
        let linear = self.source(sources, f, i)?;
        // In the dark, noise of bright colours is cut off at black.
        (own[1] >= LEAST_OF_SOURCE * linear)
            .then(|| [factors[i % 3] * (own[0] - own[1]), self.tone.dn_of(linear).clamp(0.0, 255.0)])
    }

    /// The linear value of the sensor whose noise a simulated value has: the mean over the colours that it comes from.
    fn source(&self, sources: &Sources, f: usize, i: usize) -> Option<f32> {
        let (mean, c) = (&self.means[f].borrow().data, i % 3);
        let colour = three(|k| self.values(f, i - c + k).map(|v| v[1]));
        let grey = |k: usize| self.tables.decode(colour[k].unwrap_or(mean[i - c + k]).clamp(0.0, 255.0), k);
        let greys = [grey(0), grey(1), grey(2)];
        let sensor = |from: usize| (0..3).map(|k| sources.back[from][k] * greys[k]).sum::<f32>().max(0.0);
        let linear: f32 = (0..3).map(|from| sources.shares[c][from] * sensor(from)).sum();
        linear.is_finite().then_some(linear)
    }

    /// The real and the simulated value, DN, ahead of what makes colours of each other: behind it a colour has noise of
    /// all three. Nothing where a real one was clipped.
    fn values(&self, f: usize, i: usize) -> Option<[f32; 2]> {
        let (at, c) = (self.frames[f], i % 3);
        let (real, mean) = (&self.evidence.frames[at].dn.data, &self.means[f].borrow().data);
        let is_inside = |i: usize| real[i] > 0.0 && real[i] < 255.0;
        let dithered = |i: usize| real[i] + dither(at, i);
        let Some(unmix) = &self.unmix else {
            return is_inside(i).then(|| [dithered(i), mean[i]]);
        };
        let colour = [i - c, i - c + 1, i - c + 2];
        let ahead = |of: &dyn Fn(usize) -> f32| (0..3).map(|k| unmix[c][k] * of(colour[k])).sum::<f32>();
        let [r, m] = [ahead(&dithered), ahead(&|i| mean[i])];
        // What was clipped ahead of it comes back within the rounding of three colours.
        (colour.into_iter().all(is_inside) && r > 1.0 && r < 254.0).then_some([r, m])
    }

    /// The same of a pixel's brightness. Where pixels share their chroma each still has its own brightness: that has
    /// the noise of the three colours, each by its slope, and stands for a colour as bright as they are on such a mean.
    /// Noise of rows is
    /// `common` to the three.
    fn brightness(&self, f: usize, i: usize, common: bool) -> Option<[f32; 2]> {
        let (mut sum, mut slope2, mut slope, mut linear) = (0.0, 0.0, 0.0, 0.0);
        for (c, weight) in LUMA.into_iter().enumerate() {
            let m = self.means[f].borrow().data[i + c];
            // A value at the end of its range keeps the others: without such pixels the rest would have less noise.
            if !self.flats[f][i / 3] || !(LEAST_OF_THREE..=240.0).contains(&m) {
                return None;
            }
            // In DN: what colours have taken from each other is no error of brightness.
            let at = self.frames[f];
            let off = self.evidence.frames[at].dn.data[i + c] + dither(at, i + c) - m;
            let steep = weight * self.tables.slopes[m as usize][c];
            sum += weight * off;
            slope += steep;
            slope2 += steep * steep;
            linear += steep * steep * self.tables.decode(m, c);
        }
        let own = if common { slope } else { slope2.sqrt() };
        Some([sum / own, self.tone.dn_of(linear / slope2)])
    }

    fn seen_at(&self, f: usize, i: usize, common: bool) -> Option<[f32; 2]> {
        match (self.luma, i % 3) {
            (false, _) => self.error(f, i),
            (true, 0) => self.brightness(f, i, common),
            (true, _) => None,
        }
    }

    /// Where the value ahead of the converter lies, and the step that is seen, in steps.
    fn steps(&self, f: usize, i: usize, ahead: &[M]) -> Option<[f32; 2]> {
        let (r, m) = (self.evidence.frames[self.frames[f]].dn.data[i], ahead[f].borrow().data[i]);
        let inside = self.flats[f][i / 3] && (12.0..=240.0).contains(&m) && r > 0.0 && r < 255.0;
        let open =
            inside && self.tables.slopes[m as usize][i % 3] * self.tone.step_linear(i % 3) >= LEAST_STEP_DN;
        open.then(|| [m, r].map(|dn| self.tone.in_steps(dn, i % 3)))
    }

    /// What a row of the picture shows in all frames.
    fn row(&self, y: usize, w: usize, apart: usize) -> Values {
        let mut values = Values::default();
        let mut seen: Vec<[f32; 3]> = Vec::with_capacity(self.frames.len());
        for x in apart..w.saturating_sub(apart) {
            for c in 0..3 {
                let i = 3 * (y * w + x) + c;
                seen.clear();
                for f in 0..self.frames.len() {
                    let [a, e, b] = [i - 3 * apart, i, i + 3 * apart].map(|i| self.seen_at(f, i, false));
                    if let (Some([e, m]), Some([a, _]), Some([b, _])) = (e, a, b) {
                        let channel = if self.luma || self.sources.is_some() { 1 } else { c };
                        seen.push([e - 0.5 * (a + b), m, self.tables.decode(m, channel)]);
                    }
                    if let Some([simulated, real]) = self.ahead.and_then(|ahead| self.steps(f, i, ahead)) {
                        let m = self.means[f].borrow().data[i];
                        values.steps[bin_of(m)].add(simulated, real);
                    }
                }
                values.add(&mut seen);
            }
        }
        values
    }
}

impl NoiseData {
    /// Measures. `means`: simulated values of `frames` (places), DN; `ahead`: the same ahead of what rounds them
    /// coarsely (see [`ahead_of_steps`]), nothing without such.
    pub(crate) fn measure<M: Borrow<Plane<f32>> + Sync>(
        evidence: &Evidence,
        frames: &[usize],
        means: &[M],
        ahead: Option<&[M]>,
        theta: &Theta,
        masks: Option<&[Plane<f32>]>,
    ) -> Self {
        let tone = Tone::new(theta);
        let (w, h) = (means[0].borrow().width, means[0].borrow().height);
        let flat = |(&at, mean): (&usize, &M)| {
            let mut flat = flat_map(mean.borrow());
            if let Some(m) = masks.map(|m| &m[at]) {
                flat.iter_mut().zip(&m.data).for_each(|(f, m)| *f &= *m > 0.5);
            }
            flat
        };
        let flats = frames.par_iter().zip(means).map(flat).collect();
        let (luma, tables) = (is_luma(theta), Tables::of(&tone));
        let a_little = Tone::new(&noiseless(theta).with(P::Read, LITTLE));
        let matrices = a_little.colours_behind().filter(|_| !luma);
        let unmix = matrices.map(|[_, back]| *back);
        let mixing = matrices.map_or([1.0; 2], |of| of.map(kept_by));
        let steps = ahead.filter(|_| shows_steps(theta));
        let mixed = theta.is_on(P::Mosaic) || theta.is_on(P::Sharpen);
        let apart = APART[usize::from(mixed)];
        let kind = usize::from(apart == APART[1]);
        let sources = tone.sources().filter(|_| !luma).map(|of| {
            let factors = factors(theta, kind, &of);
            (of, factors)
        });
        let compared = Compared {
            evidence,
            frames,
            means,
            flats,
            tables,
            tone: &tone,
            unmix,
            sources,
            luma,
            ahead: steps,
        };
        let rows: Vec<Values> = (0..h).into_par_iter().map(|y| compared.row(y, w, apart)).collect();
        let mut values = Values::default();
        rows.into_iter().for_each(|row| values.append(row));
        for f in 0..frames.len() {
            values.add_rows([w, h], rows_apart(theta), |i| compared.seen_at(f, i, true).map(|e| e[0]));
        }
        let mut data = values.reduce(&tone, theta, kind, mixing);
        let files = ahead.filter(|_| shows_coefficients(theta));
        let Compared { flats, tables, .. } = &compared;
        let shares = Shares::of(theta);
        let blocks = Blocks { evidence, frames, flats, tables, tone: &tone, shares: &shares };
        if let Some(told) = files.and_then(|ahead| blocks.told(theta, ahead)) {
            (data.total, data.row2) = (told.total, told.row2);
        }
        data
    }
}

/// How far rows lie apart that are held against each other: next to each other they share what a filter spreads.
fn rows_apart(theta: &Theta) -> usize {
    if row_seen(theta) == 1.0 { 1 } else { APART[1] }
}

/// What is measured, before it is reduced.
struct Values {
    total: Vec<Vec<f32>>,
    /// Sum of the simulated values, DN.
    dn: Vec<f64>,
    /// Sum and difference of the means of one value over two halves of the frames in which it is about as bright, the
    /// mean linear value, and the difference in units in which it spreads as single values do.
    fixed: Vec<Vec<[f32; 4]>>,
    rows: Vec<f64>,
    /// Variance that a row's mean has from its pixels, sum and number.
    row_own: [f64; 2],
    /// Behind a coarse converter, by bin.
    steps: Vec<Steps>,
}

/// Where the simulated picture is flat.
pub(crate) fn flat_map(mean: &Plane<f32>) -> Vec<bool> {
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

impl Default for Values {
    fn default() -> Self {
        Self {
            total: vec![Vec::new(); BINS],
            dn: vec![0.0; BINS],
            fixed: vec![Vec::new(); BINS],
            rows: Vec::new(),
            row_own: [0.0; 2],
            steps: vec![Steps::default(); BINS],
        }
    }
}

impl Values {
    /// Adds what another row shows.
    fn append(&mut self, row: Self) {
        for (to, from) in self.total.iter_mut().zip(row.total) {
            to.extend(from);
        }
        for (to, from) in self.fixed.iter_mut().zip(row.fixed) {
            to.extend(from);
        }
        self.dn.iter_mut().zip(row.dn).for_each(|(to, from)| *to += from);
        self.steps.iter_mut().zip(&row.steps).for_each(|(to, from)| to.append(from));
    }

    /// The differences of one value in all frames, with the simulated value of each, DN and linear.
    fn add(&mut self, seen: &mut [[f32; 3]]) {
        let bin = bin_of;
        for [e, m, _] in seen.iter() {
            self.total[bin(*m)].push(*e);
            self.dn[bin(*m)] += f64::from(*m);
        }
        // What a pixel sees changes as the camera moves, and with it the part of its pattern that grows with the light:
        // only frames in which it is about as bright are put together. (In the dark errors are clipped: together with
        // those a mean had a spread of its own, and a prnu of 4.5 % was measured as 5.9.)
        seen.sort_by(|a, b| a[1].total_cmp(&b[1]));
        let mut rest = &*seen;
        while let Some(first) = rest.first() {
            let (alike, brighter) = rest.split_at(rest.partition_point(|s| s[1] < first[1] + ALIKE_DN));
            rest = brighter;
            if alike.len() >= 2 {
                let mean = |i: usize| alike.iter().map(|s| s[i]).sum::<f32>() / alike.len() as f32;
                let half = |from: usize| {
                    let half = alike.iter().skip(from).step_by(2);
                    let count = half.clone().count() as f32;
                    (half.map(|s| s[0]).sum::<f32>() / count, count)
                };
                let ((a, n), (b, k)) = (half(0), half(1));
                let single = (a - b) / (1.0 / n + 1.0 / k).sqrt();
                self.fixed[bin(mean(1))].push([a + b, a - b, mean(2), single]);
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

    /// `mixing`: what equal noise in all colours keeps where they are made of each other, and where that is taken back.
    fn reduce(mut self, tone: &Tone, theta: &Theta, kind: usize, mixing: [f64; 2]) -> NoiseData {
        let gain = noise_gain(theta, kind, is_luma(theta));
        // Chroma shared behind a compression: what is measured is single colours.
        let gain = gain * f64::from(shared(theta).filter(|_| !is_luma(theta)).map_or(1.0, kept));
        let mean_dn: Vec<f32> =
            self.dn.iter().zip(&self.total).map(|(s, v)| (s / v.len().max(1) as f64) as f32).collect();
        let linear = |bin: usize| f64::from(tone.decode(mean_dn[bin], 1)).max(0.0);
        // What compression has left of the noise is a part of it.
        let packed = theta.is_on(P::Quality).then(|| Packing::of(theta.get(P::Quality) as u8));
        let removed = |bin: usize, variance: f64| {
            let dn2 = mixing[0] * variance * f64::from(tone.slope_at(mean_dn[bin], 1)).powi(2);
            packed.as_ref().map_or(1.0, |p| f64::from(p.restored(dn2 as f32, kind)))
        };
        let mut whole = vec![1.0; BINS];
        let mut data = NoiseData::default();
        for (bin, v) in self.total.iter_mut().enumerate().filter(|(_, v)| v.len() >= FEWEST) {
            let rounding = mixing[1] * quantum(tone, mean_dn[bin]);
            let seen = (robust_variance(v) / HIGH_PASS - rounding).max(0.0);
            whole[bin] = removed(bin, seen);
            let variance = tone.unrounded(seen * whole[bin] / gain);
            // Where compression removes nearly all of it nothing is known: that little is seen says nothing then.
            if whole[bin] < MOST_REMOVED {
                data.total.push([linear(bin), variance, v.len() as f64]);
            }
        }
        let known = |bin: &usize| whole[*bin] < MOST_REMOVED;
        for (bin, v) in self.fixed.iter().enumerate().filter(|(b, v)| v.len() >= FEWEST && known(b)) {
            let linear = v.iter().map(|v| f64::from(v[2])).sum::<f64>() / v.len() as f64;
            // Free noise makes as much of a sum of two halves as of their difference, a pattern is in the sum alone,
            // twice.
            let [sum, difference] = self.of_halves(bin, tone.step_linear(1));
            let [pattern, free] =
                [sum - difference, difference].map(|v| v * whole[bin] / (4.0 * HIGH_PASS * gain));
            let count = v.len() as f64;
            // Beside free noise both have the chance of that.
            let free2 = 2.0 * chance2(count) * free * (free + pattern.max(0.0));
            data.fixed.push([linear.max(0.0), pattern, count, free2]);
            // Behind a file or a coarse converter other figures tell of single values.
            if packed.is_none() && self.steps[bin].is_empty() {
                let mut single: Vec<f32> = v.iter().map(|v| v[3]).collect();
                let rounding = mixing[1] * quantum(tone, mean_dn[bin]);
                let seen = (robust_variance(&mut single) / HIGH_PASS - rounding).max(0.0);
                data.fresh.push([linear.max(0.0), tone.unrounded(seen / gain), count]);
            }
        }
        if self.rows.len() >= 20 {
            let mut rows: Vec<f32> = self.rows.iter().map(|v| *v as f32).collect();
            // Neighbours that share their noise leave more of it to a row's mean.
            let own = row_kept(theta) * self.row_own[0] / self.row_own[1];
            let (seen, scale) = (robust_variance(&mut rows), HIGH_PASS * f64::from(row_seen(theta)));
            data.row2 = ((seen - own) / scale).max(0.0);
            data.row_error2 = 3.0 / rows.len() as f64 * (seen / scale).powi(2);
        }
        data.total = self.told_by_steps(tone, data.row2, &mean_dn).unwrap_or(data.total);
        data
    }

    /// Variances of single values by bin, where the steps of a converter tell them: what goes to other steps goes
    /// there by the noise of its row as well.
    fn told_by_steps(&self, tone: &Tone, row2: f64, mean_dn: &[f32]) -> Option<Vec<[f64; 3]>> {
        let step = f64::from(tone.step_linear(1));
        let told = |bin: usize| {
            let told = self.steps[bin].told()?;
            let variance = told.variance * step * step - quantum(tone, mean_dn[bin]) - row2;
            let linear = f64::from(tone.decode(mean_dn[bin], 1)).max(0.0);
            (told.count >= 1.0).then(|| [linear, variance.max(0.0), told.count])
        };
        let all: Vec<[f64; 3]> = (0..BINS).filter_map(told).collect();
        (!all.is_empty()).then_some(all)
    }

    /// Variances of the sum and of the difference of two halves in a bin. Behind a coarse converter most of either is
    /// nothing: the rest counts, up to what is far off for all kinds of noise.
    fn of_halves(&self, bin: usize, step: f32) -> [f64; 2] {
        let values = &self.fixed[bin];
        [0, 1].map(|i| {
            if self.steps[bin].is_empty() {
                return robust_variance(&mut values.iter().map(|v| v[i]).collect::<Vec<f32>>());
            }
            let squares = values.iter().map(|v| f64::from(v[i].clamp(-4.0 * step, 4.0 * step)).powi(2));
            squares.sum::<f64>() / values.len() as f64
        })
    }
}

/// What single values of each colour are to be multiplied with, so that equal noise on the sensor is as much in each as
/// in a colour on average.
fn factors(theta: &Theta, kind: usize, sources: &Sources) -> [f32; 3] {
    let own = noise_gains(theta, kind);
    let all = own.iter().sum::<f64>() / 3.0;
    three(|c| (all / (own[c] * f64::from(sources.kept[c]))).sqrt() as f32)
}

/// Variance of rounding and of dither, squares of the linear value.
fn quantum(tone: &Tone, mean_dn: f32) -> f64 {
    let slope = f64::from(tone.slope_at(mean_dn, 1));
    2.0 / 12.0 / (slope * slope).max(1e-9)
}

/// `theta` ahead of what rounds its values to steps that are seen one by one: a coarse converter, or a file's
/// coefficients. Nothing where there is no such.
pub(crate) fn ahead_of_steps(theta: &Theta) -> Option<Theta> {
    let seen = shows_steps(theta) || shows_coefficients(theta);
    seen.then(|| noiseless(theta).with(P::Bits, 0.0).with(P::Quality, 0.0))
}

/// Whether noise is measured of brightness: where pixels share their chroma and nothing is compressed.
fn is_luma(theta: &Theta) -> bool {
    theta.is_on(P::Chroma) && !theta.is_on(P::Quality)
}

/// What equal noise in all colours keeps where each is made of all three (`[of][from]`), on average.
fn kept_by(weights: &[[f32; 3]; 3]) -> f64 {
    weights.iter().flatten().map(|w| f64::from(w * w)).sum::<f64>() / 3.0
}

/// What equal noise in all colours keeps where pixels share their chroma, on average.
fn kept(shared: [[f32; 3]; 3]) -> f32 {
    shared.iter().flatten().sum::<f32>() / 3.0
}

/// Squared relative error that a variance of so many high-passed values has by chance: the middle of a normal
/// distribution tells it to 7.6 / n (variance of the difference of two quantiles, Cramer 1946), and neighbours that
/// share their values make that 1.9 times as much (1 + 2 (4 / 9 + 1 / 36)).
pub(crate) fn chance2(count: f64) -> f64 {
    7.6 * 1.9 / count
}

/// Half a DN to either side, by value and frame: between whole values quantiles would jump. Where a scene has solid
/// colours, whose values all share their fraction, a variance of 5 DN^2 came out up to 30 % off without it.
fn dither(frame: usize, value: usize) -> f32 {
    let mut bits = (value as u32).wrapping_mul(0x9E37_79B1) ^ (frame as u32).wrapping_mul(0x85EB_CA77);
    for factor in [0x7FEB_352D_u32, 0x846C_A68B] {
        bits = (bits ^ (bits >> 16)).wrapping_mul(factor);
    }
    ((bits ^ (bits >> 16)) >> 8) as f32 / (1 << 24) as f32 - 0.5
}
