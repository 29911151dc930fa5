//! The depth of the converter, told from the frames alone: where values are rounded before they are encoded, few of the
//! 256 values occur, and they are evenly apart once the encoding is undone, whatever the picture shows and however
//! noisy it was before. Behind a mosaic, those are the values that the sites saw themselves. What else mixes pixels or
//! colours behind the converter fills the places between; nothing is told then.

use rayon::prelude::*;

use crate::diagnose::evidence::{Evidence, spread_out};
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::tone::{Tone, dn_per_linear};
use crate::diagnose::expect::vector::PLACES;
use crate::diagnose::search::sites::own;
use shutterbug::chain::Moments;
use shutterbug::effects;
use shutterbug::plane::Plane;

/// Frames that are looked at.
const FRAMES: usize = 4;
/// How far a delivered value lies from its even place at most, DN: half by rounding, and a tenth by what the encoding
/// is off.
const OFF_DN: f64 = 0.6;
/// Lines that are tried where the first one comes near, and how near: times that.
const TURNS: usize = 12;
/// See [`TURNS`].
const NEAR: f64 = 2.0;
/// Least evidence, nats: values that were not rounded lie at even places by chance.
const LEAST_NATS: f64 = 20.0;
/// Strengths of a curve that are tried: the next one puts no value more than a quarter of a DN elsewhere.
const CURVES: usize = 1024;
/// Coarsest and finest depth that shows in values of 8 bits, bit.
const BITS: std::ops::RangeInclusive<u8> = 2..=7;

/// The depth that the frames (places) show, of the camera `base`, bit; none where they show none. Where a curve behind
/// the converter is not known yet, the one is taken under which the values are even.
pub(crate) fn bits(evidence: &Evidence, frames: &[usize], base: &Theta) -> Option<u8> {
    let some: Vec<_> =
        spread_out(frames, FRAMES).iter().map(|&at| own(&evidence.frames[at].dn, base)).collect();
    let values: [Vec<u8>; 3] = std::array::from_fn(|channel| occurring(&some, channel));
    let told = depth(&values, base);
    let few = told.is_none() && values.iter().all(|v| v.len() <= 1 << BITS.end());
    let behind = if few { behind_curves(&values, base) } else { Vec::new() };
    let (bits, nats) = told.into_iter().chain(behind).max_by(|a, b| a.1.total_cmp(&b.1))?;
    tracing::debug!("a converter of {bits} bit, {nats:.0} nats");
    Some(bits)
}

/// The depth behind each curve that tells one, and the evidence for it beyond that of having tried so many.
fn behind_curves(values: &[Vec<u8>; 3], base: &Theta) -> Vec<(u8, f64)> {
    let is_curve = |p: &&P| {
        let effect = effects::by_id(p.spec().effect);
        effect.is_some_and(|e| matches!(e.moments(), Moments::Curve)) && !base.is_on(**p)
    };
    let curves: Vec<P> = PLACES.iter().filter(is_curve).copied().collect();
    let tried = (curves.len() * CURVES) as f64;
    let all = curves.into_par_iter().flat_map(|p| (0..CURVES).into_par_iter().map(move |k| (p, k)));
    let told = all.filter_map(|(p, k)| {
        let [from, to] = p.spec().range;
        let (bits, nats) =
            depth(values, &base.with(p, from + (to - from) * (k as f64 + 0.5) / CURVES as f64))?;
        let nats = nats - tried.ln();
        (nats > LEAST_NATS).then_some((bits, nats))
    });
    told.collect()
}

/// The depth under which the values of the three colours are evenly apart, bit, and the evidence for it, nats.
fn depth(values: &[Vec<u8>; 3], camera: &Theta) -> Option<(u8, f64)> {
    let tone = Tone::new(camera);
    let (mut nats, mut channels) = (0.0, Vec::new());
    for (channel, values) in values.iter().enumerate().filter(|(_, values)| values.len() >= 4) {
        let even = evenly(values, &tone, channel)?;
        nats += even.nats;
        channels.push((channel, even));
    }
    channels.sort_by(|a, b| a.1.step.total_cmp(&b.1.step));
    let step = channels.get(channels.len() / 2)?.1.step;
    let bits = (1.0 / step + 1.0).log2().round() as u8;
    if nats <= LEAST_NATS || !BITS.contains(&bits) {
        return None;
    }
    // A white balance scales red and blue; green has the steps of the depth. Values that a mosaic filled in between
    // those of 15 steps are 60 steps apart, and no depth has 60.
    let whole = Tone::new(&camera.with(P::Bits, f64::from(bits))).step_linear(1);
    let is_whole = |(channel, even): &(usize, Even)| *channel != 1 || (even.step - whole).abs() <= even.off;
    channels.iter().all(is_whole).then_some((bits, nats))
}

/// Values of a channel that occur and are not clipped, DN, rising.
fn occurring(frames: &[Plane<f32>], channel: usize) -> Vec<u8> {
    let mut seen = [false; 256];
    for v in frames.iter().flat_map(|dn| dn.data.iter().skip(channel).step_by(3)) {
        seen[*v as usize] = true;
    }
    (1..255u8).filter(|v| seen[usize::from(*v)]).collect()
}

/// Values that are evenly apart in linear light.
struct Even {
    /// How far.
    step: f32,
    /// How far off that may be where the first and the last value are rounded.
    off: f32,
    /// The evidence for it, nats.
    nats: f64,
}

