//! Light comes in whole photons: Poisson on electrons, `full_well_e` at L = 1 (docs/reference/camera.md), new in every
//! frame, independent by pixel and channel. From linear radiance to electrons.
//!
//! Below a mean of 12 electrons the distribution function is inverted by adding up its terms, which is exact to the
//! rounding of an `f32` (2e-7 of probability). Above, its inverse is expanded in the root of the mean, to the third
//! correction: Giles, "Algorithm 955: approximation of the inverse Poisson cumulative distribution function", ACM TOMS
//! 42 (2016), eq. 6 - a Gaussian would miss the skewness and half an electron of the mean. The worst probability of a
//! count is off by less than 1e-4 there (measured in the tests). A pixel's three channels share four random words: a
//! channel with few electrons is uncorrelated with, but not wholly independent of, one with many.

use crate::chain::rng::{normal_of_bits, random_bits, seed_words};
use crate::chain::{
    At, Domain, Effect, Fit, Held, Law, Moments, Noise, Number, Packer, ParamSpec, Parameters, Settings,
    Stage, View, Work,
};
use crate::plane::three;

/// The effect; its values live in [`Settings`].
pub struct ShotNoise;

/// Stream of its random numbers.
pub const STREAM_SHOT_NOISE: u32 = 0x5348;

pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::number("full_well_e", "e-", (0.0, 1e7), 0.0, "electrons at L = 1; 0: no shot noise").fit(
        Fit::by(1e-4)
            .within(0.0, 0.2)
            .held(Held::Inverse)
            .trial(Law::Electrons, 0.014, 0.071)
            .graded(2e-3, 7e-2),
    )];

const FULL_WELL_E: Number = Number::of("shot_noise", SPECS, "full_well_e");

/// Mean counts below this are inverted exactly.
const EXACT_BELOW_E: f32 = 12.0;
/// Counts at a mean of 12 exceed this once in 1e26.
const MAX_COUNT_E: u32 = 64;

/// `e^-x` for 0 <= x <= 12, from sums and products only, so that it rounds alike everywhere.
fn exp_minus(x: f32) -> f32 {
    let k = (x * std::f32::consts::LOG2_E + 0.5).floor();
    let r = (x - k * 0.693_359_4) + k * 2.121_944_4e-4;
    let coefficients = [0.008_333_333, 0.041_666_668, 0.166_666_67, 0.5, 1.0, 1.0];
    let p = coefficients.iter().fold(0.001_388_888_9_f32, |p, c| c - p * r);
    p * f32::from_bits(((127 - k as i32) as u32) << 23)
}

/// Smallest n whose distribution function reaches a uniform number.
fn few(mean: f32, bits: u32) -> f32 {
    let u = (bits as f32 + 0.5) * 2.328_306_4e-10;
    let mut p = exp_minus(mean);
    let (mut reached, mut n) = (p, 0);
    while n < MAX_COUNT_E && u > reached {
        n += 1;
        p = p * mean / n as f32;
        reached += p;
    }
    n as f32
}

/// The count at a normal number.
fn many(mean: f32, w: f32) -> f32 {
    let (root, square) = (mean.sqrt(), w * w);
    let q = mean + root * w + (0.333_333_34 + square * 0.166_666_67);
    let q = q - w * (0.027_777_778 + square * 0.013_888_889) / root;
    let q = q + (-0.019_753_087 + square * (0.008_641_975 + square * 0.003_703_703_7)) / mean;
    q.floor().max(0.0)
}

/// A Poisson number of that mean for each of three channels.
pub fn poisson(mean: [f32; 3], bits: [u32; 4]) -> [f32; 3] {
    let w = normal_of_bits(bits);
    three(|c| if mean[c] < EXACT_BELOW_E { few(mean[c], bits[c]) } else { many(mean[c], w[c]) })
}

/// The function of the same name in `glsl/include/effects/shot_noise.glsl`.
fn shot_noise(value: [f32; 3], at: &At, p: &Parameters) -> [f32; 3] {
    let mean = three(|c| value[c].max(0.0) * p.number(0));
    let bits = random_bits(at.pixel, at.view.frame, STREAM_SHOT_NOISE, seed_words(at.view.seed));
    let electrons = poisson(mean, bits);
    three(|c| electrons[c] * p.number(1))
}

