//! A finished search in the words of the report.

use std::collections::BTreeMap;

use super::evidence::Evidence;
use super::forward::Quality;
use super::judge::{closed_fraction, unexplained};
use super::magnify::is_a_magnification;
use super::model::{CandidateSpec, P, candidate_of};
use super::report::*;
use super::residue::{MOST_SPREAD, MOST_STRUCTURE};
use super::search::{Alone, Found, Search};
use super::support::{FLOOR_PART, LEAST_DIFFERENCE, damped, restored};
use crate::capture::Capture;
use crate::error::Result;

pub(super) fn without_motion(name: &str, motion_px: f64) -> Candidate {
    Candidate {
        name: name.to_owned(),
        state: CandidateState::Undetermined,
        why: format!("hardly anything moves in these frames ({motion_px:.2} px from one to the next)"),
        gap_with: None,
        parameters: BTreeMap::new(),
        footage: "frames taken while the camera pans and tilts by at least 10 px from one to the next"
            .to_owned(),
    }
}

pub(super) fn describe(
    search: &mut Search<'_>,
    found: &mut Found,
    evidence: &Evidence,
    capture: &Capture,
) -> Result<Report> {
    let verdict = verdict(search, found);
    match verdict {
        Verdict::UnknownEffect => dismiss(search, found),
        Verdict::NoGap => clear(search, found),
        Verdict::Explained | Verdict::PartlyExplained => {}
    }
    let found = &*found;
    let (before, after) = (found.before.mean(), found.after.mean());
    let floor = found.after.floor();
    let fractions = search.judge.closed_fractions(&found.before, &found.after);
    let n = fractions.len();
    let gap = Gap {
        unit: "DN".to_owned(),
        before,
        after,
        floor,
        closed_fraction: closed_fraction(before, after, floor),
        closed_fraction_ci95: [fractions[n * 25 / 1000], fractions[n - 1 - n * 25 / 1000]],
        held_out_frames: evidence.held_out.len(),
        before_ci95: search.judge.interval(|i| found.before.0[i].score),
        after_ci95: search.judge.interval(|i| found.after.0[i].score),
        renderer_difference: search.renderer_difference,
    };
    let effects = effects(search, found)?;
    let candidates = rejected(search, found);
    let place_of = |f: &usize| evidence.frames[*f].index;
    let k = &capture.camera.intrinsics;
    Ok(Report {
        verdict,
        sentence: if another_scene(found) { wrong_scene(&gap) } else { sentence(verdict, &gap, &effects) },
        waterfall: waterfall(&gap, &effects),
        gap,
        effects,
        candidates,
        places: Where::default(),
        measures: Vec::new(),
        percepts: Percepts::default(),
        frames: Vec::new(),
        maps: Maps::default(),
        input: Input {
            kind: "capture".to_owned(),
            capture: capture.root.display().to_string(),
            width: k.width,
            height: k.height,
            frames_listed: capture.frames.len(),
            fit_frames: evidence.fit.iter().map(place_of).collect(),
            held_out_frames: evidence.held_out.iter().map(place_of).collect(),
            left_out: evidence.left_out.clone(),
            compared_share: search.judge.masks.map_or(1.0, |m| {
                let open: f32 = m.iter().map(|p| p.data.iter().sum::<f32>() / p.data.len() as f32).sum();
                f64::from(open) / m.len() as f64
            }),
            method: "exact".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            ..Input::default()
        },
        bootstrap: Bootstrap { resamples: n, block: super::evidence::BLOCK, closed_fraction: fractions },
        warnings: warnings(evidence, found),
        next: Vec::new(),
    })
}

pub(super) fn without_time(name: &str) -> Candidate {
    Candidate {
        name: name.to_owned(),
        state: CandidateState::Undetermined,
        why: "the time limit was reached before it was looked at".to_owned(),
        gap_with: None,
        parameters: BTreeMap::new(),
        footage: "none: the same frames with a longer --time-limit-s".to_owned(),
    }
}

/// Mean difference of flat places that is no rounding, DN: solid colours are rounded by up to half a DN each, which leaves
/// 0.25 at most.
const MOST_BIAS_DN: f64 = 0.45;
/// Share of values far off in flat places, where correct renderers have none.
const MOST_OUTLIERS: f64 = 1e-4;
/// Share of the gap that must be closed for a set to explain it, and for its effects to be named beside a remainder.
const CLOSED: [f64; 2] = [0.5, 0.75];

/// Share of the gap that must be closed for a set to explain a part of it where what is left has structure, or a fit has run to
/// the end of a range: a gain and a white balance close 93 % of a gamma's gap.
const STRUCTURED: f64 = 0.97;

