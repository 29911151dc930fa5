//! What happens to a value on its own, under the noise that it has: mean and spread of the delivered value. Noise that
//! is clipped or bent by the encoding moves the mean too, so a model of values needs the noise as well.

use super::clipped::share_kept;
use super::coloured::{Coloured, Conversion, Sources, back};
use super::curve::{ANYWHERE, TABLE, Table, is_behind_encoding, switched_on, tables};
use super::places::{COARSE, mixed_colors, place, places_by_dn, sensor_at, sensor_place};
use crate::chain::{
    Domain, Effect, Left, Mixed, Mixing, Moments, Noise, Origins, Settings, Stage, Variances,
};
use crate::effects::LIST;
use crate::effects::jpeg::flips::rounded_variance;
use crate::effects::jpeg::packing::{Packing, rounded_mean};
use crate::plane::stats::erf;

/// Points of the integral over the noise, each side of the mean, and their distance in standard deviations.
const POINTS: i32 = 12;
/// See [`POINTS`].
const STEP: f32 = 0.3;

/// Entries of the table of a converter's means in one step, and most steps of one that has such a table.
const ENTRIES: f32 = 32.0;
/// See [`ENTRIES`].
const MOST_STEPS: f32 = 127.0;
/// Standard deviations to either side within which steps are summed over.
const SIGMAS: f32 = 5.0;

/// A matrix of colours behind the encoding: the spread of what it makes depends on the colours that it is made of.
struct Behind {
    /// `[of][from]`.
    weights: [[f32; 3]; 3],
    /// From delivered colours to those ahead of it.
    back: [[f32; 3]; 3],
    /// By channel and whole DN of the mean ahead of it.
    ahead: [Vec<Variances>; 3],
}

impl Behind {
    /// Nothing where colours cannot be told from what is made of them.
    fn new(weights: [[f32; 3]; 3], ahead: [Vec<Variances>; 3]) -> Option<Self> {
        back(&weights).map(|back| Self { weights, back, ahead })
    }

    fn spread(&self, mean_dn: &[f32], channel: usize, coloured: Option<&Coloured>) -> Variances {
        let dn = self.back.map(|of| -> f32 { (0..3).map(|c| of[c] * mean_dn[c]).sum() });
        if let Some(coloured) = coloured {
            return coloured.spread_of_mixture(&dn, &self.weights[channel]);
        }
        let ahead = |from: usize| self.ahead[from][(dn[from] + 0.5).clamp(0.0, 255.0) as usize];
        mixed_colors((0..3).map(|from| (self.weights[channel][from], ahead(from))))
    }
}

/// What compression leaves: of noise that is each value's own; of noise that a row shares, in a pixel and in the mean
/// of its row.
type Packed = (Left, [f32; 2]);

/// Everything that happens to a value on its own.
pub struct Tone {
    /// By channel.
    tables: [Table; 3],
    /// Stems of the effects that the tables hold.
    pub(super) bent: Vec<&'static str>,
    /// Behind the noise: factor and term of values of the sensor, by channel.
    sensor: [[f32; 2]; 3],
    /// From there to the value that is encoded.
    pub(super) colors: [[f32; 3]; 3],
    /// Sums of its rows: what a grey is multiplied with.
    pub(super) whole: [f32; 3],
    noise: [Noise; 3],
    /// Rounding of the sensor's values, and how far these may be apart; 0: not rounded.
    pub(super) step: f32,
    /// By channel and sensor value, from 0 to 1: what a converter of few steps delivers, as a value of the sensor.
    stepped: [Vec<f32>; 3],
    /// By channel and sensor value: what noise adds to the mean.
    shift: Option<Box<[[f32; COARSE]; 3]>>,
    /// By channel and whole DN of the mean.
    by_dn: Option<[Vec<Variances>; 3]>,
    /// Where colours are made of each other ahead of the encoding.
    coloured: Option<Coloured>,
    /// What makes each colour of all three behind the encoding.
    behind: Option<Behind>,
    /// By channel and whole DN of the mean: what compression leaves of that.
    packed: Option<[Vec<Packed>; 3]>,
    /// What steps that mix pixels leave of it.
    mixing: Mixing,
    /// Whose noise a mosaic gives each colour.
    origins: &'static Origins,
    /// Nothing but curves of single values follows the encoding: each of its values is delivered as one whole DN.
    encoding_is_last: bool,
    /// The same but for what mixes pixels.
    only_mixed: bool,
}

