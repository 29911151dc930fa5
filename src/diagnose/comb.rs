//! Whether frames have been through JPEG, told from the frames alone: what has, has coefficients at multiples of the steps of
//! its quality, whatever the picture shows and however noisy it was before (Fan and de Queiroz 2003). Noise hides what
//! compression does to a simulated picture, and compression removes noise that the simulation expects; this tells of neither.

use super::dct::{AREA, Dct, SIDE, steps};
use super::evidence::Evidence;
use super::fit::spread_out;

/// Frames that are looked at.
const FRAMES: usize = 4;
/// Standard deviation of a coefficient about its multiple: brightness and the three colours are rounded to whole DN.
const ROUNDING: f32 = 0.4;
/// Least step that shows beside rounding.
const LEAST_STEP: f32 = 3.0;
/// Share of the coefficients that lie anywhere (clipped colours that the decoder has bent).
const ANYWHERE: f32 = 0.1;
/// Least evidence for a quality, nats: in all, and a coefficient.
const LEAST_NATS: [f32; 2] = [50.0, 0.25];

/// The quality of the compression that frames (places) have behind them; none if they have none of these.
pub(super) fn quality(evidence: &Evidence, frames: &[usize]) -> Option<u8> {
    let some = spread_out(frames, FRAMES);
    let coefficients: Vec<[f32; AREA]> =
        some.iter().flat_map(|&at| of_frame(&evidence.frames[at].dn)).collect();
    let mut best: Option<(f32, u8)> = None;
    for quality in 5..=97 {
        let (sum, count) = evidence_for(&coefficients, &steps(quality, false));
        let clear = sum > LEAST_NATS[0] && sum > LEAST_NATS[1] * count;
        if clear && best.is_none_or(|b| sum > b.0) {
            best = Some((sum, quality));
        }
    }
    tracing::debug!("compression: {best:?} (nats, quality) from {} blocks", coefficients.len());
    best.map(|b| b.1)
}

/// Coefficients of the brightness of all whole blocks that nothing has clipped.
fn of_frame(dn: &crate::plane::Plane<f32>) -> Vec<[f32; AREA]> {
    let dct = Dct::new();
    let mut out = Vec::new();
    for y0 in (0..dn.height / SIDE * SIDE).step_by(SIDE) {
        for x0 in (0..dn.width / SIDE * SIDE).step_by(SIDE) {
            let pixel = |i: usize| dn.pixel(x0 + i % SIDE, y0 + i / SIDE);
            if (0..AREA).all(|i| pixel(i).iter().all(|v| (1.0..255.0).contains(v))) {
                let luma = |p: &[f32]| 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2] - 128.0;
                out.push(dct.forward(&std::array::from_fn(|i| luma(pixel(i)))));
            }
        }
    }
    out
}

/// Logarithm of how much likelier coefficients are with these steps than without, and their number. Only those beyond the
/// first half step count: smooth pictures have small coefficients without any compression.
fn evidence_for(coefficients: &[[f32; AREA]], steps: &[f32; AREA]) -> (f32, f32) {
    let (mut sum, mut count) = (0.0f64, 0.0);
    for block in coefficients {
        for (c, step) in block.iter().zip(steps) {
            if *step >= LEAST_STEP && c.abs() > 0.5 * step {
                let off = (c - step * (c / step).round()) / ROUNDING;
                let at = (-0.5 * off * off).exp() * 0.398_942_3 / ROUNDING * step;
                sum += f64::from(((1.0 - ANYWHERE) * at + ANYWHERE).ln());
                count += 1.0;
            }
        }
    }
    (sum as f32, count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::rng::random_bits;
    use crate::plane::Plane;

    /// Edges and noise, rounded.
    fn picture(sigma: f32) -> Plane<f32> {
        Plane::from_fn(96, 64, |x, y| {
            [0u32, 1, 2].map(|c| {
                let bits = random_bits([x as u32, y as u32], c, 9, [3, 4]);
                let noise: f32 = bits.iter().map(|b| *b as f32 / u32::MAX as f32 - 0.5).sum();
                let v = 60.0 + 25.0 * ((x / 9 + y / 7) % 5) as f32 + 0.3 * x as f32;
                (v + 1.73 * sigma * noise).round()
            })
        })
    }

    fn told(dn: &Plane<f32>) -> Option<u8> {
        quality(&Evidence::of_one(dn.clone()), &[0])
    }

    #[test]
    fn a_quality_is_told_with_noise_and_without_and_none_where_there_is_none() {
        for sigma in [0.0, 3.0, 10.0] {
            let plain = picture(sigma);
            assert_eq!(told(&plain), None, "control: noise of {sigma} DN");
            for quality in [30, 62, 82] {
                let packed = super::super::photometric::compressed(&plain, quality);
                assert_eq!(told(&packed), Some(quality), "noise of {sigma} DN");
            }
        }
    }
}