/// How well the floor is known of noise behind compression: coefficients that go either way are no normal distribution.
const PACKED_FLOOR: f64 = 0.15;

/// Gaps up to so many times what two renderers may differ by are small: whatever is left of them may be that.
const SMALL: f64 = 2.5;

/// Correlation of real and simulated pictures below which they show another scene.
const LEAST_LIKENESS: f64 = 0.3;

/// Whether the frames are of this scene at all.
fn another_scene(found: &Found) -> bool {
    found.residue.likeness < LEAST_LIKENESS
}

/// Least share of the gap to be closed, and of it to lie where it is closed altogether, for effects to be named that leave
/// more than a quarter of it: they are there, beside one that is not among the candidates.
const BESIDE: [f64; 2] = [0.2, 0.15];

/// Share of the displacement that must be gone for effects to be named that move the picture, whatever else is left: what
/// only resembles a shutter or a lens leaves things out of place.
const PLACED: f64 = 0.75;

/// Whether a set closes enough of the gap, and has put everything in its place.
///
/// Of photographs by a camera at rest only: where the camera moves, what is left out of the candidates may put things in their
/// places as well (an offset in time does what a blur's delay does).
fn puts_in_place(search: &Search<'_>, found: &Found, closed: f64) -> bool {
    let moves = found.set.iter().any(|n| super::search::moves(candidate_of(n)));
    search.forward.static_camera && moves && closed >= BESIDE[0] && found.residue.placed >= PLACED
}

/// Whether a fit has run to the end of what a parameter may be: it wanted to be something else.
fn ends_at_a_bound(found: &Found) -> bool {
    found.free().into_iter().any(|p| {
        let value = found.fit.theta.get(p);
        // Light of a veil may well be black or white, and an effect may be none.
        p != P::Level && found.fit.theta.is_on(p) && p.spec().range.contains(&value)
    })
}

/// Whether a lens that leaves some of the gap does what a focal length does.
fn magnifies(search: &Search<'_>, found: &Found) -> bool {
    let lens = found.set.contains(&"lens_distortion") && !found.set.contains(&"focal_length_error");
    lens && closed(found) < STRUCTURED && is_a_magnification(&found.fit.theta, &search.forward.intrinsics)
}

/// A set that leaves most of the gap is none, unless it explains some places altogether: its effects are candidates like all
/// others.
fn dismiss(search: &Search<'_>, found: &mut Found) {
    let closed = closed(found);
    let beside = closed >= BESIDE[0] && found.residue.solved >= BESIDE[1];
    // What wanted to be something else has explained nothing, whatever places it happens to fit.
    let bent = ends_at_a_bound(found) || magnifies(search, found);
    let named = closed >= CLOSED[1] || beside || puts_in_place(search, found, closed);
    if !named || bent || another_scene(found) {
        clear(search, found);
    }
}

/// Takes back all effects.
fn clear(search: &Search<'_>, found: &mut Found) {
    found.set.clear();
    found.fit.theta = search.base.clone();
    found.fit.half.clear();
    found.after = found.before.clone();
}

fn warnings(evidence: &Evidence, found: &Found) -> Vec<String> {
    let mut warnings = evidence.warnings.clone();
    if another_scene(found) {
        warnings.push(format!(
            "real and simulated frames hardly resemble each other (correlation {:.2}): these frames do not seem to \
             show this scene, or the camera is far from where the trajectory says; that is no effect of the camera",
            found.residue.likeness
        ));
    }
    if !found.late.is_empty() {
        warnings.push(format!("the time limit was reached: {} were not looked at", found.late.join(", ")));
    }
    warnings
}

/// Whether noise alone has been found.
fn is_noise(found: &Found) -> bool {
    !found.set.is_empty() && found.set.iter().all(|n| candidate_of(n).noise)
}

/// Share of the gap that is closed. A floor is forgiven some per cent, but not where the spread itself is seen to be another than
/// the model's: the little that an effect may close beside that is no explanation.
fn closed(found: &Found) -> f64 {
    let (before, mut after, floor) = (found.before.mean(), found.after.mean(), found.after.floor());
    if is_noise(found) {
        // Weak noise alone: what the floor is not known to may be as much as the gap.
        after -= (after - floor).clamp(0.0, FLOOR_PART * floor);
    }
    if found.residue.spread > MOST_SPREAD && after < floor && after < before {
        (1.0 - (floor - after) / (before - after)).clamp(0.0, 1.0)
    } else {
        closed_fraction(before, after, floor)
    }
}