impl Tone {
    /// Of a camera.
    pub fn new(settings: &Settings) -> Self {
        let mut tone = Self::silent(settings);
        if tone.noise.iter().any(Noise::any) {
            tone.make_spread(settings);
        }
        tone
    }

    /// Without what noise does.
    fn silent(settings: &Settings) -> Self {
        let ((bent, tables), mixed) = (tables(settings), Mixed::of(LIST, settings));
        let follows = |e: &dyn Effect| is_behind_encoding(e) && !bent.contains(&e.id());
        let mut tone = Self {
            encoding_is_last: !switched_on(settings).any(follows),
            only_mixed: !switched_on(settings).any(|e| follows(e) && !e.moments().mixes()),
            tables,
            bent,
            sensor: [[1.0, 0.0]; 3],
            colors: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            whole: [1.0; 3],
            noise: Default::default(),
            step: 0.0,
            stepped: Default::default(),
            shift: None,
            by_dn: None,
            coloured: None,
            behind: None,
            packed: None,
            mixing: mixed.mixing(),
            origins: mixed.origins(),
        };
        for effect in switched_on(settings) {
            let is_raw = matches!(effect.stage(), Stage::Pixel(Domain::Electrons | Domain::RawDn, _));
            match effect.moments() {
                Moments::Noise(of) => {
                    let more = of(settings);
                    tone.noise = [0, 1, 2].map(|c| tone.noise[c].plus(&more[c]));
                }
                Moments::Affine(of) if is_raw => {
                    let more = of(settings, &ANYWHERE);
                    tone.sensor = [0, 1, 2].map(|c| {
                        let [factor, term] = more[c].map(|v| v as f32);
                        [factor * tone.sensor[c][0], factor * tone.sensor[c][1] + term]
                    });
                }
                Moments::Colors(of) if !is_behind_encoding(effect) => {
                    let more = of(settings);
                    let entry = |i: usize, j: usize| -> f32 {
                        (0..3).map(|k| more[i][k] as f32 * tone.colors[k][j]).sum()
                    };
                    tone.colors = [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)));
                }
                Moments::Steps(of) => tone.step = of(settings) as f32,
                _ => {}
            }
        }
        // What takes a grey to no light at all has no scale of its own.
        tone.whole = tone.colors.map(|row| row.iter().sum::<f32>());
        tone.whole.iter_mut().filter(|w| **w < 0.05).for_each(|w| *w = 1.0);
        tone
    }

    fn make_spread(&mut self, settings: &Settings) {
        let tables = [0, 1, 2].map(|c| self.under_noise(c));
        let mut by_dn = [0, 1, 2].map(|c| self.spread_by_dn(&tables[c], c));
        self.make_steps(&tables, &mut by_dn);
        for effect in switched_on(settings).filter(|e| is_behind_encoding(*e)) {
            if let Moments::Colors(of) = effect.moments() {
                let weights = of(settings).map(|row| row.map(|w| w as f32));
                let grey = |c: usize, dn: usize| {
                    mixed_colors((0..3).map(|from| (weights[c][from], by_dn[from][dn])))
                };
                let mixed = [0, 1, 2].map(|c| (0..256).map(|dn| grey(c, dn)).collect());
                self.behind = Behind::new(weights, std::mem::replace(&mut by_dn, mixed));
            }
            if let Moments::File(of) = effect.moments() {
                let packing = Packing::of(of(settings));
                let left = |v: &Variances| (packing.left(v.free + v.fixed), packing.rows_left(v.row));
                self.packed = Some([0, 1, 2].map(|c| by_dn[c].iter().map(left).collect()));
            }
        }
        // Steps that are seen one by one have tables of their own.
        if !self.is_coarse() {
            self.coloured = self.coloured();
        }
        self.by_dn = Some(by_dn);
        self.shift = Some(Box::new([0, 1, 2].map(|c| std::array::from_fn(|i| tables[c][i].0))));
    }

    #[inline]
    fn plain(&self, value: f32, channel: usize) -> f32 {
        let at = value.clamp(0.0, 1.0) * TABLE as f32;
        let i = place(at).min(TABLE);
        let f = at - i as f32;
        let table = &self.tables[channel];
        table[i] * (1.0 - f) + table[i + 1] * f
    }

    /// Makes mean delivered values, DN, of colours that are encoded.
    pub(super) fn encode(&self, colors: &mut [f32]) {
        let plain = |value: f32, table: &[f32; TABLE + 2]| {
            let at = value.clamp(0.0, 1.0) * TABLE as f32;
            let i = place(at).min(TABLE);
            let f = at - i as f32;
            table[i] * (1.0 - f) + table[i + 1] * f
        };
        let tables = self.tables.each_ref().map(|t| &**t);
        let Some(shift) = &self.shift else {
            return colors
                .chunks_exact_mut(3)
                .for_each(|p| (0..3).for_each(|c| p[c] = plain(p[c], tables[c])));
        };
        if let Some(coloured) = &self.coloured {
            for p in colors.chunks_exact_mut(3) {
                let shift = coloured.shifts([p[0], p[1], p[2]]);
                (0..3).for_each(|c| p[c] = plain(p[c], tables[c]) + shift[c]);
            }
            return;
        }
        for p in colors.chunks_exact_mut(3) {
            for c in 0..3 {
                let sensor = p[c] / self.whole[c];
                let at = sensor_place(sensor);
                let i = place(at).min(COARSE - 2);
                let f = at - i as f32;
                p[c] = plain(p[c], tables[c]) + (shift[c][i] * (1.0 - f) + shift[c][i + 1] * f);
            }
        }
    }

    /// Mean and spread behind a converter whose steps show: sums over the steps that a value may go to, each encoded.
    /// An encoding bends by more than a normal distribution tells from one step to the next, in the dark above all.
    fn make_steps(&mut self, tables: &[Vec<(f32, Variances)>; 3], by_dn: &mut [Vec<Variances>; 3]) {
        if !self.is_coarse() || !self.has_own_colors() {
            return;
        }
        for c in 0..3 {
            let behind = self.behind_steps(c);
            self.stepped[c] = self.delivered_as(&behind, &tables[c], c);
            by_dn[c] = self.spread_of_steps(&behind, c);
        }
    }

    /// By value ahead of the converter, 0 to 1: mean and variance of what is delivered, DN.
    fn behind_steps(&self, channel: usize) -> Vec<[f32; 2]> {
        let last = (1.0 / self.step).round() as i32;
        let dn = |k: i32| self.plain(self.whole[channel] * k as f32 * self.step, channel);
        let encoded: Vec<f32> =
            (0..=last).map(|k| if self.encoding_is_last { dn(k).round() } else { dn(k) }).collect();
        let entries = (ENTRIES / self.step).ceil();
        let of = |i: usize| {
            let value = i as f32 / entries;
            let (at, wide) = (value / self.step, self.sensor_sigma(value, channel) / self.step);
            let below = |k: i32| {
                let z = (k as f32 + 0.5 - at) / wide.max(1e-6);
                0.5 + 0.5 * erf(f64::from(z) * std::f64::consts::FRAC_1_SQRT_2) as f32
            };
            let reach = (SIGMAS * wide).ceil() as i32 + 1;
            let (from, to) = ((at as i32 - reach).clamp(0, last), (at as i32 + reach).clamp(0, last));
            let (mut mean, mut square, mut known) = (0.0, 0.0, 0.0);
            for k in from..=to {
                // The ends of the range take what lies beyond.
                let up = if k == to { 1.0 } else { below(k) };
                let dn = encoded[k as usize];
                mean += (up - known) * dn;
                square += (up - known) * dn * dn;
                known = up;
            }
            [mean, (square - mean * mean).max(0.0)]
        };
        (0..entries as usize + 2).map(of).collect()
    }

    /// The value of the sensor whose delivered mean that is, by value ahead of the converter.
    fn delivered_as(&self, behind: &[[f32; 2]], table: &[(f32, Variances)], channel: usize) -> Vec<f32> {
        let mean = |sensor: f32| {
            let at = sensor_place(sensor);
            let i = place(at).min(COARSE - 2);
            let f = at - i as f32;
            self.plain(self.whole[channel] * sensor, channel) + table[i].0 * (1.0 - f) + table[i + 1].0 * f
        };
        let inverse = |&[dn, _]: &[f32; 2]| {
            let (mut low, mut high) = (-0.2f32, 1.2f32);
            for _ in 0..22 {
                let middle = 0.5 * (low + high);
                if mean(middle) < dn { low = middle } else { high = middle }
            }
            0.5 * (low + high)
        };
        behind.iter().map(inverse).collect()
    }

    /// Spread by whole DN of the mean.
    fn spread_of_steps(&self, behind: &[[f32; 2]], channel: usize) -> Vec<Variances> {
        let entries = (behind.len() - 2) as f32;
        let [gain, row_gain] = [self.mixing.pixel[channel], self.mixing.row[channel]];
        let [factor, term] = self.sensor[channel];
        let mut at = 0;
        let of = |dn: usize| {
            while at + 2 < behind.len() && behind[at + 1][0] < dn as f32 {
                at += 1;
            }
            let ([ma, va], [mb, vb]) = (behind[at], behind[at + 1]);
            let f = if mb > ma { ((dn as f32 - ma) / (mb - ma)).clamp(0.0, 1.0) } else { 0.0 };
            let all = va * (1.0 - f) + vb * f;
            // What a row or a pixel has in common moves the mean; how far, as a rule, is the slope of the encoding.
            let value = (at as f32 + f) / entries;
            let slope = self.slope_at(dn as f32, channel);
            let parts = self.noise[channel].at((value - term) / factor);
            let [row, fixed] = [parts.row, parts.fixed].map(|v| (v * slope * slope).min(0.5 * all));
            Variances { free: gain * (all - row - fixed).max(0.0), row: row_gain * row, fixed: gain * fixed }
        };
        (0..256).map(of).collect()
    }

    /// Whether no colour is made of others between the converter and the encoding.
    fn has_own_colors(&self) -> bool {
        (0..3).all(|i| (0..3).all(|j| i == j || self.colors[i][j] == 0.0))
    }

    /// Mean of a value of the sensor that a converter clips and rounds.
    #[inline]
    pub(super) fn stepped(&self, value: f32, channel: usize) -> f32 {
        let (value, table) = (value.clamp(0.0, 1.0), &self.stepped[channel]);
        if table.is_empty() {
            return rounded_mean(value, self.sensor_sigma(value, channel), self.step);
        }
        let at = value * (table.len() - 2) as f32;
        let i = place(at);
        let f = at - i as f32;
        table[i] * (1.0 - f) + table[i + 1] * f
    }

    /// Standard deviation of a value of the sensor behind the noise.
    fn sensor_sigma(&self, sensor: f32, channel: usize) -> f32 {
        let [factor, term] = self.sensor[channel];
        let v = self.noise[channel].at((sensor - term) / factor);
        (v.free + v.row + v.fixed).sqrt() * factor.abs()
    }

    /// What mixing, subsampling and compression leave of the spread of a channel of a pixel of these mean DN; all of it
    /// without them.
    pub fn left(&self, mean_dn: &[f32], channel: usize) -> Left {
        let mut left = self.packed_at(mean_dn, channel).map_or(Left::ALL, |packed| packed.0);
        if self.mixing.left[channel] != Left::ALL {
            left = left.times(&self.mixing.left[channel]);
        }
        if let Some(shared) = &self.mixing.shared {
            let variance = |c: usize| {
                let v = self.spread_of(mean_dn, c);
                v.free + v.fixed
            };
            let all: f32 = (0..3).map(|from| shared[channel][from] * variance(from)).sum();
            // Means over blocks keep theirs: chroma is averaged within them.
            let share = all / variance(channel).max(1e-9);
            (left.pixel, left.steady) = (share * left.pixel, share * left.steady);
        }
        left
    }

    /// What compression leaves of the noise of rows in a channel of a pixel of these mean DN, and in the mean of its
    /// row; all of it without.
    pub fn rows_left(&self, mean_dn: &[f32], channel: usize) -> [f32; 2] {
        self.packed_at(mean_dn, channel).map_or([1.0; 2], |packed| packed.1)
    }

    fn packed_at(&self, mean_dn: &[f32], channel: usize) -> Option<&Packed> {
        let at = (mean_dn[channel] + 0.5).clamp(0.0, 255.0) as usize;
        self.packed.as_ref().map(|t| &t[channel][at])
    }

    /// Spread of a channel of a pixel of these mean DN before compression.
    pub fn spread_of(&self, mean_dn: &[f32], channel: usize) -> Variances {
        let open = self.open_spread_of(mean_dn, channel);
        if self.behind.is_none() {
            return open;
        }
        let kept = share_kept(mean_dn[channel], open.width());
        Variances { free: kept * open.free, row: kept * open.row, fixed: kept * open.fixed }
    }

    /// The same ahead of the ends of what can be delivered, of colours that are made behind the encoding.
    pub(super) fn open_spread_of(&self, mean_dn: &[f32], channel: usize) -> Variances {
        match (&self.behind, &self.coloured) {
            (Some(behind), coloured) => behind.spread(mean_dn, channel, coloured.as_ref()),
            (None, Some(coloured)) => coloured.spread(mean_dn, channel),
            (None, None) => self.spread(mean_dn[channel], channel),
        }
    }

    /// Whether colours that are made behind the encoding have noise that no filter lifts.
    pub(super) fn shows_width_behind(&self) -> bool {
        let lifted = self.mixing.pixel.iter().any(|share| *share > 1.0);
        self.behind.is_some() && !lifted && self.is_noisy()
    }

    /// The same of a grey of so many DN.
    pub fn spread(&self, mean_dn: f32, channel: usize) -> Variances {
        self.by_dn
            .as_ref()
            .map_or_else(Variances::default, |t| t[channel][(mean_dn + 0.5).clamp(0.0, 255.0) as usize])
    }

    /// What makes each colour of all three behind the encoding, and what takes that back: `[of][from]`; nothing where
    /// nothing does, or nothing is noisy.
    pub fn colours_behind(&self) -> Option<[&[[f32; 3]; 3]; 2]> {
        self.behind.as_ref().map(|behind| [&behind.weights, &behind.back])
    }

    /// Which colours of the sensor give each colour its noise; nothing where that is its own alone.
    pub fn sources(&self) -> Option<Sources> {
        Sources::of(&self.colors, self.whole, self.origins)
    }

    /// Whether there is any noise.
    pub fn is_noisy(&self) -> bool {
        self.shift.is_some()
    }

    /// From a linear value before the noise to the one that is encoded, of a grey: factor and term.
    fn to_value(&self, channel: usize) -> [f32; 2] {
        self.sensor[channel].map(|v| v * self.whole[channel])
    }

    /// DN per unit of the linear value before the noise, where the mean is `dn`; 0 where clipped.
    pub fn slope_at(&self, dn: f32, channel: usize) -> f32 {
        if dn >= 254.9 {
            return 0.0;
        }
        let table = &self.tables[channel];
        let i = table.partition_point(|&v| v <= dn).clamp(1, TABLE);
        (table[i] - table[i - 1]) * TABLE as f32 * self.to_value(channel)[0]
    }

    /// The linear value before the noise whose noise-free value is `dn`.
    pub fn decode(&self, dn: f32, channel: usize) -> f32 {
        let table = &self.tables[channel];
        let i = table.partition_point(|&v| v <= dn).clamp(1, TABLE);
        let (a, b) = (table[i - 1], table[i]);
        let encoded = ((i - 1) as f32 + ((dn - a) / (b - a).max(1e-9)).clamp(0.0, 1.0)) / TABLE as f32;
        let [factor, term] = self.to_value(channel);
        (encoded - term) / factor.max(1e-6)
    }

    /// The steps of the converter, linear values before the noise; 0 without one.
    pub fn step_linear(&self, channel: usize) -> f32 {
        self.step / self.sensor[channel][0].abs().max(1e-6)
    }

    /// Whether delivered values are the converter's, each encoded on its own.
    pub fn keeps_steps(&self) -> bool {
        self.has_own_colors() && self.mixing == Mixing::NONE && self.encoding_is_last
    }

    /// Whether delivered noise is that of the sensor, bent and mixed with that of other pixels, and no more.
    pub fn only_mixes(&self) -> bool {
        self.has_own_colors() && self.only_mixed
    }

    /// Whether a converter's steps are so coarse that they are seen one by one.
    pub fn is_coarse(&self) -> bool {
        self.step * MOST_STEPS >= 1.0
    }

    /// A noise-free delivered value, DN, in steps of the converter above its darkest value.
    pub fn in_steps(&self, dn: f32, channel: usize) -> f32 {
        let [factor, term] = self.sensor[channel];
        (self.decode(dn, channel) * factor + term) / self.step
    }

    /// Variance of noise ahead of the converter whose variance behind it is that, both in squares of the linear value
    /// before the noise.
    pub fn unrounded(&self, variance: f64) -> f64 {
        if self.step == 0.0 {
            return variance;
        }
        let step = f64::from(self.step / self.sensor[1][0].abs().max(1e-6));
        let behind = |ahead: f64| ahead + step * step * f64::from(rounding((ahead.sqrt() / step) as f32));
        let (mut low, mut high) = (0.0, variance);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if behind(middle) < variance { low = middle } else { high = middle }
        }
        low
    }

    /// DN of green of a linear value before the noise, without it.
    pub fn dn_of(&self, linear: f32) -> f32 {
        let [factor, term] = self.to_value(1);
        self.plain(factor * linear + term, 1)
    }

    /// What noise adds to the mean and how wide it spreads, by the sensor's value: the integral over a normal
    /// distribution, clipping and encoding included.
    fn under_noise(&self, channel: usize) -> Vec<(f32, Variances)> {
        let weights: Vec<f32> =
            (-POINTS..=POINTS).map(|i| (-0.5 * (STEP * i as f32).powi(2)).exp()).collect();
        let total: f32 = weights.iter().sum();
        let whole = self.whole[channel];
        (0..COARSE)
            .map(|i| {
                let sensor = sensor_at(i);
                let parts = self.parts(sensor, channel);
                let linear2 = parts.free + parts.row + parts.fixed;
                let sigma = linear2.sqrt();
                let (mut mean, mut square) = (0.0, 0.0);
                for (k, weight) in (-POINTS..=POINTS).zip(&weights) {
                    let v = self.plain(whole * (sensor + STEP * k as f32 * sigma), channel);
                    mean += weight * v;
                    square += weight * v * v;
                }
                (mean, square) = (mean / total, square / total);
                let share = (square - mean * mean).max(0.0) / linear2.max(1e-12);
                let [gain, row_gain] = [self.mixing.pixel[channel], self.mixing.row[channel]];
                let spread = Variances {
                    free: gain * share * parts.free,
                    row: row_gain * share * parts.row,
                    fixed: gain * share * parts.fixed,
                };
                (mean - self.plain(whole * sensor, channel), spread)
            })
            .collect()
    }

    /// Variances of a colour of a grey of that sensor value, in units of the grey's: what other colours are mixed in
    /// counts.
    fn parts(&self, sensor: f32, channel: usize) -> Variances {
        let whole = self.whole[channel];
        let own = |from: usize| (self.colors[channel][from] / whole, self.sensor_noise(sensor, from));
        let of = (0..3).filter(|&from| self.colors[channel][from] != 0.0);
        mixed_colors(of.map(own))
    }

    fn coloured(&self) -> Option<Coloured> {
        Coloured::of(&Conversion {
            weights: self.colors,
            whole: self.whole,
            origins: self.origins,
            mixing: &self.mixing,
            encoded: &|value, channel| self.plain(value, channel),
            noise: &|sensor, channel| self.sensor_noise(sensor, channel),
        })
    }

    /// Noise of a value of the sensor: with the factor that it has behind the noise, and what rounding adds.
    fn sensor_noise(&self, sensor: f32, channel: usize) -> Variances {
        let [factor, term] = self.sensor[channel];
        let mut v = self.noise[channel].at((sensor - term) / factor);
        if self.step > 0.0 {
            let step = self.step / factor.abs();
            v.free += step * step * rounding((v.free + v.row + v.fixed).sqrt() / step);
        }
        Variances::default().plus(factor * factor, &v)
    }

    fn spread_by_dn(&self, table: &[(f32, Variances)], channel: usize) -> Vec<Variances> {
        let mean = |i: usize| self.plain(self.whole[channel] * sensor_at(i), channel) + table[i].0;
        let between = |(at, f): (usize, f32)| {
            let (b, a) = (table[at].1, table[at.saturating_sub(1)].1);
            Variances::default().plus(1.0 - f, &a).plus(f, &b)
        };
        places_by_dn(mean).map(between).collect()
    }
}

/// Variance that rounding adds to noise of that width, in squares of a step: the mean over where values lie between two
/// steps.
fn rounding(wide: f32) -> f32 {
    let places = [0.0625, 0.1875, 0.3125, 0.4375];
    (places.map(|at| rounded_variance(at, wide)).iter().sum::<f32>() / 4.0 - wide * wide).max(0.0)
}
