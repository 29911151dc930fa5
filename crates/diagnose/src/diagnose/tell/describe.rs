//! A finished search in the words of the report.

use std::collections::BTreeMap;

use super::same_together::{FILM, same_together};
use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::budget::{Budgeted, Stage, in_time};
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::description::Kind;
use crate::diagnose::expect::model::{CandidateSpec, candidate_of};
use crate::diagnose::expect::room::{bends_values, is_description, is_in_surfaces, is_of_surfaces};
use crate::diagnose::judge::{Estimate, closed_fraction, gain};
use crate::diagnose::report::*;
use crate::diagnose::search::Search;
use crate::diagnose::search::decide::{Facts, decide};
use crate::diagnose::search::found::{Alone, Found, SHARES};
use crate::diagnose::search::support::restored;
use shutterbug::capture::Capture;
use shutterbug::error::Result;

pub(crate) fn without_motion(name: &str, motion_px: f64) -> Candidate {
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

/// The report of a search; what a verdict does not let stand is taken back from `found`.
pub(crate) fn describe(
    search: &mut Search<'_>,
    found: &mut Found,
    evidence: &Evidence,
    capture: &Capture,
) -> Result<Report> {
    let decision = decide(&Facts::of(search, found));
    if decision.names {
        let set = &found.set;
        found.late.retain(|n| !set.contains(n));
    } else {
        take_back(search, found, evidence)?;
    }
    let verdict = decision.verdict;
    let effects = match in_time(effects(search, found))? {
        Some(effects) => effects,
        None => {
            found.leave_out(SHARES);
            effects_alone(search, found)?
        }
    };
    let found = &*found;
    let fractions = search.judge.closed_fractions(&found.before, &found.after);
    let gap = gap_of(found, evidence, &fractions);
    Ok(Report {
        verdict,
        sentence: if found.residue.shows_another_scene() {
            wrong_scene(&gap)
        } else {
            sentence(verdict, &gap, &effects, &decision.failed)
        },
        waterfall: waterfall(&gap, &effects),
        gap,
        effects,
        candidates: rejected(search, found),
        places: Where::default(),
        measures: Vec::new(),
        percepts: Percepts::default(),
        frames: Vec::new(),
        maps: Maps::default(),
        description: DescriptionShown::default(),
        input: input(search, evidence, capture),
        bootstrap: Bootstrap {
            resamples: fractions.len(),
            block: crate::diagnose::evidence::BLOCK,
            closed_fraction: fractions,
        },
        warnings: warnings(evidence, found),
        next: Vec::new(),
    })
}

/// Takes all effects back. All of the picture is compared where nothing is named.
fn take_back(search: &mut Search<'_>, found: &mut Found, evidence: &Evidence) -> Result<()> {
    found.clear(&search.base);
    if search.judge.kind != Kind::default() {
        search.judge.kind = Kind::default();
        found.before = search.within(Stage::Must, |search| {
            search.judge.scores_on(search.forward, &search.base.clone(), &evidence.report)
        })?;
        found.after = found.before.clone();
    }
    Ok(())
}

/// The gap before and after. `fractions` are the resamples of its closed fraction, in rising order.
fn gap_of(found: &Found, evidence: &Evidence, fractions: &[f64]) -> Gap {
    let (before, after) = (found.before.mean(), found.after.mean());
    let floor = found.after.floor();
    let n = fractions.len();
    Gap {
        unit: "DN".to_owned(),
        before,
        after,
        floor,
        closed_fraction: closed_fraction(before, after, floor),
        closed_fraction_ci95: [fractions[n * 25 / 1000], fractions[n - 1 - n * 25 / 1000]],
        held_out_frames: evidence.report.len(),
        before_ci95: found.before.estimate().interval(),
        after_ci95: found.after.estimate().interval(),
        renderer_difference: found.before.bound(),
    }
}

/// Which frames were compared, and which share of their pixels.
fn input(search: &Search<'_>, evidence: &Evidence, capture: &Capture) -> Input {
    let place_of = |f: &usize| evidence.frames[*f].index;
    let k = &capture.camera.intrinsics;
    Input {
        kind: "capture".to_owned(),
        capture: capture.root.display().to_string(),
        width: k.width,
        height: k.height,
        frames_listed: capture.frames.len(),
        fit_frames: evidence.fit.iter().map(place_of).collect(),
        held_out_frames: evidence.report.iter().map(place_of).collect(),
        left_out: evidence.left_out.clone(),
        compared_share: search.judge.masks.map_or(1.0, |m| {
            let open: f32 = m.iter().map(|p| p.data.iter().sum::<f32>() / p.data.len() as f32).sum();
            f64::from(open) / m.len() as f64
        }),
        method: "exact".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        ..Input::default()
    }
}

/// A candidate that these frames cannot tell of, and what would.
pub(crate) fn undetermined(name: &str, why: &str, footage: &str) -> Candidate {
    Candidate {
        name: name.to_owned(),
        state: CandidateState::Undetermined,
        why: why.to_owned(),
        gap_with: None,
        parameters: BTreeMap::new(),
        footage: footage.to_owned(),
    }
}

pub(crate) fn without_time(name: &str) -> Candidate {
    let why = "the time limit was reached before it was looked at";
    undetermined(name, why, "none: the same frames with a longer --time-limit-s")
}

fn warnings(evidence: &Evidence, found: &Found) -> Vec<String> {
    let mut warnings = evidence.warnings.clone();
    if found.residue.shows_another_scene() {
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

fn wrong_scene(gap: &Gap) -> String {
    format!(
        "The frames differ by {:.2} DN and hardly resemble each other: they do not seem to show this scene from \
         where the trajectory says. That is no effect of the camera.",
        gap.before
    )
}

fn sentence(verdict: Verdict, gap: &Gap, effects: &[EffectFound], failed: &[&str]) -> String {
    let [camera, room] = [true, false].map(|c| {
        let names: Vec<_> =
            effects.iter().filter(|e| e.camera == c).map(|e| e.name.replace('_', " ")).collect();
        listed(&names)
    });
    let all: Vec<_> = effects.iter().map(|e| e.name.replace('_', " ")).collect();
    let names = listed(&all);
    let percent = 100.0 * gap.closed_fraction;
    let left =
        if failed.is_empty() { String::new() } else { format!(" (it shows in: {})", failed.join(", ")) };
    let lacks = match (camera.as_str(), room.as_str()) {
        (camera, "") => format!("The simulation lacks {camera}"),
        ("", room) => format!("The camera lacks nothing, but the description is not right ({room})"),
        (camera, room) => format!("The camera lacks {camera}, and the description is not right ({room})"),
    };
    let parts = parts(gap, effects);
    match verdict {
        Verdict::NoGap => format!(
            "Real and simulated frames differ by {:.2} DN, no more than two correct renderers may ({:.2} DN).",
            gap.before, gap.renderer_difference
        ),
        Verdict::Explained => format!(
            "{lacks}: with what was found, the gap falls from {:.2} to {:.2} DN ({percent:.0} % of what can be \
             closed).{parts}",
            gap.before, gap.after
        ),
        Verdict::PartlyExplained => format!(
            "{lacks}, which closes {percent:.0} % of the gap ({:.2} to {:.2} DN); the rest has a cause that is not \
             among the candidates{left}.{parts}",
            gap.before, gap.after
        ),
        Verdict::Undetermined if effects.is_empty() => format!(
            "Real and simulated frames differ by {:.2} DN ({:.2} to {:.2}), and two correct renderers may by {:.2} DN: \
             these frames do not tell whether there is a gap.",
            gap.before, gap.before_ci95[0], gap.before_ci95[1], gap.renderer_difference
        ),
        Verdict::UnknownEffect if effects.is_empty() => format!(
            "The frames differ by {:.2} DN, and no known effect of the camera explains it{left}.",
            gap.before
        ),
        Verdict::UnknownEffect if camera.is_empty() && failed.is_empty() => format!(
            "The frames differ by {:.2} DN. Surfaces that are brighter, darker or of other colours than the scene \
             says would close {percent:.0} % of that, and so would an effect of the camera that is not among the \
             candidates: these frames do not tell which.",
            gap.before
        ),
        Verdict::UnknownEffect | Verdict::Undetermined => format!(
            "The frames differ by {:.2} DN; {names} would close {percent:.0} % of the gap, but would leave what none \
             of the candidates explains{left}: there is an effect that is not among them.{parts}",
            gap.before
        ),
    }
}

/// "a, b and c".
pub(crate) fn listed(names: &[String]) -> String {
    match names {
        [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        _ => names.concat(),
    }
}

/// How much of the gap is the camera's, where not all is.
fn parts(gap: &Gap, effects: &[EffectFound]) -> String {
    if effects.iter().all(|e| e.camera) {
        return String::new();
    }
    let of = |camera: bool| {
        let share: f64 = effects.iter().filter(|e| e.camera == camera).map(|e| e.share).sum();
        (100.0 * share * gap.closed_fraction).max(0.0)
    };
    format!(" Of the gap, {:.0} % is the camera's and {:.0} % the description's.", of(true), of(false))
}

/// Supported effects with their Shapley shares.
fn effects(search: &mut Search<'_>, found: &Found) -> Result<Vec<EffectFound>> {
    let set = &found.set;
    // As fits see it: what is compared here are differences.
    search.forward.native = false;
    search.judge.quality = Quality::Fit;
    let shares = shapley(search, found)?;
    let with = search.judge.scores(search.forward, &found.fit.theta)?;
    let mut gains = Vec::new();
    for i in 0..set.len() {
        let without = search.leave_out(set, i, &found.fit.theta)?.1;
        gains.push(gain(&without, &with));
    }
    as_found(search, found, &shares, &gains)
}

/// The same where there is no time to search beside each: shares and gains are those of each effect alone.
fn effects_alone(search: &mut Search<'_>, found: &Found) -> Result<Vec<EffectFound>> {
    let of = |name: &&'static str| {
        let alone = found.alone.iter().find(|a| a.name == *name);
        alone.map_or(Estimate::default(), |a| gain(&a.against, &a.scores))
    };
    let gains: Vec<Estimate> = found.set.iter().map(of).collect();
    let total: f64 = gains.iter().map(|g| g.value.max(0.0)).sum();
    let even = 1.0 / found.set.len().max(1) as f64;
    let share = |g: &Estimate| if total > 0.0 { g.value.max(0.0) / total } else { even };
    let shares: Vec<f64> = gains.iter().map(share).collect();
    // What the description is off by takes some renders.
    search.within(Stage::Must, |search| as_found(search, found, &shares, &gains))
}

/// Effects with their shares, and what each gains beside the others.
fn as_found(
    search: &mut Search<'_>,
    found: &Found,
    shares: &[f64],
    gains: &[Estimate],
) -> Result<Vec<EffectFound>> {
    let set = &found.set;
    let mut out = Vec::new();
    for (i, name) in set.iter().enumerate() {
        let alone = found.alone.iter().find(|a| a.name == *name);
        let gain = gains[i];
        let mut alternatives = found.alternatives.get(name).cloned().unwrap_or_default();
        // The lamps may be brighter, or the exposure longer: a constant factor is the same in both.
        let same = |n: &&'static str| !set.contains(n) && is_in_surfaces(n, &[name]);
        alternatives.extend(search.names.iter().copied().filter(same));
        let parameters = if is_description(name) {
            search.description_parameters(name, &found.fit.theta)?
        } else {
            found.fit.theta.report(candidate_of(name), &found.fit.half)
        };
        let same_together = same_together(name, set, &parameters);
        out.push(EffectFound {
            name: (*name).to_owned(),
            share: shares[i],
            footage: footage(name, &alternatives, &same_together),
            parameters,
            camera: !is_description(name),
            gap_without: if set.len() == 1 { found.before.mean() } else { found.after.mean() + gain.value },
            gap_with: found.after.mean(),
            gap_alone: alone.map_or(found.before.mean(), |a| gap_alone(found, a)),
            gain_ci95: gain.interval(),
            alternatives: alternatives.iter().map(|n| (*n).to_owned()).collect(),
            same_together,
        });
    }
    out.sort_by(|a, b| b.share.total_cmp(&a.share));
    Ok(out)
}

/// What to film to tell an effect from its alternatives: where each of them shows best.
fn footage(name: &str, alternatives: &[&str], together: &Together) -> String {
    let shown_by = |name: &str| shutterbug::effects::by_id(name).map_or("", |e| e.shown_by());
    let own = (!alternatives.is_empty()).then_some(name);
    let mut films: Vec<&str> = own.into_iter().chain(alternatives.iter().copied()).map(shown_by).collect();
    films.extend((!together.is_empty()).then_some(FILM));
    films.dedup();
    films.retain(|film| !film.is_empty());
    films.join("; or ")
}

/// Shares of the closed gap that do not depend on an order: the mean gain over all orders in which the effects of the
/// set could be switched on, with the parameters of the joint fit.
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

/// The gap with a candidate alone. It was tried on other frames than those that are told of, which may be darker or
/// stiller: what carries over is the share that it closes of what can be closed.
fn gap_alone(found: &Found, alone: &Alone) -> f64 {
    let closed = closed_fraction(alone.against.mean(), alone.scores.mean(), alone.scores.floor());
    let (before, floor) = (found.before.mean(), found.after.floor());
    before - closed * (before - floor.min(before))
}

fn rejected(search: &Search<'_>, found: &Found) -> Vec<Candidate> {
    let others = found.alone.iter().filter(|a| !found.set.contains(&a.name));
    let one = |a: &Alone| {
        let hidden = is_hidden_by_surfaces(search, a, found);
        let shown_by = shutterbug::effects::by_id(a.name).map_or("", |e| e.shown_by());
        Candidate {
            name: a.name.to_owned(),
            state: if hidden { CandidateState::Undetermined } else { CandidateState::Rejected },
            why: why(search, a, candidate_of(a.name), found),
            gap_with: Some(gap_alone(found, a)),
            parameters: a.fit.theta.report(candidate_of(a.name), &a.fit.half),
            footage: if hidden { shown_by.to_owned() } else { String::new() },
        }
    };
    others.map(one).collect()
}

/// Whether factors of the surfaces may have taken what a candidate does: it explains a part alone, and changes what
/// stays as bright as they do.
fn is_hidden_by_surfaces(search: &Search<'_>, alone: &Alone, found: &Found) -> bool {
    let surfaces = found.set.iter().any(|n| is_of_surfaces(n));
    surfaces && bends_values(alone.name) && search.gains(&alone.against, &alone.scores)
}

fn why(search: &Search<'_>, alone: &Alone, candidate: &CandidateSpec, found: &Found) -> String {
    let before = found.before.mean();
    let share = 100.0 * (before - gap_alone(found, alone)) / before.max(1e-9);
    if !search.gains(&alone.against, &alone.scores) {
        return format!("alone it does not lower the gap beyond chance ({share:+.1} %)");
    }
    if found.set.is_empty() {
        return format!(
            "it lowers the gap by {share:.1} % only, and leaves the rest unexplained: too little to name it as the \
             cause"
        );
    }
    if is_hidden_by_surfaces(search, alone, found) {
        return format!(
            "alone it would lower the gap by {share:.1} %; beside factors of the surfaces (scene_radiance) it cannot \
             be told: both change a surface that stays as bright alike"
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