fn verdict(search: &Search<'_>, found: &Found) -> Verdict {
    let left = &found.residue;
    if another_scene(found) {
        return Verdict::UnknownEffect;
    }
    let (after, floor) = (found.after.mean(), found.after.floor());
    let mut difference = damped(search.renderer_difference.max(1.5 * found.sampling_dn), floor);
    if found.fit.theta.is_on(P::Quality) {
        difference = difference.max(PACKED_FLOOR * floor);
    }
    let closed = closed(found);
    // Behind compression a colour is off by parts of a quantizer's step.
    let shaped = left.bias_dn > MOST_BIAS_DN.max(3.0 * found.sampling_dn)
        || left.smear.is_clear()
        || left.spread > MOST_SPREAD
        // Stuck pixels among bright ones are not found.
        || left.outliers > MOST_OUTLIERS + 0.2 * found.fit.theta.get(P::Hot)
        || (0..2).any(|i| left.structure[i] > MOST_STRUCTURE[i]);
    let rest = unexplained(after, floor);
    // A camera that is known to be noisier than its frames are (compression takes noise away) is a gap as well.
    let gained = found.before.mean() - after;
    let whole = (found.before.mean() - found.before.floor()).max(gained);
    // No more than two renderers may differ by, and no set that closes most of it.
    let nothing = whole <= 1.2 * search.renderer_difference.max(1.5 * found.sampling_dn);
    // Nor is a set worth naming that gains less than any of its effects would have to.
    let tiny = whole <= LEAST_DIFFERENCE * search.renderer_difference;
    if nothing && !shaped && (found.set.is_empty() || closed < CLOSED[0] || tiny) {
        return Verdict::NoGap;
    }
    if found.set.is_empty() {
        return Verdict::UnknownEffect;
    }
    let small = rest <= f64::max(0.5 * difference, 0.02 * whole);
    // What is left is unknown only beyond what two renderers may differ by: of a small gap that is a large share.
    // Nor does what wanted to be something else explain more than it closes.
    let magnifies = magnifies(search, found);
    let another = ends_at_a_bound(found) || magnifies;
    let forgiven = rest <= difference && !another;
    // Nor is a floor known to what weak noise alone leaves.
    let explained = (small && !magnifies)
        || (forgiven && (closed > 0.8 || whole <= SMALL * difference || is_noise(found)));
    // A time offset may close most of a blur's gap, whose delay it is: what stays smeared says that it is something else.
    // Compression, with shared chroma before it, may take more of the slopes along one axis.
    let packed = found.fit.theta.is_on(P::Quality);
    let smeared = left.smear.is_missing() && !found.set.contains(&"motion_blur") && !packed;
    if explained && !shaped {
        Verdict::Explained
    } else if smeared {
        Verdict::UnknownEffect
    } else if puts_in_place(search, found, closed) {
        Verdict::PartlyExplained
    } else if closed < CLOSED[1] || ((shaped || another) && closed < STRUCTURED) {
        Verdict::UnknownEffect
    } else {
        Verdict::PartlyExplained
    }
}

fn wrong_scene(gap: &Gap) -> String {
    format!(
        "The frames differ by {:.2} DN and hardly resemble each other: they do not seem to show this scene from where the \
         trajectory says. That is no effect of the camera.",
        gap.before
    )
}

fn sentence(verdict: Verdict, gap: &Gap, effects: &[EffectFound]) -> String {
    let names: Vec<_> = effects.iter().map(|e| e.name.replace('_', " ")).collect();
    let names = names.join(", ");
    let percent = 100.0 * gap.closed_fraction;
    match verdict {
        Verdict::NoGap => format!(
            "Real and simulated frames differ by {:.2} DN, no more than two correct renderers do.",
            gap.before
        ),
        Verdict::Explained => format!(
            "The simulation lacks {names}: with that the gap falls from {:.2} to {:.2} DN ({percent:.0} % of it).",
            gap.before, gap.after
        ),
        Verdict::PartlyExplained => format!(
            "The simulation lacks {names}, which closes {percent:.0} % of the gap ({:.2} to {:.2} DN); the rest has \
             a cause that is not among the candidates.",
            gap.before, gap.after
        ),
        Verdict::UnknownEffect if effects.is_empty() => format!(
            "The frames differ by {:.2} DN, and no known effect of the camera explains it.",
            gap.before
        ),
        Verdict::UnknownEffect => format!(
            "The frames differ by {:.2} DN; {names} would close {percent:.0} % of the gap, but leaves what none of the \
             candidates explains: there is an effect that is not among them.",
            gap.before
        ),
    }
}

