//! The depth of the converter, told from the frames alone: where values are rounded before they are encoded, few of the
//! 256 values occur, and they are evenly apart once the encoding is undone, whatever the picture shows and however
//! noisy it was before. What mixes pixels or colours behind the converter fills the places between; nothing is told
//! then.

use crate::diagnose::evidence::{Evidence, spread_out};
use crate::diagnose::expect::model::Theta;
use crate::diagnose::expect::tone::Tone;

/// Frames that are looked at.
const FRAMES: usize = 4;
/// How far a delivered value lies from its even place at most, DN: half by rounding, and a tenth by what the encoding
/// is off.
const OFF_DN: f32 = 0.6;
/// Least evidence, nats: values that were not rounded lie at even places by chance.
const LEAST_NATS: f64 = 20.0;
/// Coarsest and finest depth that shows in values of 8 bits, bit.
const BITS: std::ops::RangeInclusive<u8> = 2..=7;

/// The depth that the frames (places) show, of the camera `base`, bit; none where they show none.
pub(crate) fn bits(evidence: &Evidence, frames: &[usize], base: &Theta) -> Option<u8> {
    let tone = Tone::new(base);
    let (mut nats, mut steps) = (0.0, Vec::new());
    for channel in 0..3 {
        let values = occurring(evidence, frames, channel);
        if values.len() < 4 {
            continue;
        }
        let (step, evidence) = evenly(&values, |dn| tone.decode(dn, channel))?;
        nats += evidence;
        steps.push(step);
    }
    steps.sort_by(f32::total_cmp);
    let step = *steps.get(steps.len() / 2)?;
    let bits = (1.0 / step + 1.0).log2().round() as u8;
    tracing::debug!("values are {step:.4} apart, {bits} bit, {nats:.0} nats");
    (nats > LEAST_NATS && BITS.contains(&bits)).then_some(bits)
}

/// Values of a channel that occur and are not clipped, DN, rising.
fn occurring(evidence: &Evidence, frames: &[usize], channel: usize) -> Vec<u8> {
    let mut seen = [false; 256];
    for at in spread_out(frames, FRAMES) {
        for v in evidence.frames[at].dn.data.iter().skip(channel).step_by(3) {
            seen[*v as usize] = true;
        }
    }
    (1..255u8).filter(|v| seen[usize::from(*v)]).collect()
}

/// How far values are apart, if they are evenly so in linear light, and the evidence for it, nats; two numbers were
/// chosen for it.
fn evenly(values: &[u8], decode: impl Fn(f32) -> f32) -> Option<(f32, f64)> {
    let linear: Vec<f32> = values.iter().map(|v| decode(f32::from(*v))).collect();
    let mut gaps: Vec<f32> = linear.windows(2).map(|w| w[1] - w[0]).collect();
    gaps.sort_by(f32::total_cmp);
    let (first, last) = (linear[0], linear[linear.len() - 1]);
    // Whole steps from the first value to the last: the median gap tells about how many.
    let count = ((last - first) / gaps[gaps.len() / 2]).round();
    let step = (last - first) / count.max(1.0);
    let at = |l: f32| first + ((l - first) / step).round() * step;
    let dn_per_linear = |dn: f32| 2.0 / (decode(dn + 1.0) - decode(dn - 1.0)).max(1e-6);
    let off = |(v, l): (&u8, &f32)| (l - at(*l)).abs() * dn_per_linear(f32::from(*v));
    // The ends are rounded as well: by as much again.
    if values.iter().zip(&linear).any(|o| off(o) > 2.0 * OFF_DN) {
        return None;
    }
    let all = f64::from(values[values.len() - 1] - values[0]) + 1.0;
    let evidence = (values.len() as f64 - 2.0) * (all / (f64::from(count) + 1.0)).ln();
    Some((step, evidence))
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_bits;
    use shutterbug::plane::Plane;

    /// Noisy values of a slope, encoded as sRGB, rounded to that depth before.
    fn frame(bits: Option<i32>) -> Evidence {
        let tone = Tone::new(&Theta::neutral());
        let encode =
            |l: f32| (0..256).map(|dn| dn as f32).find(|dn| tone.decode(dn + 0.5, 0) >= l).unwrap_or(255.0);
        let codes = bits.map(|bits| 2.0f32.powi(bits) - 1.0);
        Evidence::of_one(Plane::from_fn(96, 64, |x, y| {
            let noise =
                random_bits([x as u32, y as u32], 0, 7, [1, 2]).map(|b| b as f32 / u32::MAX as f32 - 0.5);
            [0, 1, 2].map(|c| {
                let l = 0.05 + 0.6 * x as f32 / 96.0 + 0.02 * noise[c];
                encode(codes.map_or(l, |codes| (l * codes).round() / codes))
            })
        }))
    }

    #[test]
    fn depths_show_and_values_that_were_not_rounded_do_not() {
        for depth in [3, 4, 5, 6] {
            let seen = bits(&frame(Some(depth)), &[0], &Theta::neutral());
            assert_eq!(seen, Some(depth as u8));
        }
        assert_eq!(bits(&frame(None), &[0], &Theta::neutral()), None, "control");
        let solid = Evidence::of_one(Plane::from_fn(64, 64, |x, y| {
            [[20.0, 90.0, 200.0], [61.0, 104.0, 130.0], [170.0, 33.0, 77.0], [240.0, 150.0, 9.0]]
                [x / 16 % 2 + y / 16 % 2 * 2]
        }));
        assert_eq!(bits(&solid, &[0], &Theta::neutral()), None, "four colours are no converter");
    }
}
