//! Flicker: where its fits begin, and whether what looks like it is periodic at all.

use rayon::prelude::*;

use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::{P, Theta};
use shutterbug::error::Result;
use shutterbug::plane::{Plane, srgb_decode};

/// The effect that says about which level brightness goes up and down.
pub(crate) const LEVEL: &str = "exposure_gain";
/// Lowest and highest frequency at which flicker is looked for, Hz.
const FLICKER_HZ: [f64; 2] = [20.0, 260.0];
/// Brightness of lamps on 50 and 60 Hz: among frequencies that the frames cannot tell apart the nearest to these.
const MAINS_HZ: [f64; 2] = [100.0, 120.0];

/// `theta` with another frequency of its flicker and the phase at the time `middle_s` as it was. A phase counts from
/// time 0, which may be decades away from the footage: there, the least step of the frequency would be many turns.
pub(crate) fn retuned(theta: &Theta, frequency_hz: f64, middle_s: f64) -> Theta {
    let turn = std::f64::consts::TAU * (theta.get(P::FlickerF) - frequency_hz) * middle_s;
    let ((sin, cos), (c, s)) = (turn.sin_cos(), (theta.get(P::FlickerC), theta.get(P::FlickerS)));
    let phase = [c * cos - s * sin, s * cos + c * sin];
    theta.with(P::FlickerF, frequency_hz).with(P::FlickerC, phase[0]).with(P::FlickerS, phase[1])
}

/// Starts for flicker: the brightness of each line over the simulated one, and the sines that fit it best. Where all
/// lines are exposed at once a frame says one number, and four are looked for: the frames to choose by are heard too,
/// as [`is_periodic`] does.
pub(crate) fn starts(
    forward: &mut Forward,
    evidence: &Evidence,
    masks: Option<&[Plane<f32>]>,
    theta: &Theta,
    most: usize,
) -> Result<Vec<Theta>> {
    let frames = frames_of(evidence);
    let means = forward.simulate(&frames, theta, Quality::Fit)?;
    let lines: Vec<[f64; 2]> = frames
        .iter()
        .zip(&means)
        .flat_map(|(&at, mean)| line_gains(forward, theta, at, masks, &evidence.frames[at].dn, mean))
        .map(|[t, gain, _]| [t, gain])
        .collect();
    let span_s = lines.iter().map(|l| l[0]).fold(0.0, f64::max) - lines.first().map_or(0.0, |l| l[0]);
    let step_hz = 0.2 / span_s.max(0.02);
    let count = ((FLICKER_HZ[1] - FLICKER_HZ[0]) / step_hz) as usize;
    let mut fits: Vec<(f64, f64, [f64; 2])> = (0..count)
        .into_par_iter()
        .map(|i| {
            let f = FLICKER_HZ[0] + step_hz * i as f64;
            let (left, [c, s]) = sine(&lines, f);
            (left, f, [c, s])
        })
        .collect();
    let best = fits.iter().map(|f| f.0).fold(f64::INFINITY, f64::min);
    fits.retain(|f| f.0 <= 1.05 * best + 1e-12);
    let far = |f: f64| MAINS_HZ.iter().map(|m| (f - m).abs()).fold(f64::INFINITY, f64::min);
    fits.sort_by(|a, b| far(a.1).total_cmp(&far(b.1)));
    tracing::debug!("flicker begins at {:?} of {}: leaves {best}", &fits[..fits.len().min(5)], fits.len());
    let start = |&(_, f, [c, s]): &(f64, f64, [f64; 2])| {
        theta.with(P::FlickerF, f).with(P::FlickerC, c).with(P::FlickerS, s)
    };
    Ok(fits.iter().take(most.min(1)).map(start).collect())
}

/// Frames to fit and to choose by, in the order of time.
fn frames_of(evidence: &Evidence) -> Vec<usize> {
    let mut frames: Vec<usize> = evidence.fit.iter().chain(&evidence.choose).copied().collect();
    frames.sort_unstable();
    frames
}

/// Sum of squares that a sine of that frequency leaves of values over time, and its parts in phase and out of it.
fn sine(lines: &[[f64; 2]], frequency_hz: f64) -> (f64, [f64; 2]) {
    let n = lines.len().max(1) as f64;
    let mean = lines.iter().map(|l| l[1]).sum::<f64>() / n;
    let (mut a, mut b, mut square) = ([[0.0; 3]; 3], [0.0; 3], 0.0);
    for [t, v] in lines {
        let (sin, cos) = (std::f64::consts::TAU * frequency_hz * t).sin_cos();
        let (g, v) = ([sin, cos, 1.0], v - mean);
        square += v * v;
        for i in 0..3 {
            b[i] += g[i] * v;
            (0..3).for_each(|j| a[i][j] += g[i] * g[j]);
        }
    }
    let rows: Vec<Vec<f64>> = a.iter().map(|r| r.to_vec()).collect();
    match crate::diagnose::expect::linear::solve(&rows, &b, 1e-9) {
        Some(x) => (square - x.iter().zip(&b).map(|(x, b)| x * b).sum::<f64>(), [x[0], x[1]]),
        None => (square, [1e-3, 1e-3]),
    }
}

