//! A diagnosis from beginning to end.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::evidence::Evidence;
use super::forward::{Forward, Quality};
use super::hot::HotMap;
use super::judge::{Judge, Scores, closed_fraction};
use super::model::{CandidateSpec, Theta, candidate_of};
use super::output::Shown;
use super::places::{Compared, measures, places};
use super::report::*;
use super::search::{Found, Search, Watch, all_names};
use super::settings::{apply, theta_of};
use crate::capture::{CameraFile, Capture};
use crate::error::{Error, Result};
use crate::gpu::Context;
use crate::plane::Plane;

/// Speed below which nothing about time can be seen: px over one frame period, of the fastest tenth of the picture.
const LEAST_MOTION_PX: f64 = 0.5;

/// What to consider.
#[derive(Clone, Debug, Default)]
pub struct DiagnoseOptions {
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Candidates to leave out, by name: for checks that an effect outside the list is not sold as one inside it.
    pub without: Vec<String>,
    /// When to come to an end with what is known by then; candidates that were not reached are `undetermined`.
    pub time_limit: Option<Duration>,
}

/// Told where a diagnosis stands: the stage, the candidate, and which of how many steps of the stage it is.
pub trait Progress {
    /// A step begins.
    fn step(&mut self, stage: &str, what: &str, step: usize, steps: usize);
}

/// A finished diagnosis.
pub struct Diagnosis {
    /// What was found.
    pub report: Report,
    /// The given camera with the effects found.
    pub camera: CameraFile,
    /// What [`Diagnosis::write`] makes pictures of.
    pub(super) frames: Vec<Shown>,
}

/// Names of all candidates, in light-path order.
pub fn effect_names() -> Vec<&'static str> {
    all_names()
}

struct Relay<'a> {
    progress: &'a mut dyn Progress,
    stage: String,
    step: usize,
    steps: usize,
}

impl Watch for Relay<'_> {
    fn stage(&mut self, name: &str, steps: usize) {
        (self.stage, self.step, self.steps) = (name.to_owned(), 0, steps);
    }

    fn step(&mut self, what: &str) {
        self.step += 1;
        self.progress.step(&self.stage, what, self.step, self.steps.max(self.step));
    }
}

/// Diagnoses a capture with real frames.
///
/// # Errors
/// Frames that are missing, of another size, or too few; names in `without` that are no candidate's; errors of the
/// device.
pub fn diagnose(
    context: &Arc<Context>,
    capture: &Capture,
    options: &DiagnoseOptions,
    progress: &mut dyn Progress,
) -> Result<Diagnosis> {
    let clock = Instant::now();
    let names = candidates(options)?;
    let evidence = Evidence::read(capture)?;
    let mut forward = Forward::new(context, capture, &evidence)?;
    let masks = if capture.camera.background_ignored { Some(masks(&forward, capture)?) } else { None };
    let base = theta_of(&capture.camera.settings);
    let motion_px = typical_motion_px(&forward, &evidence);
    let moving = motion_px >= LEAST_MOTION_PX && !capture.camera.static_camera;
    let tried = names.iter().copied().filter(|n| moving || !candidate_of(n).needs_motion).collect();
    let means = forward.simulate(&evidence.fit, &base, Quality::Fit)?;
    let renderer_difference = renderer_difference(&means);
    let hot = HotMap::find(&evidence, &evidence.fit, &means);
    let fit_masks = fit_masks(&evidence, masks.as_deref(), &hot);
    let mut search = Search {
        judge: Judge::new(&evidence, masks.as_deref(), options.seed, hot),
        forward: &mut forward,
        evidence: &evidence,
        masks: &fit_masks,
        base,
        renderer_difference,
        names: tried,
        deadline: options.time_limit.map(|limit| clock + limit),
    };
    let mut relay = Relay { progress, stage: String::new(), step: 0, steps: 0 };
    let found = search.run(&mut relay)?;
    let mut report = describe(&mut search, &found, &evidence, capture)?;
    for name in names.iter().filter(|n| candidate_of(n).needs_motion && !moving) {
        report.candidates.push(without_motion(name, motion_px));
    }
    report.input.device = context.info().name.clone();
    report.input.seed = options.seed;
    let frames = show(&mut search, &found, &evidence, &mut report)?;
    let mut camera = capture.camera.clone();
    for name in apply(&mut camera.settings, &found.fit.theta, &found.set)? {
        report
            .warnings
            .push(format!("{name} was found, but `simulate` cannot make it yet: camera.toml lacks it"));
    }
    report.next = next(&report, capture);
    report.input.seconds = clock.elapsed().as_secs_f64();
    Ok(Diagnosis { report, camera, frames })
}