/// How far values are apart, if they are evenly so in linear light. Of all numbers of steps from the first value to the
/// last, the least that puts each value at a step.
///
/// Measured: a median step told their number before. Rounded by half a DN of two or three, it told 53 for 52.
fn evenly(values: &[u8], tone: &Tone, channel: usize) -> Option<Even> {
    let linear: Vec<f32> = values.iter().map(|v| tone.decode(f32::from(*v), channel)).collect();
    let slopes: Vec<f32> = values.iter().map(|v| dn_per_linear(tone, f32::from(*v), channel)).collect();
    let least = values.len() - 1;
    let fits = |count: usize| Some((count, step_of(&linear, &slopes, count)?));
    let (count, step) = (least..1 << BITS.end()).find_map(fits)?;
    let all = f64::from(values[values.len() - 1] - values[0]) + 1.0;
    let tried = (count - least + 1) as f64;
    let nats = (values.len() as f64 - 2.0) * (all / (count as f64 + 1.0)).ln() - tried.ln();
    let ends = 1.0 / slopes[0] + 1.0 / slopes[least];
    Some(Even { step, off: OFF_DN as f32 * ends / count as f32, nats })
}

/// The step, if each linear value is one of `count` steps from the first to the last: those of a line from which each
/// is off by no more than rounding. `slopes`: DN a linear unit at each.
///
/// The line of least squares may miss a value by more than another line misses any: where it comes near, the values
/// that it misses most get more weight, turn by turn (Lawson 1961).
fn step_of(linear: &[f32], slopes: &[f32], count: usize) -> Option<f32> {
    let (first, last) = (linear[0], linear[linear.len() - 1]);
    let steps = |l: f32| f64::from((l - first) / (last - first) * count as f32).round();
    let points: Vec<[f64; 2]> = linear.iter().map(|l| [steps(*l), f64::from(*l)]).collect();
    let mut weights: Vec<f64> = slopes.iter().map(|s| f64::from(*s).powi(2)).collect();
    for _ in 0..TURNS {
        let [at, step] = line(&points, &weights);
        let off = |([k, l], slope): (&[f64; 2], &f32)| (l - at - step * k).abs() * f64::from(*slope);
        let offs: Vec<f64> = points.iter().zip(slopes).map(off).collect();
        let worst = offs.iter().copied().fold(0.0, f64::max);
        if worst <= OFF_DN {
            return Some(step as f32);
        }
        if worst > NEAR * OFF_DN {
            return None;
        }
        weights.iter_mut().zip(&offs).for_each(|(w, off)| *w *= off / worst);
    }
    None
}

/// Where a line of least squares begins, and its slope.
fn line(points: &[[f64; 2]], weights: &[f64]) -> [f64; 2] {
    let mut sums = [0.0; 5];
    for ([k, l], w) in points.iter().zip(weights) {
        for (sum, term) in sums.iter_mut().zip([*w, w * k, w * k * k, w * l, w * k * l]) {
            *sum += term;
        }
    }
    let [w, k, kk, l, kl] = sums;
    let slope = (w * kl - k * l) / (w * kk - k * k);
    [(l - slope * k) / w, slope]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::model::candidate_of;
    use crate::diagnose::expect::settings::settings_of;
    use shutterbug::chain::rng::random_uniform;
    use shutterbug::reference::moments::mixed;

    /// Noisy values of a slope, encoded as sRGB, rounded to that depth before.
    fn frame(bits: Option<i32>) -> Evidence {
        frame_of(bits, &Theta::neutral())
    }

    /// The same behind what mixes pixels in a camera of `theta`.
    fn frame_of(bits: Option<i32>, theta: &Theta) -> Evidence {
        let tone = Tone::new(&theta.with(P::Mosaic, 0.0));
        let encode =
            |l: f32| (0..256).map(|dn| dn as f32).find(|dn| tone.decode(dn + 0.5, 0) >= l).unwrap_or(255.0);
        let codes = bits.map(|bits| 2.0f32.powi(bits) - 1.0);
        let linear = Plane::from_fn(96, 64, |x, y| {
            let noise = random_uniform([x as u32, y as u32], 0, 7, [1, 2]).map(|u| u - 0.5);
            [0, 1, 2].map(|c| {
                let l = 0.05 + 0.6 * x as f32 / 96.0 + 0.02 * noise[c];
                codes.map_or(l, |codes| (l * codes).round() / codes)
            })
        });
        let seen = mixed(&linear, &settings_of(theta));
        let data = seen.data.iter().map(|l| encode(*l)).collect();
        Evidence::of_one(Plane { data, ..seen })
    }

    #[test]
    fn depths_show_in_what_the_sites_of_a_mosaic_saw() {
        let mosaic = Theta::neutral().with(P::Mosaic, 2.0);
        // Filled in by means of two and four, 4 bits look like nearly 6.
        let noisy = mosaic.with(P::Read, 0.009);
        for depth in [4, 6] {
            let frame = frame_of(Some(depth), &mosaic);
            assert_eq!(bits(&frame, &[0], &mosaic), Some(depth as u8));
            assert_eq!(bits(&frame, &[0], &noisy), Some(depth as u8), "known noise");
            assert_eq!(bits(&frame, &[0], &Theta::neutral()), None, "control: all values");
        }
        assert_eq!(bits(&frame_of(None, &mosaic), &[0], &mosaic), None, "control");
    }

    #[test]
    fn depths_show_behind_curves_that_are_not_known_yet() {
        let curves = ["gamma", "tone_curve"].map(|name| candidate_of(name).parameters[0]);
        for (p, strength) in curves.into_iter().zip([0.83, -0.4]) {
            let camera = Theta::neutral().with(p, strength);
            for depth in [4, 5, 6] {
                let told = bits(&frame_of(Some(depth), &camera), &[0], &Theta::neutral());
                assert_eq!(told, Some(depth as u8), "{}", p.spec().effect);
            }
            assert_eq!(bits(&frame_of(None, &camera), &[0], &Theta::neutral()), None, "control");
        }
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
