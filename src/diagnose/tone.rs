//! What a sensor's value becomes when it is encoded, under the noise that it has: mean and spread of the delivered value.
//! Noise that is clipped or bent by the encoding moves the mean too, so a model of values needs the noise as well.

use super::discrepancy::{MIXED_ERROR, SPREAD_ERROR};
use super::mixing::{mixed, shared};
use super::model::{P, Theta};
use super::packing::{Left, Packing};
use crate::plane::srgb_encode;

/// Entries of the table of encoded values per unit: linear interpolation is within 0.01 DN above linear 0.001.
const TABLE: usize = 8192;
/// Entries of the tables of what noise does.
const COARSE: usize = 768;
/// Roots of the sensor's values in the tables of noise (the sign goes along): from here on, a span of [`SPAN`]. Roots,
/// because encoding and clipping bend most near black.
const LOW: f32 = -0.45;
/// See [`LOW`].
const SPAN: f32 = 1.64;
/// Points of the integral over the noise, each side of the mean, and their distance in standard deviations.
const POINTS: i32 = 12;
/// See [`POINTS`].
const STEP: f32 = 0.3;

/// Variances of one value, DN^2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Variances {
    /// New in every pixel and frame.
    pub free: f32,
    /// The same for a whole row.
    pub row: f32,
    /// The same in every frame.
    pub fixed: f32,
}

/// Parameters of the noise on linear values before the black level.
#[derive(Clone, Copy, Debug)]
struct Noise {
    inverse_full_well: f32,
    read2: f32,
    row2: f32,
    dsnu2: f32,
    prnu2: f32,
}

impl Noise {
    fn new(theta: &Theta) -> Self {
        let square = |p: P| (theta.get(p) * theta.get(p)) as f32;
        Self {
            inverse_full_well: theta.get(P::Shot) as f32,
            read2: square(P::Read),
            row2: square(P::Row),
            dsnu2: square(P::Dsnu),
            prnu2: square(P::Prnu),
        }
    }

    fn any(&self) -> bool {
        self.inverse_full_well + self.read2 + self.row2 + self.dsnu2 + self.prnu2 > 0.0
    }

    /// Variances of the linear value `x`: free, row, fixed.
    fn at(&self, x: f32) -> [f32; 3] {
        let x = x.max(0.0);
        [x * self.inverse_full_well + self.read2, self.row2, self.dsnu2 + self.prnu2 * x * x]
    }
}

/// Everything that happens to a value on its own.
pub(super) struct Tone {
    /// Encoded DN of linear values 0 to 1, and one more entry to interpolate to.
    table: Box<[f32; TABLE + 2]>,
    wb: [f32; 3],
    gain: f32,
    black: f32,
    veil: f32,
    veil_level: f32,
    /// By channel and sensor value: what noise adds to the mean.
    shift: Option<Box<[[f32; COARSE]; 3]>>,
    /// By channel and whole DN of the mean.
    by_dn: Option<[Vec<Variances>; 3]>,
    /// By channel and whole DN of the mean: what compression leaves of that.
    left: Option<[Vec<Left>; 3]>,
    /// By channel: what of the noise means over blocks and lines have where pixels are mixed.
    mixed: Option<[Left; 3]>,
    /// Where pixels share their chroma: what of each colour's variance each colour has.
    shared: Option<[[f32; 3]; 3]>,
}