fn noise(settings: &Settings) -> [Noise; 3] {
    let full_well_e = settings.value(FULL_WELL_E);
    [Noise { free: [0.0, 1.0 / full_well_e, 0.0], ..Noise::default() }; 3]
}

impl Effect for ShotNoise {
    fn id(&self) -> &'static str {
        "shot_noise"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::LinearRgb, Domain::Electrons)
    }

    fn moments(&self) -> Moments {
        Moments::Noise(noise)
    }

    fn work(&self) -> Work {
        Work::Pointwise(shot_noise)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        let full_well_e = settings.value(FULL_WELL_E);
        packer.number(full_well_e);
        packer.number(1.0 / full_well_e);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_the_standard_librarys() {
        for i in 0..=12_000 {
            let x = i as f32 / 1000.0;
            let (got, want) = (f64::from(exp_minus(x)), (-f64::from(x)).exp());
            assert!((got - want).abs() <= 5e-7 * want, "{x}: {got} for {want}");
        }
    }

    /// A fine grid of uniform numbers, as random bits.
    fn grid() -> impl Iterator<Item = u32> {
        (0..STEPS).map(|i| (i << 10) + 512)
    }

    const STEPS: u32 = 1 << 22;

    /// Largest error of any count's probability, by the steps of the inverse: the count of every point of the grid.
    fn worst(mean: f64, counts: impl Iterator<Item = f32>) -> f64 {
        let mut got = vec![0.0; 4 * (mean as usize + 32)];
        for count in counts {
            got[count as usize] += 1.0 / f64::from(STEPS);
        }
        let (mut p, mut worst) = ((-mean).exp(), 0.0_f64);
        for (n, got) in got.iter().enumerate() {
            worst = worst.max((got - p).abs());
            p = p * mean / (n as f64 + 1.0);
        }
        worst
    }

    /// Normal number of a uniform one, by bisection of the distribution function.
    fn quantile(bits: u32) -> f32 {
        let u = (f64::from(bits) + 0.5) / 4_294_967_296.0;
        let cdf = |w: f64| {
            // Zelen and Severo, Handbook of Mathematical Functions 26.2.17: 7.5e-8.
            let t = 1.0 / (1.0 + 0.231_641_9 * w.abs());
            let poly = t
                * (0.319_381_530
                    + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
            let tail = (-0.5 * w * w).exp() / (2.0 * std::f64::consts::PI).sqrt() * poly;
            if w > 0.0 { 1.0 - tail } else { tail }
        };
        let (mut low, mut high) = (-7.0, 7.0);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if cdf(middle) < u { low = middle } else { high = middle }
        }
        low as f32
    }

    #[test]
    fn every_count_has_its_probability() {
        for mean in [0.01_f32, 0.3, 1.0, 4.0, 11.9] {
            let error = worst(f64::from(mean), grid().map(|bits| few(mean, bits)));
            assert!(error < 1e-6, "{mean}: {error}");
        }
        // Each takes forty exponentials: found once for all means.
        let normal: Vec<f32> = grid().map(quantile).collect();
        for mean in [12.0_f32, 20.0, 57.0, 300.0] {
            let error = worst(f64::from(mean), normal.iter().map(|w| many(mean, *w)));
            assert!(error < 1e-4, "{mean}: {error}");
            // Control: the Gaussian of the same mean and variance.
            let gaussian = normal.iter().map(|w| (mean + mean.sqrt() * w + 0.5).floor().max(0.0));
            assert!(worst(f64::from(mean), gaussian) > 10.0 * error, "{mean}: {error}");
        }
    }

    #[test]
    fn no_light_no_noise() {
        assert_eq!(poisson([0.0; 3], [u32::MAX; 4]), [0.0; 3]);
        assert_eq!(few(1.0, 0), 0.0);
        assert!(few(11.99, u32::MAX) < MAX_COUNT_E as f32, "the search ends by itself");
    }
}