/// Simulates all frames of the evidence before and after, and says where they differ.
fn show(
    search: &mut Search<'_>,
    found: &Found,
    evidence: &Evidence,
    report: &mut Report,
) -> Result<Vec<Shown>> {
    let all: Vec<usize> = (0..evidence.frames.len()).collect();
    let base = search.base.clone();
    let scores = [
        search.judge.scores_on(search.forward, &base, &all)?,
        search.judge.scores_on(search.forward, &found.fit.theta, &all)?,
    ];
    let before = search.forward.simulate(&all, &base, Quality::Fine)?;
    let mut after = search.forward.simulate(&all, &found.fit.theta, Quality::Fine)?;
    if found.fit.theta.get(super::model::P::Hot) > 0.0 {
        after.iter_mut().for_each(|m| search.judge.hot.put(m));
    }
    let held: Vec<Compared<'_>> = evidence
        .held_out
        .iter()
        .map(|&at| Compared {
            index: evidence.frames[at].index,
            real: &evidence.frames[at].dn,
            before: &before[at],
            after: &after[at],
            mask: search.judge.masks.map(|m| &m[at]),
            sharp: &search.forward.sharp[at],
        })
        .collect();
    report.places = places(&held, search.forward, evidence, report.verdict == Verdict::NoGap);
    report.measures = measures(&held);
    let shown = all.iter().zip(before.into_iter().zip(after)).map(|(&at, (before, after))| Shown {
        index: evidence.frames[at].index,
        start_s: evidence.frames[at].start_s,
        held_out: evidence.held_out.contains(&at),
        scores: [scores[0].0[at].score, scores[1].0[at].score],
        real: evidence.frames[at].dn.clone(),
        before,
        after,
    });
    Ok(shown.collect())
}

fn next(report: &Report, capture: &Capture) -> Vec<NextStep> {
    let root = capture.root.display();
    let mut steps = Vec::new();
    if !report.effects.is_empty() {
        steps.push(NextStep {
            purpose: "simulate with the effects found (DIR is this report's folder)".to_owned(),
            command: format!(
                "shutterbug simulate {root} --camera DIR/camera.toml --method exact --out FRAMES"
            ),
        });
    }
    if report.candidates.iter().any(|c| c.state == CandidateState::Undetermined) {
        steps.push(NextStep {
            purpose: "decide what is undetermined: record the footage that it names, and diagnose that"
                .to_owned(),
            command: "shutterbug diagnose NEW_CAPTURE --out DIR".to_owned(),
        });
    }
    steps
}

fn candidates(options: &DiagnoseOptions) -> Result<Vec<&'static str>> {
    let all = all_names();
    for name in &options.without {
        if !all.contains(&name.as_str()) {
            let path = std::path::Path::new("--without");
            return Err(Error::unknown_name(path, None, "candidate", name, all));
        }
    }
    Ok(all.into_iter().filter(|n| !options.without.iter().any(|w| w == n)).collect())
}

/// Where geometry covers the pixel and its surroundings; elsewhere a moved picture would show the background.
fn masks(forward: &Forward, capture: &Capture) -> Result<Vec<Plane<f32>>> {
    const ROOM_PX: usize = 6;
    let mut open = 0.0;
    let masks: Vec<_> = forward
        .sharp
        .iter()
        .map(|s| {
            let (w, h) = (s.coverage.width, s.coverage.height);
            let covered = |x: usize, y: usize| s.coverage.pixel(x, y)[0] > 0.999;
            let across = Plane::from_fn(w, h, |x, y| {
                let all = (x.saturating_sub(ROOM_PX)..(x + ROOM_PX + 1).min(w)).all(|u| covered(u, y));
                [f32::from(u8::from(all))]
            });
            let mask = Plane::from_fn(w, h, |x, y| {
                let rows = y.saturating_sub(ROOM_PX)..(y + ROOM_PX + 1).min(h);
                [f32::from(u8::from(rows.into_iter().all(|v| across.pixel(x, v)[0] > 0.5)))]
            });
            open += mask.data.iter().sum::<f32>() / mask.data.len() as f32;
            mask
        })
        .collect();
    if open / (masks.len().max(1) as f32) < 0.01 {
        let found = "background = \"ignore\" leaves less than 1 % of the pixels to compare";
        return Err(Error::input(&capture.camera.path, None, found, "a scene that fills more of the frames"));
    }
    Ok(masks)
}

/// Where fits compare: where the judge does, less the stuck pixels.
fn fit_masks(evidence: &Evidence, masks: Option<&[Plane<f32>]>, hot: &HotMap) -> Vec<Plane<f32>> {
    let open = || {
        let all = evidence.frames.iter().map(|f| Plane::from_fn(f.dn.width, f.dn.height, |_, _| [1.0]));
        all.collect()
    };
    let mut fit_masks = masks.map_or_else(open, <[Plane<f32>]>::to_vec);
    hot.close(&mut fit_masks);
    fit_masks
}

