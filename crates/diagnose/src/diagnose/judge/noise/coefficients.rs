//! Noise ahead of a JPEG file. A strong compression removes most of it from the pixels, and what is left says little of
//! what was there. The coefficients that the file holds say it: each is a whole number of steps, and how often one goes
//! to another step than the simulated one tells the noise, as behind a coarse converter (see [`Steps`]).

use std::borrow::Borrow;
use std::collections::BTreeMap;

use rayon::prelude::*;

use super::steps::{Steps, Told as Noise, most_likely};
use super::tables::{BINS, Tables, bin_of};
use crate::diagnose::dct::{AREA, Dct, SIDE, luma_block, steps};
use crate::diagnose::evidence::Evidence;
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::settings::settings_of;
use crate::diagnose::expect::tone::{Tone, kept_of_luma};
use crate::diagnose::grain::Grain;
use shutterbug::plane::Plane;
use shutterbug::plane::stats::LUMA;

/// Least step of a coefficient, DN: delivered values are rounded behind the file, and smaller steps drown in that.
const LEAST_STEP_DN: f32 = 3.0;
/// Variance of a coefficient of brightness that rounding adds ahead of the file, DN^2: of three colours, of brightness,
/// and of the coefficient itself.
const ROUNDED2: f64 = 0.2;
/// Steps and shares whose logarithms differ by less are put together.
const ALIKE: f64 = 0.05;
/// Narrowest and widest noise that is looked for, linear.
const WIDTHS: [f64; 2] = [2e-4, 0.3];
/// Least share that is told from none: such noise drowns in rounding.
const LEAST_SHARE: f64 = 1e-4;
/// Values of which a coefficient of a row sums the shared noise.
const SHARED: f64 = SIDE as f64;

/// Whether the noise in the file is that of the sensor, mixed with that of other pixels at most: then it is known how
/// it lies in the coefficients.
pub(super) fn shows_coefficients(theta: &Theta) -> bool {
    theta.is_on(P::Quality) && Tone::new(&theta.with(P::Quality, 0.0)).only_mixes()
}

/// What coefficients tell.
pub(super) struct Told {
    /// Per bin: linear value, variance of single values, number of values that would tell it as well.
    pub total: Vec<[f64; 3]>,
    /// Variance that a row shares.
    pub row2: f64,
}

/// Coefficients by the logarithms of their step, as a linear value of single pixels, and of the share that the noise
/// besides has in them; and by how much wider the step at zero is, thousandths of a step.
type ByStep = BTreeMap<[i32; 3], Steps>;

/// How much further from zero thresholds lie than half way between two steps, DN, by the width of a step. libjpeg
/// rounds a coefficient as it is, others round what is left without its fraction: that is never half an odd number.
const ENCODERS: [fn(f32) -> f32; 2] = [|_| 0.0, |step| if step % 2.0 == 1.0 { 0.5 } else { 0.0 }];

/// The coefficients of blocks of one brightness, by encoder.
#[derive(Clone, Default)]
struct Bin {
    own: [ByStep; 2],
    /// Those that hold the noise of rows as well.
    rows: [ByStep; 2],
    /// Sums over blocks: number, linear value, and DN^2 by linear^2 of single values and of rows.
    sums: [f64; 4],
}

impl Bin {
    fn append(&mut self, other: Self) {
        let pairs = self.own.iter_mut().zip(other.own).chain(self.rows.iter_mut().zip(other.rows));
        for (to, from) in pairs {
            from.iter().for_each(|(step, steps)| to.entry(*step).or_default().append(steps));
        }
        self.sums.iter_mut().zip(other.sums).for_each(|(a, b)| *a += b);
    }

    fn mean(&self, i: usize) -> f64 {
        self.sums[i] / self.sums[0].max(1.0)
    }

    /// Variance of rounding ahead of the file, as a linear value of single pixels.
    fn rounding(&self) -> f64 {
        ROUNDED2 / self.mean(2)
    }

    /// Noise of single values with that of rounding, linear, and the logarithm of its likelihood.
    fn own_noise(&self, encoder: usize) -> (Option<Noise>, f64) {
        let part = |(&[step, share, wider], seen): (&[i32; 3], _)| {
            let own = (value_of(share) - 1.0) * self.rounding();
            Part { step: value_of(step), own, wider: 1e-3 * f64::from(wider), seen }
        };
        let parts: Vec<Part> = self.own[encoder].iter().map(part).collect();
        let noise = most_likely(WIDTHS, |log_width| likelihood(&parts, log_width));
        (noise, likelihood(&parts, noise.map_or(WIDTHS[0].ln(), |n| 0.5 * n.variance.ln())))
    }
}