/// By line: time, how much brighter than simulated it is (a share), and the light that this is known from.
fn line_gains(
    forward: &Forward,
    theta: &Theta,
    at: usize,
    masks: Option<&[Plane<f32>]>,
    real: &Plane<f32>,
    mean: &Plane<f32>,
) -> Vec<[f64; 3]> {
    let open = |i: usize| masks.is_none_or(|m| m[at].data[i] > 0.5);
    let shutter = forward.shutter(at, theta);
    let (k, order) = (&forward.intrinsics, theta.scan_order);
    let mut sums = vec![[0.0f64; 2]; shutter.line_count as usize];
    for i in (0..mean.width * mean.height).filter(|&i| open(i)) {
        let line = order.line_of((i % mean.width) as u32, (i / mean.width) as u32, k.width, k.height);
        for c in 0..3 {
            let (r, m) = (real.data[3 * i + c], mean.data[3 * i + c]);
            if (8.0..=245.0).contains(&r) && (8.0..=245.0).contains(&m) {
                let sum = &mut sums[line as usize];
                sum[0] += f64::from(srgb_decode(r / 255.0));
                sum[1] += f64::from(srgb_decode(m / 255.0));
            }
        }
    }
    let seen = sums.iter().enumerate().filter(|(_, s)| s[1] > 0.0);
    seen.map(|(line, s)| [shutter.line_start_s(line as u32), s[0] / s[1] - 1.0, s[1]]).collect()
}

/// Share of the size of the frames' differences in brightness that a sine may leave and a drift must, and share of what
/// a drift leaves that a sine may.
const LEAVES: [f64; 2] = [0.25, 0.5];
/// Share of the squares of the bands within frames that a sine must explain, and the size from which on they can be
/// seen.
const BANDS: (f64, f64) = (0.5, 0.004);
/// Lines whose gains are averaged.
const LINES: usize = 8;

/// Whether the flicker of `theta` shows as such: as bands within frames, or as a sine from frame to frame that neither
/// brightnesses that go up and down freely nor a drift (a cubic of the time, which has as many parameters) explain as
/// well. Three parameters follow many things that a few frames do.
pub(crate) fn is_periodic(
    forward: &mut Forward,
    evidence: &Evidence,
    masks: Option<&[Plane<f32>]>,
    theta: &Theta,
) -> Result<bool> {
    let frames = frames_of(evidence);
    let still = theta.with(P::FlickerC, 0.0).with(P::FlickerS, 0.0);
    let [without, with] =
        [forward.simulate(&frames, &still, Quality::Fit)?, forward.simulate(&frames, theta, Quality::Fit)?];
    let gains = |pictures: &dyn Fn(usize) -> Plane<f32>| -> Vec<Vec<[f64; 3]>> {
        let of = |i: usize| line_gains(forward, theta, frames[i], masks, &pictures(i), &without[i]);
        (0..frames.len()).map(of).collect()
    };
    let seen = gains(&|i| (*evidence.frames[frames[i]].dn).clone());
    let said = gains(&|i| with[i].clone());
    let (seen, said) = (Frames::new(&seen), Frames::new(&said));
    let (bands, left) = seen.bands_beside(&said);
    tracing::debug!(
        "flicker: bands {bands:.4}, left {left:.4}; frames {:?} said {:?}",
        seen.means,
        said.means
    );
    if theta.is_on(P::Readout) && said.bands_beside(&said).0 > BANDS.1 {
        return Ok(left * left < (1.0 - BANDS.0) * bands * bands);
    }
    let times: Vec<f64> = frames.iter().map(|&f| evidence.frames[f].start_s).collect();
    Ok(is_a_sine(&times, &seen.means, &said.means))
}

/// Whether the frames' gains follow what a sine says rather than a drift. A curve or a veil that the model lacks makes
/// them larger or smaller, all alike.
fn is_a_sine(times_s: &[f64], seen: &[f64], said: &[f64]) -> bool {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len().max(1) as f64;
    let (of_seen, of_said) = (mean(seen), mean(said));
    let sums = seen.iter().zip(said).fold([0.0, 0.0], |[both, own], (a, b)| {
        [both + (a - of_seen) * (b - of_said), own + (b - of_said).powi(2)]
    });
    let scale = (sums[0] / sums[1].max(1e-12)).max(0.0);
    let beside: Vec<f64> = seen.iter().zip(said).map(|(a, b)| a - scale * b).collect();
    let (all, left) = (size_beside_polynomial(times_s, seen, 0), size_beside_polynomial(times_s, &beside, 0));
    let drift = size_beside_polynomial(times_s, seen, 3.min(seen.len().saturating_sub(3)));
    left < LEAVES[0] * all && drift > LEAVES[0] * all && left < LEAVES[1] * drift
}