impl Tone {
    pub(super) fn new(theta: &Theta) -> Self {
        let exponent = theta.get(P::Gamma) as f32;
        let encode = |i: usize| {
            let value = srgb_encode(i as f32 / TABLE as f32);
            255.0 * if exponent == 1.0 { value } else { value.powf(exponent) }
        };
        let mut tone = Self {
            table: Box::new(std::array::from_fn(encode)),
            wb: [theta.get(P::WbR) as f32, 1.0, theta.get(P::WbB) as f32],
            gain: theta.get(P::Gain) as f32,
            black: theta.get(P::Black) as f32,
            veil: theta.get(P::Veil) as f32,
            veil_level: (theta.get(P::Veil) * theta.get(P::Level)) as f32,
            shift: None,
            by_dn: None,
            left: None,
            mixed: mixed(theta),
            shared: shared(theta),
        };
        let noise = Noise::new(theta);
        if noise.any() {
            let gains = noise_gain(theta);
            let row_gain = row_gain(theta);
            let tables = [0, 1, 2].map(|c| tone.under_noise(&noise, c, [gains[c], row_gain[c]]));
            let by_dn = [0, 1, 2].map(|c| tone.spread_by_dn(&tables[c], c));
            if theta.is_on(P::Quality) {
                let packing = Packing::of(theta.get(P::Quality) as u8);
                let left = |v: &Variances| packing.left(v.free + v.fixed);
                tone.left = Some([0, 1, 2].map(|c| by_dn[c].iter().map(left).collect()));
            }
            tone.by_dn = Some(by_dn);
            tone.shift = Some(Box::new([0, 1, 2].map(|c| std::array::from_fn(|i| tables[c][i].0))));
        }
        tone
    }

    /// Linear value on the sensor, behind the black level, of radiance `linear` of which the lens lets `pass` through, and
    /// which flickers by `light` behind the glare.
    #[inline]
    pub(super) fn sensor(&self, linear: f32, pass: f32, light: f32) -> f32 {
        let seen = ((1.0 - self.veil) * linear * pass + self.veil_level) * light;
        self.black + (1.0 - self.black) * self.gain * seen
    }

    #[inline]
    fn plain(&self, sensor: f32, channel: usize) -> f32 {
        let at = (self.wb[channel] * sensor).clamp(0.0, 1.0) * TABLE as f32;
        let i = place(at).min(TABLE);
        let f = at - i as f32;
        self.table[i] * (1.0 - f) + self.table[i + 1] * f
    }

    /// Mean delivered value, DN, of a sensor's value.
    #[inline]
    pub(super) fn encode(&self, sensor: f32, channel: usize) -> f32 {
        let plain = self.plain(sensor, channel);
        match &self.shift {
            None => plain,
            Some(shift) => {
                let root = sensor.abs().sqrt().copysign(sensor);
                let at = ((root - LOW) / SPAN).clamp(0.0, 1.0) * (COARSE - 1) as f32;
                let i = place(at).min(COARSE - 2);
                let f = at - i as f32;
                plain + shift[channel][i] * (1.0 - f) + shift[channel][i + 1] * f
            }
        }
    }

    /// What mixing, subsampling and compression leave of the spread of a channel of a pixel of these mean DN; all of it without
    /// them.
    pub(super) fn left(&self, mean_dn: &[f32], channel: usize) -> Left {
        let at = (mean_dn[channel] + 0.5).clamp(0.0, 255.0) as usize;
        let mut left = self.left.as_ref().map_or(Left::ALL, |t| t[channel][at]);
        if let Some(mixed) = &self.mixed {
            left = left.times(&mixed[channel]);
        }
        if let Some(shared) = &self.shared {
            let variance = |c: usize| {
                let v = self.spread(mean_dn[c], c);
                v.free + v.fixed
            };
            let all: f32 = (0..3).map(|from| shared[channel][from] * variance(from)).sum();
            // Means over blocks keep theirs: chroma is averaged within them.
            left.pixel *= all / variance(channel).max(1e-9);
        }
        left
    }

    /// Spread about a mean of so many DN before compression.
    pub(super) fn spread(&self, mean_dn: f32, channel: usize) -> Variances {
        self.by_dn
            .as_ref()
            .map_or_else(Variances::default, |t| t[channel][(mean_dn + 0.5).clamp(0.0, 255.0) as usize])
    }