/// A block as it was simulated ahead of the file, and as it is seen behind it.
struct Block {
    linear: f32,
    dn: f32,
    /// Of brightness by a linear value: root of the sum of squares over colours, and the sum.
    slopes: [f32; 2],
    simulated: [f32; AREA],
    seen: [f32; AREA],
}

/// The frames whose blocks are looked at.
pub(super) struct Blocks<'a> {
    pub evidence: &'a Evidence,
    /// Places.
    pub frames: &'a [usize],
    /// By frame, where the simulated picture is flat.
    pub flats: &'a [Vec<bool>],
    pub tables: &'a Tables,
    pub tone: &'a Tone,
    /// How the noise ahead of the file lies in the coefficients.
    pub shares: &'a Shares,
}

/// Variance of each coefficient of brightness, over that of noise that is white and new in every value of the sensor:
/// of noise of single values, and of that which a row shares.
pub(super) struct Shares {
    own: [f64; AREA],
    rows: [f64; AREA],
}

impl Shares {
    pub(super) fn of(theta: &Theta) -> Self {
        let grain = Grain::of(&settings_of(theta));
        let [own, rows] = kept_of_luma(theta);
        Self {
            own: std::array::from_fn(|i| (own * f64::from(grain.own(0, i))).max(LEAST_SHARE)),
            rows: std::array::from_fn(|i| (rows * f64::from(grain.rows(0, i))).max(LEAST_SHARE)),
        }
    }
}

impl Blocks<'_> {
    fn block(&self, dct: &Dct, f: usize, [x0, y0]: [usize; 2], ahead: &Plane<f32>) -> Option<Block> {
        let real: &Plane<f32> = &self.evidence.frames[self.frames[f]].dn;
        let mut color = [0.0f32; 3];
        for i in 0..AREA {
            let at = (y0 + i / SIDE) * real.width + x0 + i % SIDE;
            let [r, m] = [real, ahead].map(|p| &p.data[3 * at..3 * at + 3]);
            let inside =
                r.iter().all(|v| *v > 0.0 && *v < 255.0) && m.iter().all(|v| (12.0..=240.0).contains(v));
            if !self.flats[f][at] || !inside {
                return None;
            }
            color.iter_mut().zip(m).for_each(|(sum, v)| *sum += v / AREA as f32);
        }
        let steep: [f32; 3] = std::array::from_fn(|c| LUMA[c] * self.tables.slopes[color[c] as usize][c]);
        let own2: f32 = steep.iter().map(|s| s * s).sum();
        let linear =
            (0..3).map(|c| steep[c] * steep[c] * self.tables.decode(color[c], c)).sum::<f32>() / own2;
        let [simulated, seen] = [ahead, real].map(|p| dct.forward(&luma_block(p, [x0, y0])));
        let slopes = [own2.sqrt(), steep.iter().sum()];
        Some(Block { linear, dn: self.tone.dn_of(linear), slopes, simulated, seen })
    }

    /// What the rows of blocks from `y0` on show in all frames.
    fn strip<M: Borrow<Plane<f32>>>(&self, y0: usize, table: &[f32; AREA], ahead: &[M]) -> Vec<Bin> {
        let (dct, mut bins) = (Dct::new(), vec![Bin::default(); BINS]);
        let width = ahead[0].borrow().width;
        let places = (0..ahead.len()).flat_map(|f| (0..width / SIDE).map(move |i| (f, i * SIDE)));
        for (f, x0) in places {
            let Some(block) = self.block(&dct, f, [x0, y0], ahead[f].borrow()) else { continue };
            let bin = &mut bins[bin_of(block.dn)];
            let [own, row] = block.slopes.map(f64::from);
            let sums = [1.0, f64::from(block.linear), own * own, row * row];
            bin.sums.iter_mut().zip(sums).for_each(|(a, b)| *a += b);
            // The first one is the block's mean, which says more of the model than of the noise.
            for i in (1..AREA).filter(|i| table[*i] >= LEAST_STEP_DN) {
                let step = f64::from(table[i] / block.slopes[0]);
                // Rounding, or the noise of single values, is beside what a coefficient tells of.
                let (to, told, beside) = match i % SIDE {
                    0 => (&mut bin.rows, self.shares.rows[i], self.shares.own[i]),
                    _ => (&mut bin.own, self.shares.own[i], 1.0),
                };
                let [step, share] = [step / told.sqrt(), beside / told].map(key_of);
                let seen = block.seen[i] / table[i];
                for (to, further) in to.iter_mut().zip(ENCODERS) {
                    let (simulated, wider) = (block.simulated[i] / table[i], further(table[i]) / table[i]);
                    if wider > 0.0 && simulated.abs() < 0.5 + wider {
                        let key = [step, share, (1e3 * wider).round() as i32];
                        to.entry(key).or_default().add_at_zero(simulated, seen, wider);
                    } else {
                        let rounded = simulated - wider * simulated.signum();
                        to.entry([step, share, 0]).or_default().add(rounded, seen);
                    }
                }
            }
        }
        bins
    }

    /// What the coefficients tell of the noise; nothing where no block is flat enough or all steps are small.
    /// `ahead`: the simulated frames before the file.
    pub(super) fn told<M: Borrow<Plane<f32>> + Sync>(&self, theta: &Theta, ahead: &[M]) -> Option<Told> {
        let table = steps(theta.get(P::Quality) as u8, false);
        let height = ahead[0].borrow().height;
        let strips: Vec<Vec<Bin>> =
            (0..height / SIDE).into_par_iter().map(|i| self.strip(i * SIDE, &table, ahead)).collect();
        let mut bins = vec![Bin::default(); BINS];
        strips.into_iter().for_each(|strip| bins.iter_mut().zip(strip).for_each(|(a, b)| a.append(b)));
        bins.retain(|b| !b.own[0].is_empty());
        let noises: Vec<[(Option<Noise>, f64); 2]> =
            bins.par_iter().map(|bin| [0, 1].map(|encoder| bin.own_noise(encoder))).collect();
        let total = |encoder: usize| noises.iter().map(|n| n[encoder].1).sum::<f64>();
        let encoder = usize::from(total(1) > total(0));
        let own = |noise: &[(Option<Noise>, f64); 2], bin: &Bin| {
            noise[encoder].0.map_or(bin.rounding(), |n| n.variance)
        };
        let seen: Vec<(&Bin, f64)> = bins.iter().zip(&noises).map(|(bin, n)| (bin, own(n, bin))).collect();
        let row2 = row_variance(&seen, encoder);
        // Noise that takes no coefficient to another step is not known.
        let known = |(bin, noise): (&Bin, &[(Option<Noise>, f64); 2])| {
            let noise = noise[encoder].0.filter(|n| n.count >= 1.0)?;
            let variance = self.tone.unrounded((noise.variance - bin.rounding()).max(0.0));
            Some([bin.mean(1).max(0.0), variance, noise.count])
        };
        let total = bins.iter().zip(&noises).filter_map(known).collect();
        (!seen.is_empty()).then_some(Told { total, row2 })
    }
}