/// Supported effects with their Shapley shares.
fn effects(search: &mut Search<'_>, found: &Found) -> Result<Vec<EffectFound>> {
    let set = &found.set;
    // As fits see it: what is compared here are differences.
    search.forward.native = false;
    search.judge.quality = Quality::Fit;
    let shares = shapley(search, found)?;
    let with = search.judge.scores(search.forward, &found.fit.theta)?;
    let mut out = Vec::new();
    for (i, name) in set.iter().enumerate() {
        let without = search.leave_out(set, i, &found.fit.theta)?.1;
        let alone = found.alone.iter().find(|a| a.name == *name);
        let (gain, gain_ci95) = search.judge.gain(&without, &with);
        out.push(EffectFound {
            name: (*name).to_owned(),
            share: shares[i],
            parameters: found.fit.theta.report(candidate_of(name), &found.fit.half),
            gap_without: if set.len() == 1 { found.before.mean() } else { found.after.mean() + gain },
            gap_with: found.after.mean(),
            gap_alone: alone.map_or(found.before.mean(), |a| gap_alone(search, found, a)),
            gain_ci95,
        });
    }
    out.sort_by(|a, b| b.share.total_cmp(&a.share));
    Ok(out)
}

/// Shares of the closed gap that do not depend on an order: the mean gain over all orders in which the effects of the set
/// could be switched on, with the parameters of the joint fit.
fn shapley(search: &mut Search<'_>, found: &Found) -> Result<Vec<f64>> {
    let n = found.set.len();
    let mut gaps = vec![0.0; 1 << n];
    for (members, gap) in gaps.iter_mut().enumerate() {
        let mut theta = found.fit.theta.clone();
        for (i, name) in found.set.iter().enumerate() {
            if members >> i & 1 == 0 {
                theta = restored(&theta, &search.base, candidate_of(name));
            }
        }
        *gap = search.judge.scores(search.forward, &theta)?.mean();
    }
    let factorial = |k: usize| (1..=k).map(|v| v as f64).product::<f64>();
    let mut values: Vec<f64> = (0..n)
        .map(|i| {
            let without = (0..1usize << n).filter(|s| s >> i & 1 == 0);
            let gain = |s: usize| {
                let k = s.count_ones() as usize;
                factorial(k) * factorial(n - k - 1) / factorial(n) * (gaps[s] - gaps[s | 1 << i])
            };
            without.map(gain).sum::<f64>().max(0.0)
        })
        .collect();
    let total: f64 = values.iter().sum();
    values.iter_mut().for_each(|v| *v = if total > 0.0 { *v / total } else { 1.0 / n as f64 });
    Ok(values)
}

/// The gap with a candidate alone: `before` less what it gains where it was tried.
fn gap_alone(search: &Search<'_>, found: &Found, alone: &Alone) -> f64 {
    found.before.mean() - search.judge.gain(&alone.against, &alone.scores).0
}

fn rejected(search: &Search<'_>, found: &Found) -> Vec<Candidate> {
    let others = found.alone.iter().filter(|a| !found.set.contains(&a.name));
    others
        .map(|a| Candidate {
            name: a.name.to_owned(),
            state: CandidateState::Rejected,
            why: why(search, a, candidate_of(a.name), found),
            gap_with: Some(gap_alone(search, found, a)),
            parameters: a.fit.theta.report(candidate_of(a.name), &a.fit.half),
            footage: String::new(),
        })
        .collect()
}

fn why(search: &Search<'_>, alone: &Alone, candidate: &CandidateSpec, found: &Found) -> String {
    let (gain, [low, _]) = search.judge.gain(&alone.against, &alone.scores);
    let share = 100.0 * gain / found.before.mean().max(1e-9);
    if gain <= 0.0 || low <= 0.0 {
        return format!("alone it does not lower the gap beyond chance ({share:+.1} %)");
    }
    if found.set.is_empty() {
        return format!(
            "it lowers the gap by {share:.1} % only, and leaves the rest unexplained: too little to name it as the cause"
        );
    }
    let kind = if candidate.noise { "spread" } else { "part" };
    format!(
        "alone it would lower the gap by {share:.1} %, but beside {} it adds nothing beyond chance: they explain that \
         {kind} better",
        found.set.join(" and ")
    )
}

/// From before to floor, the steps in proportion to the shares.
fn waterfall(gap: &Gap, effects: &[EffectFound]) -> Vec<WaterfallStep> {
    let mut steps = Vec::new();
    let mut at = gap.before;
    steps.push(WaterfallStep { name: "before".to_owned(), from: 0.0, to: at });
    for effect in effects {
        let to = at - effect.share * (gap.before - gap.after);
        steps.push(WaterfallStep { name: effect.name.clone(), from: at, to });
        at = to;
    }
    steps.push(WaterfallStep { name: "unexplained".to_owned(), from: gap.after, to: gap.floor });
    steps.push(WaterfallStep { name: "floor".to_owned(), from: gap.floor, to: 0.0 });
    steps
}