/// How far the fastest tenth of the picture moves over one frame period, px.
fn typical_motion_px(forward: &Forward, evidence: &Evidence) -> f64 {
    let mut speeds: Vec<f32> = Vec::new();
    for sharp in &forward.sharp[..evidence.frames.len()] {
        speeds.extend(sharp.velocity.data.chunks_exact(2).step_by(7).map(|v| v[0].hypot(v[1])));
    }
    let at = speeds.len() * 9 / 10;
    let fast = *speeds.select_nth_unstable_by(at, f32::total_cmp).1;
    f64::from(fast) * forward.period_s
}

/// What two correct renderers may differ by, DN: a sampling error at edges. Measured on captures of an independent path
/// tracer: 0.15 to 0.6 where the mean gradient is 3 to 9 DN a px.
fn renderer_difference(means: &[Plane<f32>]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for mean in means {
        for y in 1..mean.height {
            for x in 1..mean.width {
                let here = mean.pixel(x, y);
                let (left, above) = (mean.pixel(x - 1, y), mean.pixel(x, y - 1));
                for c in 0..3 {
                    sum += f64::from((here[c] - left[c]).hypot(here[c] - above[c]));
                    count += 1.0;
                }
            }
        }
    }
    0.1 + 0.06 * sum / f64::max(count, 1.0)
}

fn without_motion(name: &str, motion_px: f64) -> Candidate {
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

fn describe(
    search: &mut Search<'_>,
    found: &Found,
    evidence: &Evidence,
    capture: &Capture,
) -> Result<Report> {
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
    let verdict = verdict(&gap, found);
    let effects = effects(search, found)?;
    let candidates = rejected(search, found);
    let place_of = |f: &usize| evidence.frames[*f].index;
    let k = &capture.camera.intrinsics;
    Ok(Report {
        verdict,
        sentence: sentence(verdict, &gap, &effects),
        waterfall: waterfall(&gap, &effects),
        gap,
        effects,
        candidates,
        places: Where::default(),
        measures: Vec::new(),
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
        warnings: evidence.warnings.clone(),
        next: Vec::new(),
    })
}

fn verdict(gap: &Gap, found: &Found) -> Verdict {
    // Twice: the estimate is of the mean, and scenes differ.
    let nothing = 2.0 * gap.renderer_difference;
    let rest = gap.after - gap.floor;
    if found.set.is_empty() {
        return if gap.before <= nothing { Verdict::NoGap } else { Verdict::UnknownEffect };
    }
    if rest <= nothing.max(0.1 * (gap.before - gap.floor)) {
        Verdict::Explained
    } else if gap.closed_fraction < 0.1 {
        Verdict::UnknownEffect
    } else {
        Verdict::PartlyExplained
    }
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
        Verdict::UnknownEffect => format!(
            "The frames differ by {:.2} DN, and no known effect of the camera explains it.",
            gap.before
        ),
    }
}

/// Supported effects with their Shapley shares.
fn effects(search: &mut Search<'_>, found: &Found) -> Result<Vec<EffectFound>> {
    let set = &found.set;
    let shares = shapley(search, found)?;
    let mut out = Vec::new();
    for (i, name) in set.iter().enumerate() {
        let without =
            if set.len() == 1 { found.before.clone() } else { search.leave_out(set, i, &found.fit)?.1 };
        let alone = found.alone.iter().find(|a| a.name == *name);
        let (_, gain_ci95) = search.judge.gain(&without, &found.after);
        out.push(EffectFound {
            name: (*name).to_owned(),
            share: shares[i],
            parameters: found.fit.theta.report(candidate_of(name), &found.fit.half),
            gap_without: without.mean(),
            gap_with: found.after.mean(),
            gap_alone: alone.map_or(found.before.mean(), |a| a.scores.mean()),
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
                theta = super::search::restored(&theta, &search.base, candidate_of(name));
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

fn rejected(search: &Search<'_>, found: &Found) -> Vec<Candidate> {
    let before = &found.before;
    let others = found.alone.iter().filter(|a| !found.set.contains(&a.name));
    others
        .map(|a| Candidate {
            name: a.name.to_owned(),
            state: CandidateState::Rejected,
            why: why(search, before, &a.scores, candidate_of(a.name), found),
            gap_with: Some(a.scores.mean()),
            parameters: a.fit.theta.report(candidate_of(a.name), &a.fit.half),
            footage: String::new(),
        })
        .collect()
}

fn why(
    search: &Search<'_>,
    before: &Scores,
    with: &Scores,
    candidate: &CandidateSpec,
    found: &Found,
) -> String {
    let (gain, [low, _]) = search.judge.gain(before, with);
    let share = 100.0 * gain / before.mean().max(1e-9);
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
