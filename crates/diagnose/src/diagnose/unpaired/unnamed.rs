//! What two folders may differ by that no candidate makes: values that never occur, single pixels that stand out, no
//! colour at all, another size. It is never named as an effect, but with it the folders are not alike.

use std::borrow::Borrow;

use rayon::prelude::*;

use super::drawn::{self, STANDS_OUT_DN};
use crate::diagnose::judge::quantile;
use shutterbug::plane::Plane;
use shutterbug::plane::stats::luma;

/// What content makes of the share of such pixels: at most 4.6e-4 in a frame of 24 folders of photographs and renders.
const SINGLE_ERROR: f64 = 1e-3;
/// What content and tables of 8 bits make of the share of values that never occur: at most 0.11 in the same folders.
const LEVELS_ERROR: f64 = 0.1;
/// A value never occurs if none of its pixels is there where its neighbours have so many each.
const SURE_TO_OCCUR: f64 = 50.0;
/// Values to each side that tell how many a value should have.
const AROUND: usize = 8;

/// What the second folder differs by from the first, as words that follow "they differ in".
pub(super) fn differences(
    real: &[impl Borrow<Plane<f32>> + Sync],
    simulated: &[impl Borrow<Plane<f32>> + Sync],
) -> Vec<String> {
    let limit = quantile(4);
    let mut out = Vec::new();
    let [[in_real, of_real], [in_sim, of_sim]] = [single(real), single(simulated)];
    if (in_real - in_sim).abs() > limit * (of_real.powi(2) + of_sim.powi(2) + SINGLE_ERROR.powi(2)).sqrt() {
        let [r, s] = [in_real, in_sim].map(|v| 100.0 * v);
        out.push(format!(
            "single pixels that stand out ({r:.2} % of the real ones, {s:.2} % of the simulated ones)"
        ));
    }
    let [in_real, in_sim] = [missing(real), missing(simulated)];
    if (in_real - in_sim).abs() > limit * LEVELS_ERROR {
        let [r, s] = [in_real, in_sim].map(|v| 100.0 * v);
        out.push(format!(
            "values that never occur ({r:.0} % of them in the real frames, {s:.0} % in the simulated ones)"
        ));
    }
    match [is_grey(real), is_grey(simulated)] {
        [true, false] => out.push("colour, which the real frames do not have at all".to_owned()),
        [false, true] => out.push("colour, which the simulated frames do not have at all".to_owned()),
        _ => {}
    }
    out.extend(drawn::said(real, simulated));
    out
}

/// Share of pixels that lie beyond all eight around them, and its standard error from the frames' own scatter.
fn single(frames: &[impl Borrow<Plane<f32>> + Sync]) -> [f64; 2] {
    let all: Vec<f64> = frames.par_iter().map(|f| single_in(f.borrow())).collect();
    let n = all.len().max(2) as f64;
    let mean = all.iter().sum::<f64>() / n;
    [mean, (all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt()]
}

fn single_in(dn: &Plane<f32>) -> f64 {
    let (w, h) = (dn.width, dn.height);
    let light: Vec<f32> = dn.data.chunks_exact(3).map(luma).collect();
    let stands_out = |x: usize, y: usize| {
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for (i, j) in (0..3).flat_map(|j| (0..3).map(move |i| (i, j))).filter(|at| *at != (1, 1)) {
            let v = light[(y + j - 1) * w + x + i - 1];
            (low, high) = (low.min(v), high.max(v));
        }
        let v = light[y * w + x];
        v > high + STANDS_OUT_DN || v < low - STANDS_OUT_DN
    };
    let count: usize = (1..h - 1).map(|y| (1..w - 1).filter(|x| stands_out(*x, y)).count()).sum();
    count as f64 / ((w - 2) * (h - 2)) as f64
}

/// Of the values whose neighbours occur often in a folder, the share that never occurs; the least of the colours.
fn missing(frames: &[impl Borrow<Plane<f32>> + Sync]) -> f64 {
    let of_channel = |c: usize| {
        let mut count = [0.0f64; 256];
        for value in frames.iter().flat_map(|f| f.borrow().data.iter().skip(c).step_by(3)) {
            count[value.round().clamp(0.0, 255.0) as usize] += 1.0;
        }
        let around = |v: usize| count[v - AROUND..=v + AROUND].iter().sum::<f64>() / (2 * AROUND + 1) as f64;
        // Both ends hold what was clipped.
        let sure: Vec<usize> = (AROUND + 1..255 - AROUND).filter(|v| around(*v) > SURE_TO_OCCUR).collect();
        let never = sure.iter().filter(|v| count[**v] == 0.0).count();
        never as f64 / sure.len().max(1) as f64
    };
    (0..3).map(of_channel).fold(1.0, f64::min)
}

/// Whether no frame has any colour.
fn is_grey(frames: &[impl Borrow<Plane<f32>> + Sync]) -> bool {
    frames.par_iter().all(|f| f.borrow().data.chunks_exact(3).all(|p| p[0] == p[1] && p[1] == p[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_normal;

    /// Soft and sharp things in colour, with a little noise.
    fn frames(seed: u32, change: impl Fn(usize, usize, [f32; 3]) -> [f32; 3]) -> Vec<Plane<f32>> {
        let one = |k: u32| {
            Plane::from_fn(160, 120, |x, y| {
                let at = x as f32 + 3.0 * k as f32;
                let boxed = if ((at as usize) / 23 + y / 17).is_multiple_of(2) { 60.0 } else { 0.0 };
                let noise = random_normal([x as u32, y as u32], k, seed, [1, 2]);
                let value = |c: usize| 90.0 + boxed + 40.0 * (at / (15.0 + c as f32)).sin() + 2.0 * noise[c];
                change(x, y, [0, 1, 2].map(|c| value(c).round()))
            })
        };
        (0..4).map(one).collect()
    }

    #[test]
    fn what_no_candidate_makes_is_seen_and_other_noise_is_not() {
        let plain = frames(3, |_, _, p| p);
        let said = |other: &[Plane<f32>]| differences(other, &plain).join("; ");
        assert_eq!(said(&frames(4, |_, _, p| p)), "", "control");
        let strong = frames(4, |x, y, p| {
            let n = random_normal([x as u32, y as u32], 8, 9, [1, 2]);
            [0, 1, 2].map(|c| (p[c] + 6.0 * n[c]).round())
        });
        assert_eq!(said(&strong), "", "control: noise is a candidate's");
        let salt =
            frames(4, |x, y, p| if (x * 7919 + y * 104_729).is_multiple_of(101) { [255.0; 3] } else { p });
        assert!(said(&salt).contains("single pixels that stand out (0.9"), "{}", said(&salt));
        let few = frames(4, |_, _, p| p.map(|v| (v / 17.0).round() * 17.0));
        assert!(said(&few).contains("values that never occur (9"), "{}", said(&few));
        let grey = frames(4, |_, _, p| [p[1]; 3]);
        assert!(said(&grey).contains("colour, which the real"), "{}", said(&grey));
        assert!(differences(&plain, &grey).join("").contains("colour, which the simulated"));
    }
}
