//! Where fits begin. Effects with more than one valley get several starts; the cheapest at a coarse size go on.

use super::cost::{Level, Target, cost_of, weighing_of};
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::evidence::{Evidence, spread_out};
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::{CandidateSpec, P, Theta};
use shutterbug::camera::ScanOrder;
use shutterbug::error::Result;

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
    let [from_s, to_s] = forward.offsets_s();
    let value = |p: P, start: f64| match p {
        P::Offset => (start * period_s).clamp(from_s, to_s),
        p if p.is_time() => (start * period_s).min(longest_s),
        _ => start,
    };
    let count = candidate.parameters.iter().map(|p| p.spec().fit.starts.len()).max().unwrap_or(0);
    let at = |i: usize| {
        candidate.parameters.iter().fold(theta.clone(), |at, &p| match p.spec().fit.starts.get(i) {
            Some(&start) => at.with(p, value(p, start)),
            None => at,
        })
    };
    let plain: Vec<Theta> = (0..count).map(at).collect();
    match candidate.name {
        _ if count == 0 => vec![theta.clone()],
        "rolling_shutter" => {
            let ordered = |scan_order: ScanOrder| {
                plain.clone().into_iter().map(move |mut at| {
                    at.scan_order = scan_order;
                    at
                })
            };
            ScanOrder::ALL.into_iter().flat_map(ordered).collect()
        }
        "motion_blur" => plain.into_iter().flat_map(|at| beside_time(theta, at, period_s)).collect(),
        // Sharpening undoes most of a defocus, and alone it was fitted to what that left: both start anew.
        "defocus" if theta.is_on(P::Sharpen) => {
            let mut all = plain;
            for sigma_px in [0.6, 1.0] {
                let blurred = theta.with(P::Defocus, sigma_px);
                all.extend(starts(
                    forward,
                    &blurred,
                    crate::diagnose::expect::model::candidate_of("sharpening"),
                ));
            }
            all
        }
        // A lens that is described already may be nearly right.
        "lens_distortion" => plain.into_iter().chain([theta.clone()]).collect(),
        _ => plain,
    }
}

/// An exposure delays the picture too: what another effect about time has taken for that is given back.
fn beside_time(theta: &Theta, at: Theta, period_s: f64) -> Vec<Theta> {
    let mut all = Vec::new();
    let delay_s = at.get(P::Exposure) * P::Exposure.delays().unwrap_or_default();
    for (p, least) in [(P::Offset, f64::NEG_INFINITY), (P::Readout, 0.1 * period_s)] {
        if let Some(part) = p.delays().filter(|_| theta.is_on(p)) {
            all.push(at.with(p, (at.get(p) - delay_s / part).max(least)));
        }
    }
    all.push(at);
    all
}

/// Whether a start lowers the cost at a coarse size: of what is bent so much that slopes at `theta` tell nothing of it.
/// Recorded motion shakes, and where the camera was some ms earlier its speed was another; a lamp's brightness depends
/// on its frequency.
pub(crate) fn is_hopeful(
    forward: &mut Forward,
    target: Target<'_>,
    evidence: &Evidence,
    theta: &Theta,
    candidate: &CandidateSpec,
) -> Result<bool> {
    let some = spread_out(&evidence.fit, LOOK.frames);
    let weighing = weighing_of(forward, &some, theta, &LOOK, 2.0)?;
    let most = HOPEFUL * cost_of(forward, target, &some, theta, &LOOK, &weighing)?;
    let all = match candidate.name {
        "flicker" => super::flicker::starts(forward, evidence, target.masks, theta, 1)?,
        _ => starts(forward, theta, candidate),
    };
    for start in all {
        if cost_of(forward, target, &some, &start, &LOOK, &weighing)? < most {
            return Ok(true);
        }
    }
    Ok(false)
}

/// What share of its cost `theta` loses at the coarse size with each of `others` in its place.
pub(crate) fn lowered(
    forward: &mut Forward,
    target: Target<'_>,
    evidence: &Evidence,
    theta: &Theta,
    others: &[Theta],
) -> Result<Vec<f64>> {
    let some = spread_out(&evidence.fit, LOOK.frames);
    let weighing = weighing_of(forward, &some, theta, &LOOK, 2.0)?;
    let now = cost_of(forward, target, &some, theta, &LOOK, &weighing)?;
    let share = |other| Ok(1.0 - cost_of(forward, target, &some, other, &LOOK, &weighing)? / now.max(1e-9));
    others.iter().map(share).collect()
}

/// The best starts, at most `most`; `known`: one that is tried besides.
pub(crate) fn best_starts(
    forward: &mut Forward,
    target: Target<'_>,
    evidence: &Evidence,
    theta: &Theta,
    candidate: &CandidateSpec,
    (known, most): (Option<Theta>, usize),
) -> Result<Vec<Theta>> {
    if candidate.name == "flicker" {
        return super::flicker::starts(forward, evidence, target.masks, theta, most);
    }
    let mut all = starts(forward, theta, candidate);
    all.extend(known);
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
