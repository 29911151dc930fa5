//! Noise of reading a pixel: normal, independent by pixel and channel, new in every frame (docs/reference/camera.md).
//! Electrons.
//!
//! Real sensors' noise is not wholly new in every frame: `frame_correlation` is the correlation of a pixel's noise with
//! that of the frame before. It is the autoregression n_t = r n_(t-1) + w_t written as the sum of its past, cut off
//! where the weights have fallen below a hundredth: no state is kept, so frames may be asked for in any order. The cost
//! grows with the number of terms: 7 for r = 0.5, 21 for 0.8.

use crate::chain::rng::{random_normal, seed_words};
use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Noise, Number, Packer, ParamSpec, Parameters, Settings, Stage,
    View, Work,
};
use crate::plane::three;

/// The effect; its values live in [`Settings`].
pub struct ReadNoise;

/// Stream of its random numbers.
pub const STREAM_READ_NOISE: u32 = 0x5245;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("sigma", "fraction of full scale", (0.0, 1.0), 0.0, "standard deviation")
        .fit(Fit::by(1e-3).within(0.0, 0.3).trial(Law::Up, 0.004, 0.04).graded(3e-4, 1e-2)),
    ParamSpec::number("frame_correlation", "", (0.0, 0.9), 0.0, "correlation with the frame before")
        .beside(&["sigma"]),
];

const FRAME_CORRELATION: Number = Number::of("read_noise", SPECS, "frame_correlation");
const SIGMA: Number = Number::of("read_noise", SPECS, "sigma");

const PRESENT: u32 = 1;
const CORRELATED: u32 = 2;
/// Weights of the past below this are cut off.
const SMALLEST_WEIGHT: f64 = 0.01;

impl ReadNoise {
    /// Number of frames that add to a frame's noise, itself included.
    fn terms(correlation: f64) -> u32 {
        if correlation == 0.0 { 1 } else { (SMALLEST_WEIGHT.ln() / correlation.ln()).ceil() as u32 + 1 }
    }

    /// Standard deviation of each frame's own share, so that the sum has `sigma`.
    fn weight(sigma: f64, correlation: f64) -> f64 {
        let square: f64 = (0..Self::terms(correlation)).map(|k| correlation.powi(2 * k as i32)).sum();
        sigma / square.sqrt()
    }
}

/// The function of the same name in `glsl/include/effects/read_noise.glsl`.
fn read_noise(value: [f32; 3], at: &At, p: &Parameters) -> [f32; 3] {
    let (mut seen, mut weight) = (value, p.number(0));
    for k in 0..p.bits(2) {
        let frame = at.view.frame.wrapping_sub(k);
        let n = random_normal(at.pixel, frame, STREAM_READ_NOISE, seed_words(at.view.seed));
        seen = three(|c| seen[c] + weight * n[c]);
        weight *= p.number(1);
    }
    seen
}

fn noise(settings: &Settings) -> [Noise; 3] {
    let sigma = settings.value(SIGMA);
    [Noise { free: [sigma * sigma, 0.0, 0.0], ..Noise::default() }; 3]
}

impl Effect for ReadNoise {
    fn id(&self) -> &'static str {
        "read_noise"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::Electrons, Domain::Electrons)
    }

    fn variant(&self, settings: &Settings) -> u32 {
        let get = |of| settings.value(of);
        match (get(SIGMA), get(FRAME_CORRELATION)) {
            (0.0, _) => 0,
            (_, 0.0) => PRESENT,
            _ => PRESENT | CORRELATED,
        }
    }

    fn moments(&self) -> Moments {
        Moments::Noise(noise)
    }

    fn work(&self) -> Work {
        Work::Pointwise(read_noise)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        let get = |of| settings.value(of);
        let correlation = get(FRAME_CORRELATION);
        packer.number(Self::weight(get(SIGMA), correlation));
        packer.number(correlation);
        packer.bits(Self::terms(correlation));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_has_the_variance_and_the_correlation() {
        for correlation in [0.0, 0.3, 0.5, 0.8, 0.9] {
            let terms = ReadNoise::terms(correlation) as i32;
            let weight = ReadNoise::weight(0.02, correlation);
            let sum = |shift: i32| -> f64 {
                (0..terms - shift).map(|k| weight * weight * correlation.powi(2 * k + shift)).sum()
            };
            assert!((sum(0).sqrt() - 0.02).abs() < 1e-12, "{correlation}");
            assert!((sum(1) / sum(0) - correlation).abs() < 1e-3, "{correlation}: {}", sum(1) / sum(0));
        }
        assert_eq!(ReadNoise::weight(0.02, 0.0), 0.02);
    }
}