/// Coefficients of one step, and the variance that they have besides what is looked for. Both as linear values.
struct Part<'a> {
    step: f64,
    own: f64,
    /// By how much what goes to zero reaches further, steps.
    wider: f64,
    seen: &'a Steps,
}

/// Logarithm of the likelihood of noise of a width, given as its logarithm.
fn likelihood(parts: &[Part], log_width: f64) -> f64 {
    let variance = (2.0 * log_width).exp();
    parts.iter().map(|p| p.seen.likelihood((p.own + variance).max(0.0).sqrt() / p.step, p.wider)).sum()
}

/// Variance that rows share, as a linear value, from bins with the variance of their own noise.
fn row_variance(bins: &[(&Bin, f64)], encoder: usize) -> f64 {
    let mut parts: Vec<Part> = Vec::new();
    for (bin, own) in bins {
        // Eight values of a row add up in its coefficient, in all colours alike.
        let scale = (bin.mean(2) / (SHARED * bin.mean(3))).sqrt();
        let part = |(&[step, share, wider], seen): (&[i32; 3], _)| {
            let own = value_of(share) * own * scale * scale;
            Part { step: value_of(step) * scale, own, wider: 1e-3 * f64::from(wider), seen }
        };
        parts.extend(bin.rows[encoder].iter().map(part));
    }
    most_likely(WIDTHS, |log_width| likelihood(&parts, log_width)).map_or(0.0, |told| told.variance)
}

fn key_of(value: f64) -> i32 {
    (value.ln() / ALIKE).round() as i32
}

