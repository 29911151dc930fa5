//! Where fits begin. Effects with more than one valley get several starts; the cheapest at a coarse size go on.

use rayon::prelude::*;

use super::evidence::Evidence;
use super::fit::{Level, Target, cost_of, spread_out, weighing_of};
use super::forward::{Forward, Quality};
use super::model::{CandidateSpec, P, Theta};
use crate::camera::ScanOrder;
use crate::error::Result;
use crate::plane::srgb_decode;

/// Where starts are compared: three frames from all over the evidence suffice to tell valleys apart.
const LOOK: Level = Level { block: 4, iterations: 0, quality: Quality::Coarse, frames: 3 };

/// Starts for a candidate beside what `theta` already has.
fn starts(forward: &Forward, theta: &Theta, candidate: &CandidateSpec) -> Vec<Theta> {
    let period_s = forward.period_s;
    let longest_s = forward.longest_s();
    let one = |p: P, values: &[f64]| -> Vec<Theta> { values.iter().map(|&v| theta.with(p, v)).collect() };
    match candidate.name {
        "time_offset" => {
            let [from_s, to_s] = forward.offsets_s();
            let shares = [-0.6, -0.3, -0.1, 0.1, 0.3, 0.6].map(|s| (s * period_s).clamp(from_s, to_s));
            one(P::Offset, &shares)
        }
        "rolling_shutter" => {
            let mut all = Vec::new();
            for order in ScanOrder::ALL {
                for share in [0.2, 0.5, 0.9] {
                    let mut at = theta.with(P::Readout, (share * period_s).min(longest_s));
                    at.scan_order = order;
                    all.push(at);
                }
            }
            all
        }
        "motion_blur" => {
            let mut all = Vec::new();
            for share in [0.1, 0.25, 0.5, 0.85] {
                let exposure_s = (share * period_s).min(longest_s);
                let at = theta.with(P::Exposure, exposure_s);
                // The exposure delays the middle of every line by half of it: what another effect about time has
                // taken for that is given back.
                if theta.is_on(P::Offset) {
                    all.push(at.with(P::Offset, at.get(P::Offset) - 0.5 * exposure_s));
                }
                if theta.is_on(P::Readout) {
                    all.push(at.with(P::Readout, (at.get(P::Readout) - exposure_s).max(0.1 * period_s)));
                }
                all.push(at);
            }
            all
        }
        "defocus" => one(P::Defocus, &[0.4, 0.8, 1.5, 3.0]),
        "sharpening" => {
            let mut all = Vec::new();
            for (amount, radius) in [(0.3, 0.7), (0.5, 1.5), (1.2, 1.0)] {
                all.push(theta.with(P::Sharpen, amount).with(P::Radius, radius));
            }
            all
        }
        "glare" => {
            let mut all = Vec::new();
            for (veil, level) in [(0.05, 0.8), (0.05, 0.2), (0.2, 0.5)] {
                all.push(theta.with(P::Veil, veil).with(P::Level, level));
            }
            all
        }
        "flicker" => {
            // See `flicker_starts`: they come from the frames.
            vec![theta.clone()]
        }
        _ => vec![theta.clone()],
    }
}

/// The best starts, at most `most`.
pub(super) fn best_starts(
    forward: &mut Forward,
    target: Target<'_>,
    evidence: &Evidence,
    theta: &Theta,
    candidate: &CandidateSpec,
    most: usize,
) -> Result<Vec<Theta>> {
    if candidate.name == "flicker" {
        return flicker_starts(forward, evidence, theta, most);
    }
    let all = starts(forward, theta, candidate);
    if all.len() <= most {
        return Ok(all);
    }
    let some = spread_out(&evidence.fit, LOOK.frames);
    let weighing = weighing_of(forward, &some, theta, &LOOK, 2.0)?;
    let mut costs = Vec::new();
    for (i, start) in all.iter().enumerate() {
        costs.push((cost_of(forward, target, &some, start, &LOOK, &weighing)?, i));
    }
    costs.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(costs.iter().take(most).map(|&(_, i)| all[i].clone()).collect())
}

/// Lowest and highest frequency at which flicker is looked for, Hz.
const FLICKER_HZ: [f64; 2] = [20.0, 260.0];
/// Brightness of lamps on 50 and 60 Hz: among frequencies that the frames cannot tell apart the nearest to these.
const MAINS_HZ: [f64; 2] = [100.0, 120.0];

/// Starts for flicker: the brightness of each line over the simulated one, and the sines that fit it best.
fn flicker_starts(
    forward: &mut Forward,
    evidence: &Evidence,
    theta: &Theta,
    most: usize,
) -> Result<Vec<Theta>> {
    let frames = &evidence.fit;
    let means = forward.simulate(frames, theta, Quality::Fit)?;
    let mut lines: Vec<[f64; 2]> = Vec::new();
    for (&at, mean) in frames.iter().zip(&means) {
        let shutter = forward.shutter(at, theta);
        let (k, order) = (&forward.intrinsics, theta.scan_order);
        let mut sums = vec![[0.0f64; 2]; shutter.line_count as usize];
        for i in 0..mean.width * mean.height {
            let line = order.line_of((i % mean.width) as u32, (i / mean.width) as u32, k.width, k.height);
            for c in 0..3 {
                let (r, m) = (evidence.frames[at].dn.data[3 * i + c], mean.data[3 * i + c]);
                if (8.0..=245.0).contains(&r) && (8.0..=245.0).contains(&m) {
                    let sum = &mut sums[line as usize];
                    sum[0] += f64::from(srgb_decode(r / 255.0));
                    sum[1] += f64::from(srgb_decode(m / 255.0));
                }
            }
        }
        let seen = sums.iter().enumerate().filter(|(_, s)| s[1] > 0.0);
        lines.extend(seen.map(|(line, s)| [shutter.line_start_s(line as u32), s[0] / s[1] - 1.0]));
    }
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
    let start = |&(_, f, [c, s]): &(f64, f64, [f64; 2])| {
        theta.with(P::FlickerF, f).with(P::FlickerC, c).with(P::FlickerS, s)
    };
    Ok(fits.iter().take(most.min(1)).map(start).collect())
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
    match super::linear::solve(&rows, &b, 1e-9) {
        Some(x) => (square - x.iter().zip(&b).map(|(x, b)| x * b).sum::<f64>(), [x[0], x[1]]),
        None => (square, [1e-3, 1e-3]),
    }
}