/// Root mean square of what a polynomial of the time leaves of some values.
fn size_beside_polynomial(times_s: &[f64], values: &[f64], degree: usize) -> f64 {
    let (first, last) = (times_s[0], times_s[times_s.len() - 1]);
    let terms: Vec<Vec<f64>> = times_s
        .iter()
        .map(|t| {
            let x = 2.0 * (t - first) / (last - first).max(1e-9) - 1.0;
            (0..=degree).map(|d| x.powi(d as i32)).collect()
        })
        .collect();
    let n = degree + 1;
    let a: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| terms.iter().map(|t| t[i] * t[j]).sum()).collect()).collect();
    let b: Vec<f64> = (0..n).map(|i| terms.iter().zip(values).map(|(t, v)| t[i] * v).sum()).collect();
    let x = crate::diagnose::expect::linear::solve(&a, &b, 1e-12).unwrap_or_else(|| vec![0.0; n]);
    let left = terms.iter().zip(values).map(|(t, v)| {
        let fitted: f64 = t.iter().zip(&x).map(|(t, x)| t * x).sum();
        (v - fitted).powi(2)
    });
    (left.sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Gains of frames, and of bands of lines beside their frame's.
struct Frames {
    means: Vec<f64>,
    bands: Vec<Vec<f64>>,
}

impl Frames {
    fn new(gains: &[Vec<[f64; 3]>]) -> Self {
        let mean = |lines: &[[f64; 3]]| {
            let (sum, weight) = lines.iter().fold((0.0, 0.0), |(s, w), l| (s + l[1] * l[2], w + l[2]));
            sum / f64::max(weight, 1e-9)
        };
        let means: Vec<f64> = gains.iter().map(|g| mean(g)).collect();
        let bands = gains
            .iter()
            .zip(&means)
            .map(|(g, m)| g.chunks(LINES).map(|lines| mean(lines) - m).collect())
            .collect();
        Self { means, bands }
    }

    /// Root mean square of the bands, and of what another's leave of them.
    fn bands_beside(&self, other: &Self) -> (f64, f64) {
        let (mut all, mut left, mut count) = (0.0, 0.0, 0.0);
        for (a, b) in self.bands.iter().flatten().zip(other.bands.iter().flatten()) {
            all += a * a;
            left += (a - b).powi(2);
            count += 1.0;
        }
        let root = |sum: f64| (sum / f64::max(count, 1.0)).sqrt();
        (root(all), root(left))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_frequency_turns_about_the_middle_of_the_footage() {
        let at = |theta: &Theta, t: f64| {
            let (sin, cos) = (std::f64::consts::TAU * theta.get(P::FlickerF) * t).sin_cos();
            theta.get(P::FlickerC) * sin + theta.get(P::FlickerS) * cos
        };
        let theta = Theta::neutral().with(P::FlickerF, 107.7).with(P::FlickerC, 0.1).with(P::FlickerS, -0.05);
        let middle_s = 1_305_031_102.25;
        let retuned = retuned(&theta, 107.75, middle_s);
        for t in [-0.2, 0.0, 0.2] {
            let turn = std::f64::consts::TAU * 0.05 * t;
            let want = at(&theta, middle_s + t);
            // A tenth of a hertz is a hundredth of a turn at the ends of the footage; times in doubles are good to 1e-7
            // s.
            assert!((at(&retuned, middle_s + t) - want).abs() < 0.112 * turn.abs() + 1e-3, "{t}");
        }
        let plain = theta.with(P::FlickerF, 107.75);
        assert!((at(&plain, middle_s) - at(&theta, middle_s)).abs() > 0.02, "control");
    }

    #[test]
    fn a_sine_is_one_and_a_drift_or_a_control_that_hunts_is_none() {
        let times: Vec<f64> = (0..12).map(|i| f64::from(i) / 30.0).collect();
        let of = |f: &dyn Fn(f64) -> f64| -> Vec<f64> { times.iter().map(|t| f(*t)).collect() };
        let sine = |hz: f64, depth: f64| move |t: f64| depth * (std::f64::consts::TAU * hz * t + 0.4).sin();
        assert!(is_a_sine(&times, &of(&sine(100.0, 0.1)), &of(&sine(100.0, 0.098))));
        // Behind a curve whose slope is a third less.
        let curved = |f: &dyn Fn(f64) -> f64| of(&|t| 0.7 * f(t) + 0.1 * f(t).powi(2) + 0.06);
        assert!(is_a_sine(&times, &curved(&sine(100.0, 0.3)), &of(&sine(100.0, 0.3))));
        // A lamp of 120 Hz seen 29.97 times a second drifts by a tenth of a turn: nobody can tell it from a drift.
        let slow = of(&sine(0.12, 0.3));
        assert!(!is_a_sine(&times, &slow, &slow));
        let drift = of(&|t| 0.2 * t + 0.1 * t * t);
        assert!(!is_a_sine(&times, &drift, &of(&sine(0.3, 0.2))));
        let hunting: Vec<f64> = (0..12).map(|i| f64::from((i * 7919 + 3) % 13) / 130.0).collect();
        assert!(!is_a_sine(&times, &hunting, &of(&sine(9.0, 0.04))));
    }
}