fn value_of(key: i32) -> f64 {
    (f64::from(key) * ALIKE).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::vector::PLACES;
    use crate::diagnose::judge::noise::{NoiseData, ahead_of_steps};
    use shutterbug::chain::Settings;
    use shutterbug::chain::rng::random_uniform;
    use shutterbug::effects::jpeg::compressed;
    use shutterbug::reference::moments::mixed;

    const SIDES: [usize; 2] = [320, 240];

    fn normal(at: [u32; 2], key: u32) -> f32 {
        let u = random_uniform(at, 0, key, [3, 4]);
        (-2.0 * u[0].max(1e-9).ln()).sqrt() * (std::f32::consts::TAU * u[1]).cos()
    }

    /// Noise that is measured of a frame with that of single values and of rows, linear, behind a file.
    fn measured(noise: [f32; 2], quality: u8) -> NoiseData {
        measured_behind(&Theta::neutral(), noise, quality)
    }

    /// The same behind the filters of `theta` as well.
    fn measured_behind(theta: &Theta, [own, rows]: [f32; 2], quality: u8) -> NoiseData {
        let filters = settings_of(theta);
        let theta = theta.with(P::Quality, f64::from(quality));
        let tone = Tone::new(&theta.with(P::Quality, 0.0));
        let mean = Plane::from_fn(SIDES[0], SIDES[1], |x, y| {
            // With texture: what rounding does to a smooth slope is no noise, and comes to a DN in a coefficient.
            let v = 60.0 + 0.3 * x as f32 + 0.2 * y as f32 + 1.5 * normal([x as u32, y as u32], 9);
            [v, 0.9 * v, 1.05 * v]
        });
        let real = Plane::from_fn(SIDES[0], SIDES[1], |x, y| {
            let row = rows * normal([y as u32, 7], 1);
            [0, 1, 2].map(|c| {
                let dn = mean.pixel(x, y)[c];
                let noise = row + own * normal([x as u32, y as u32], 2 + c as u32);
                dn + noise * tone.slope_at(dn, c)
            })
        });
        let [mean, real] = [mean, real].map(|picture| filtered(&picture, &filters));
        let real = Plane { data: real.data.iter().map(|v| v.round().clamp(0.0, 255.0)).collect(), ..real };
        let behind = compressed(&mean, quality);
        let real = Evidence::of_one(compressed(&real, quality));
        assert!(ahead_of_steps(&theta).is_some());
        NoiseData::measure(&real, &[0], &[behind], Some(&[mean]), &theta, None)
    }

    /// A picture, DN, behind what mixes its pixels.
    fn filtered(picture: &Plane<f32>, settings: &Settings) -> Plane<f32> {
        let scaled = |p: &Plane<f32>, by: f32| Plane { data: p.data.iter().map(|v| by * v).collect(), ..*p };
        scaled(&mixed(&scaled(picture, 1.0 / 255.0), settings), 255.0)
    }

    fn own(data: &NoiseData) -> f64 {
        let [sum, n] = data.total.iter().fold([0.0; 2], |[s, n], b| [s + b[1] * b[2], n + b[2]]);
        (sum / n.max(1e-9)).sqrt()
    }

    #[test]
    fn a_strong_compression_tells_the_noise_ahead_of_it() {
        for (truth, quality) in [(0.012f32, 59), (0.03, 59), (0.03, 26), (0.05, 40), (0.008, 88)] {
            let seen = own(&measured([truth, 0.0], quality)) / f64::from(truth);
            assert!((seen - 1.0).abs() < 0.02, "{truth} ahead of {quality}: {seen} of it");
        }
        for quality in [26, 59] {
            let data = measured([0.0, 0.0], quality);
            assert!(own(&data) < 2e-3, "control: {} of no noise", own(&data));
        }
    }

    #[test]
    fn noise_that_filters_have_mixed_is_told_ahead_of_the_file() {
        let of = |effect: &str, name: &str| {
            PLACES.iter().copied().find(|p| p.spec().effect == effect && p.spec().name == name).expect("one")
        };
        let soft = Theta::neutral()
            .with(of("noise_reduction", "luma_sigma_px"), 0.7)
            .with(of("noise_reduction", "chroma_sigma_px"), 1.3);
        let sharp = Theta::neutral().with(P::Sharpen, 0.8).with(P::Radius, 1.0);
        let shared = soft.with(P::Chroma, 1.0);
        for (theta, truth, quality) in [(&soft, 0.03f32, 80), (&sharp, 0.02, 60), (&shared, 0.04, 70)] {
            let seen = own(&measured_behind(theta, [truth, 0.0], quality)) / f64::from(truth);
            assert!((seen - 1.0).abs() < 0.03, "{truth} ahead of {theta:?}, {quality}: {seen} of it");
        }
    }

    #[test]
    fn noise_of_rows_is_told_apart_from_that_of_single_values() {
        for (truth, quality) in [([0.0f32, 0.016], 59), ([0.01, 0.02], 40)] {
            let data = measured(truth, quality);
            let seen = data.row2.sqrt() / f64::from(truth[1]);
            // 240 rows tell it to 5 %.
            assert!((seen - 1.0).abs() < 0.15, "{truth:?} ahead of {quality}: {seen} of it");
        }
        let none = measured([0.02, 0.0], 59);
        assert!(none.row2.sqrt() < 2e-3, "control: {} of no noise of rows", none.row2.sqrt());
    }
}