    /// How well the variance of noise is known, as a part of it.
    pub(super) fn uncertainty(&self) -> f32 {
        let mixes = self.mixed.is_some() || self.shared.is_some() || self.left.is_some();
        if mixes { MIXED_ERROR } else { SPREAD_ERROR }
    }

    /// Whether there is any noise.
    pub(super) fn is_noisy(&self) -> bool {
        self.shift.is_some()
    }

    /// DN per unit of the linear value before the black level, where the mean is `dn`; 0 where clipped.
    pub(super) fn slope_at(&self, dn: f32, channel: usize) -> f32 {
        if dn >= 254.9 {
            return 0.0;
        }
        let i = self.table.partition_point(|&v| v <= dn).clamp(1, TABLE);
        (self.table[i] - self.table[i - 1]) * TABLE as f32 * self.wb[channel] * (1.0 - self.black)
    }

    /// The linear value before the black level whose noise-free value is `dn`.
    pub(super) fn decode(&self, dn: f32, channel: usize) -> f32 {
        let i = self.table.partition_point(|&v| v <= dn).clamp(1, TABLE);
        let (a, b) = (self.table[i - 1], self.table[i]);
        let encoded = ((i - 1) as f32 + ((dn - a) / (b - a).max(1e-9)).clamp(0.0, 1.0)) / TABLE as f32;
        (encoded / self.wb[channel].max(1e-6) - self.black) / (1.0 - self.black)
    }

    /// DN of green of a linear value before the black level, without noise.
    pub(super) fn dn_of(&self, linear: f32) -> f32 {
        self.plain(self.black + (1.0 - self.black) * linear, 1)
    }

    /// What noise adds to the mean and how wide it spreads, by the sensor's value: the integral over a normal
    /// distribution, clipping and encoding included.
    fn under_noise(
        &self,
        noise: &Noise,
        channel: usize,
        [gain, row_gain]: [f32; 2],
    ) -> Vec<(f32, Variances)> {
        let keep = 1.0 - self.black;
        let weights: Vec<f32> =
            (-POINTS..=POINTS).map(|i| (-0.5 * (STEP * i as f32).powi(2)).exp()).collect();
        let total: f32 = weights.iter().sum();
        (0..COARSE)
            .map(|i| {
                let sensor = sensor_at(i);
                let parts = noise.at((sensor - self.black) / keep).map(|v| v * keep * keep);
                let linear2: f32 = parts.iter().sum();
                let sigma = linear2.sqrt();
                let (mut mean, mut square) = (0.0, 0.0);
                for (k, weight) in (-POINTS..=POINTS).zip(&weights) {
                    let v = self.plain(sensor + STEP * k as f32 * sigma, channel);
                    mean += weight * v;
                    square += weight * v * v;
                }
                (mean, square) = (mean / total, square / total);
                let share = (square - mean * mean).max(0.0) / linear2.max(1e-12);
                let spread = Variances {
                    free: gain * share * parts[0],
                    row: row_gain * share * parts[1],
                    fixed: gain * share * parts[2],
                };
                (mean - self.plain(sensor, channel), spread)
            })
            .collect()
    }

    fn spread_by_dn(&self, table: &[(f32, Variances)], channel: usize) -> Vec<Variances> {
        let mean = |i: usize| {
            let sensor = sensor_at(i);
            self.plain(sensor, channel) + table[i].0
        };
        let mut at = 0;
        (0..256)
            .map(|dn| {
                while at + 1 < COARSE && mean(at) < dn as f32 {
                    at += 1;
                }
                // Between the two places whose means hold the value between them.
                let (b, a) = (table[at].1, table[at.saturating_sub(1)].1);
                let (mb, ma) = (mean(at), mean(at.saturating_sub(1)));
                let f = if mb > ma { ((dn as f32 - ma) / (mb - ma)).clamp(0.0, 1.0) } else { 1.0 };
                let mix = |a: f32, b: f32| a * (1.0 - f) + b * f;
                Variances { free: mix(a.free, b.free), row: mix(a.row, b.row), fixed: mix(a.fixed, b.fixed) }
            })
            .collect()
    }
}

