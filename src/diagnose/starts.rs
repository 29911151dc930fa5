//! Where fits begin. Effects with more than one valley get several starts; the cheapest at a coarse size go on.

use super::evidence::Evidence;
use super::fit::{Level, Target, cost_of, spread_out, weighing_of};
use super::forward::{Forward, Quality};
use super::model::{CandidateSpec, P, Theta};
use crate::camera::ScanOrder;
use crate::error::Result;

/// Where starts are compared: three frames from all over the evidence suffice to tell valleys apart.
const LOOK: Level = Level { block: 4, iterations: 0, quality: Quality::Coarse, frames: 3 };
/// The same for what is smaller than a block.
const DETAIL: Level = Level { block: 1, quality: Quality::Fit, ..LOOK };

/// How many times the cost of the best start another one may cost and still be worth a fit.
const HOPELESS: f64 = 2.0;
/// What share of the cost without a candidate a start of it may cost to be hopeful.
const HOPEFUL: f64 = 0.97;

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
            // Beside what explains most of a gap hardly any blur is the likeliest.
            for share in [0.03, 0.1, 0.25, 0.5, 0.85] {
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
        // Sharpening undoes most of a defocus, and alone it was fitted to what that left: both start anew.
        "defocus" if theta.is_on(P::Sharpen) => {
            let mut all = one(P::Defocus, &[0.4, 0.8, 1.5, 3.0]);
            for sigma_px in [0.6, 1.0] {
                all.extend(sharpenings(&theta.with(P::Defocus, sigma_px)));
            }
            all
        }
        "defocus" => one(P::Defocus, &[0.4, 0.8, 1.5, 3.0]),
        "sharpening" => sharpenings(theta).to_vec(),
        "glare" => {
            let mut all = Vec::new();
            for (veil, level) in [(0.05, 0.8), (0.05, 0.2), (0.2, 0.5)] {
                all.push(theta.with(P::Veil, veil).with(P::Level, level));
            }
            all
        }
        "flicker" => {
            // See `flicker`: they come from the frames.
            vec![theta.clone()]
        }
        _ => vec![theta.clone()],
    }
}

fn sharpenings(theta: &Theta) -> [Theta; 3] {
    [(0.3, 0.7), (0.5, 1.5), (1.2, 1.0)]
        .map(|(amount, radius)| theta.with(P::Sharpen, amount).with(P::Radius, radius))
}

/// Whether a start lowers the cost at a coarse size: of what is bent so much that slopes at `theta` tell nothing of it. Recorded
/// motion shakes, and where the camera was some ms earlier its speed was another.
pub(super) fn is_hopeful(
    forward: &mut Forward,
    target: Target<'_>,
    evidence: &Evidence,
    theta: &Theta,
    candidate: &CandidateSpec,
) -> Result<bool> {
    let some = spread_out(&evidence.fit, LOOK.frames);
    let weighing = weighing_of(forward, &some, theta, &LOOK, 2.0)?;
    let most = HOPEFUL * cost_of(forward, target, &some, theta, &LOOK, &weighing)?;
    for start in starts(forward, theta, candidate) {
        if cost_of(forward, target, &some, &start, &LOOK, &weighing)? < most {
            return Ok(true);
        }
    }
    Ok(false)
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
        return super::flicker::starts(forward, evidence, theta, most);
    }
    let all = starts(forward, theta, candidate);
    if all.len() <= most {
        return Ok(all);
    }
    let look = if candidate.name == "defocus" && theta.is_on(P::Sharpen) { DETAIL } else { LOOK };
    let some = spread_out(&evidence.fit, look.frames);
    let weighing = weighing_of(forward, &some, theta, &look, 2.0)?;
    let mut costs = Vec::new();
    for (i, start) in all.iter().enumerate() {
        costs.push((cost_of(forward, target, &some, start, &look, &weighing)?, i));
    }
    costs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let hopeful = costs.iter().take(most).filter(|c| c.0 <= HOPELESS * costs[0].0);
    Ok(hopeful.map(|&(_, i)| all[i].clone()).collect())
}