/// The entry of a table at or before a place in it. By way of 32 bits: a float becomes 64 of them, unsigned, in ten times as
/// many instructions, and this is done for every value of every picture.
fn place(at: f32) -> usize {
    at as i32 as usize
}

/// The sensor's value at a place of the tables of noise.
fn sensor_at(place: usize) -> f32 {
    let root = LOW + SPAN * place as f32 / (COARSE - 1) as f32;
    root * root.abs()
}

/// Variance that the noise of rows keeps in a pixel of each colour. It is white down the picture, where sharpening lifts it and
/// demosaicking averages it: red and blue come from their own row in one row of two and from those above and below in the
/// other, green from its own row in every second pixel and half of it from there in the others.
pub(super) fn row_gain(theta: &Theta) -> [f32; 3] {
    let kept = if theta.get(P::Mosaic) >= 1.0 { [0.75, 0.6875, 0.75] } else { [1.0; 3] };
    kept.map(|k| k * row_lift(theta))
}

/// Variance that the noise of rows keeps in the mean of a row over its colours, about rows that are not its neighbours. Behind
/// a Bayer pattern a row with red has 1, 3/4 and 0 of its own noise in the three colours, and 0, 1/8 and 1/2 of each neighbour's.
pub(super) fn row_seen(theta: &Theta) -> f32 {
    let (own, other) = (1.75 / 3.0, 0.625 / 3.0);
    let kept = if theta.get(P::Mosaic) >= 1.0 { own * own + 2.0 * other * other } else { 1.0 };
    kept * row_lift(theta)
}

/// What sharpening makes of noise that is white down the picture.
pub(super) fn row_lift(theta: &Theta) -> f32 {
    let amount = theta.get(P::Sharpen) as f32;
    if amount == 0.0 {
        return 1.0;
    }
    let [centre, square] = bell_of(theta);
    lifted(amount, centre, square)
}

/// What becomes of the variance of white noise v in v + amount (v - soft): `centre` is the weight of a value in its own soft
/// one, `square` the sum of the squares of all weights.
fn lifted(amount: f32, centre: f32, square: f32) -> f32 {
    (1.0 + amount).powi(2) - 2.0 * amount * (1.0 + amount) * centre + amount * amount * square
}

/// Weight of the middle, and sum of the squares of the weights, of the Gaussian that sharpening takes off, along one axis.
fn bell_of(theta: &Theta) -> [f32; 2] {
    let sigma = theta.get(P::Radius) as f32;
    let radius = (4.0 * sigma + 0.5).floor().max(1.0) as i32;
    let bell: Vec<f32> = (-radius..=radius).map(|k| (-0.5 * (k as f32 / sigma).powi(2)).exp()).collect();
    let sum: f32 = bell.iter().sum();
    [1.0 / sum, bell.iter().map(|b| b * b).sum::<f32>() / (sum * sum)]
}

/// Variance that white noise keeps behind the steps that mix pixels: demosaicking averages it, sharpening lifts it.
pub(super) fn noise_gain(theta: &Theta) -> [f32; 3] {
    let mut gain = [1.0f32; 3];
    if theta.get(P::Mosaic) >= 1.0 {
        // Own pixels keep their variance, those between two keep a half, those between four a quarter.
        gain = [0.5625, 0.625, 0.5625];
    }
    let lift = noise_lift(theta);
    gain.map(|g| g * lift)
}

/// What sharpening makes of the variance of white noise.
pub(super) fn noise_lift(theta: &Theta) -> f32 {
    let amount = theta.get(P::Sharpen) as f32;
    if amount == 0.0 {
        return 1.0;
    }
    let [centre, square] = bell_of(theta).map(|v| v * v);
    lifted(amount, centre, square)
}
