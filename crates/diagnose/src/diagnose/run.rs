//! A diagnosis from beginning to end.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use super::budget::{Budget, Count, Stage, in_time};
use super::cover::Cover;
use super::decide::{Facts, decide};
use super::describe::{describe, undetermined, without_motion, without_time};
use super::description::{Objects, Parts};
use super::evidence::Evidence;
use super::forward::Forward;
use super::found::{Found, PERCEPTS, SEARCH};
use super::journal::{Journal, key};
use super::light::lights;
use super::model::{Theta, candidate_of};
use super::output::{Shown, show, time_of_writing};
use super::pair::{Aligned, FEW, Geometry, Pair, needs_more};
use super::question::Question;
use super::report::*;
use super::search::{Search, Watch, all_names, moves};
use super::settings::{apply, theta_of};
use super::setup_checks;
use super::task::{Drawn, FramePercepts, figures, percepts};
use shutterbug::capture::{CameraFile, Capture};
use shutterbug::chain::Settings;
use shutterbug::error::{Error, Result};
use shutterbug::gpu::Context;

/// How often where frames are compared is looked for.
const COVER_ROUNDS: usize = 2;
/// Speed below which nothing about time can be seen: px over one frame period, of the fastest tenth of the picture.
const LEAST_MOTION_PX: f64 = 0.5;

/// What to consider.
#[derive(Clone, Debug, Default)]
pub struct DiagnoseOptions {
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Candidates to leave out, by name: for checks that an effect outside the list is not sold as one inside it.
    pub without: Vec<String>,
    /// Whether surfaces are exactly as bright as the scene says: else factors of theirs are a candidate.
    pub scene_exact: bool,
    /// Whether poses are exact: else errors of theirs are a candidate.
    pub poses_exact: bool,
    /// When to come to an end with what is known by then; candidates that were not reached are `undetermined`.
    pub time_limit: Option<Duration>,
    /// Since when that counts: since the call, or since a program began to read what it gives.
    pub begun: Option<Instant>,
    /// Where to keep what has been worked out; a diagnosis that was stopped goes on from there.
    pub journal: Option<PathBuf>,
    /// Of folders that are not paired: a command with `{a}` and `{b}` in the places of two folders of pictures, which prints a distance.
    pub distance: Option<String>,
    /// Ends the diagnosis with [`Error::DiagnosisInterrupted`] soon after it becomes true.
    pub stop: Option<Arc<AtomicBool>>,
}

impl DiagnoseOptions {
    /// What of the description may be wrong. Photographs of a camera at rest have poses and light of their own.
    fn description(&self, at_rest: bool) -> Vec<&'static str> {
        let exact = |n: &&str| if *n == "scene_radiance" { self.scene_exact } else { self.poses_exact };
        super::description::NAMES.into_iter().filter(|n| !at_rest && !exact(n)).collect()
    }
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
    /// What the description should be.
    pub(super) description: Parts,
    /// By frame.
    pub(super) percepts: Vec<FramePercepts>,
}

/// Names of all candidates, in light-path order.
pub fn effect_names() -> Vec<&'static str> {
    all_names()
}

/// Whether a candidate changes where or when things are seen, and not only their values.
///
/// # Panics
/// If there is no such candidate.
pub fn changes_places(name: &str) -> bool {
    moves(candidate_of(name))
}

struct Relay<'a> {
    progress: &'a mut dyn Progress,
    journal: Arc<Mutex<Journal>>,
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
        let steps = self.steps.max(self.step);
        let mut journal = self.journal.lock().expect("nobody panics while it is held");
        // A step is for people: what cannot be written, or a stop, comes up with the next result or render.
        let _ = journal.step(&self.stage, what, self.step, steps);
        drop(journal);
        self.progress.step(&self.stage, what, self.step, steps);
    }
}

/// What is diagnosed: a capture, rendered on a device, or what stands for one where another simulator made the frames.
struct Given<'a> {
    capture: &'a Capture,
    /// Folder of the real frames.
    real: PathBuf,
    context: Option<&'a Arc<Context>>,
    pair: Option<&'a Pair>,
}

impl Given<'_> {
    /// What of the description may be wrong. Photographs of a camera at rest have poses and light of their own; pictures without
    /// depth say neither.
    fn room(&self, options: &DiagnoseOptions) -> Vec<&'static str> {
        let posed = self.pair.is_none_or(|p| p.sim.geometry == Geometry::Depth);
        if posed { options.description(self.capture.camera.static_camera) } else { Vec::new() }
    }

    fn device(&self) -> String {
        self.context.map_or_else(|| "none: frames are given".to_owned(), |c| c.info().name.clone())
    }

    fn key(&self, evidence: &Evidence, options: &DiagnoseOptions) -> String {
        let sim = self.pair.map(|p| p.sim.sha256()).unwrap_or_default();
        key(&format!("{} {sim}", self.device()), self.capture, evidence, options)
    }

    /// What the simulation shows before the diagnosis.
    fn settings(&self) -> Settings {
        if self.pair.is_some() { Settings::default() } else { self.capture.camera.settings.clone() }
    }

    /// The camera that the simulation is compared as: what the frames of another simulator show is in them.
    fn base(&self) -> Theta {
        if self.pair.is_some() { Theta::neutral() } else { theta_of(&self.capture.camera.settings) }
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
    let real = capture.root.join("real");
    diagnose_given(&Given { capture, real, context: Some(context), pair: None }, options, progress)
}

/// Diagnoses real frames beside those of another simulator. No device is needed.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_pair(
    pair: &Pair,
    options: &DiagnoseOptions,
    progress: &mut dyn Progress,
) -> Result<Diagnosis> {
    let given = Given { capture: &pair.capture, real: pair.real.clone(), context: None, pair: Some(pair) };
    diagnose_given(&given, options, progress)
}

fn diagnose_given(
    given: &Given<'_>,
    options: &DiagnoseOptions,
    progress: &mut dyn Progress,
) -> Result<Diagnosis> {
    let clock = options.begun.unwrap_or_else(Instant::now);
    let capture = given.capture;
    let names = candidates(options)?;
    let mut budget = Budget::new(clock, options.time_limit);
    let mut evidence = Evidence::read(capture, &given.real, &budget)?;
    evidence.warnings.extend(given.pair.iter().flat_map(|p| p.notes.clone()));
    let journal = Journal::open(options, || given.key(&evidence, options))?;
    if journal.found > 0 {
        progress.step("going on", &format!("{} results of an earlier run are there", journal.found), 1, 1);
    }
    budget.count = Count { all: evidence.frames.len(), report: evidence.report.len() };
    if budget.is_limited() {
        budget.has_written(time_of_writing(&evidence.frames[0].dn));
    }
    let sim = given.pair.map(|p| &p.sim);
    let mut forward = Forward::new(given.context, capture, &evidence, sim, budget)?;
    let journal = Arc::new(Mutex::new(journal));
    forward.journal = journal.clone();
    let base = given.base();
    let aligned = given.pair.map(|_| super::pair::align(&mut forward, &evidence)).transpose()?;
    let compared = capture.camera.background_ignored || given.pair.is_some();
    let mut cover = compared.then(|| Cover::new(&forward, &base, &capture.camera.path)).transpose()?;
    let set_up = setup_checks::look(&mut forward, &evidence, &base)?;
    set_up.iter().for_each(|what| progress.step("set-up", what, 1, 1));
    let told = Told::new(&forward, &evidence, given, aligned.as_ref());
    let mut relay = Relay { progress, journal, stage: String::new(), step: 0, steps: 0 };
    let tried: Vec<&'static str> = names.iter().copied().filter(|n| told.why_not(n).is_none()).collect();
    let shown = super::shown::Shown::in_frames(&evidence, &names, &base);
    let question = Question {
        evidence: &evidence,
        base,
        seed: options.seed,
        names: tried,
        room: given.room(options),
        shown,
    };
    if forward.static_camera {
        let masks = cover.as_ref().map(|c| c.masks.as_slice());
        forward.light = lights(&mut forward, &evidence, &question.base, masks)?;
    }
    for _ in 0..COVER_ROUNDS {
        let Some(known) = &mut cover else { break };
        forward.budget.stage = Stage::Search;
        let narrowed = in_time(question.narrow(&mut forward, known, &mut relay))?;
        forward.budget.stage = Stage::Begin;
        if narrowed != Some(true) {
            break;
        }
    }
    let masks = cover.as_ref().map(|c| c.masks.as_slice());
    let seen = question.look(&mut forward, masks)?;
    let (mut objects, elsewhere, seen_elsewhere);
    let mut search = question.search(&mut forward, &seen, masks);
    let mut found;
    (found, objects) = searched(&mut search, &mut relay)?;
    if let Some(objects_there) = &objects {
        let forward = search.forward;
        forward.compared += 1;
        forward.budget.stage = Stage::Must;
        elsewhere = objects_there.masks.clone();
        seen_elsewhere = question.look(forward, Some(&elsewhere))?;
        search = question.search(forward, &seen_elsewhere, Some(&elsewhere));
        let first = found.clone();
        search.forward.budget.stage = Stage::Search;
        let again = in_time(searched(&mut search, &mut relay))?.map(|(found, _)| found);
        let unknown = |found: &Found| {
            found.is_whole() && decide(&Facts::of(&search, found)).verdict == Verdict::UnknownEffect
        };
        let is_unknown = again.as_ref().is_none_or(unknown);
        found = again.unwrap_or(first.clone());
        if is_unknown {
            // What is left elsewhere is left by something that is no object: as if none had been found.
            objects = None;
            search.forward.compared -= 1;
            search = question.search(search.forward, &seen, masks);
            search.forward.budget.stage = Stage::Search;
            found = match in_time(searched(&mut search, &mut relay))? {
                Some((found, _)) => found,
                None => {
                    search.end_as(&first);
                    Found { left_out: vec![SEARCH], ..first }
                }
            };
        }
    }
    let mut report = describe(&mut search, &mut found, &evidence, capture)?;
    if let Some(objects) = &objects {
        say_objects(&mut report, objects);
    }
    report.candidates.extend(names.iter().filter_map(|n| told.why_not(n)));
    add_late(&mut report, &found);
    setup_checks::begin(&mut report, &set_up, &evidence, &found);
    report.warnings.extend(super::light::said(&search.forward.light));
    if given.pair.is_none() {
        report.warnings.extend(not_simulated(capture));
        report.warnings.extend(uncontrolled(&capture.camera.settings));
    }
    report.input.device = given.device();
    report.input.seed = options.seed;
    let frames = show(&mut search, &mut found, &evidence, &mut report)?;
    if let Some(aligned) = aligned {
        report.input.kind = "pair".to_owned();
        report.input.method = aligned.method.to_owned();
        report.input.alignment = Some(aligned.of(&frames));
    }
    let mut camera = capture.camera.clone();
    for name in apply(&mut camera.settings, &found.fit.theta, &found.set)? {
        report
            .warnings
            .push(format!("{name} was found, but `simulate` cannot make it yet: camera.toml lacks it"));
    }
    let before = Drawn { theta: &search.base.clone(), settings: &given.settings() };
    let after = Drawn { theta: &found.fit.theta, settings: &camera.settings };
    search.forward.budget.stage = Stage::End;
    let percepts = match in_time(percepts(search.forward, &frames, &before, &after))? {
        Some(percepts) => {
            report.percepts = figures(&frames, &percepts);
            percepts
        }
        None => {
            found.leave_out(PERCEPTS);
            Vec::new()
        }
    };
    search.forward.budget.stage = Stage::Must;
    report.warnings.extend(found.said());
    report.next = if given.pair.is_some() { next_of_pair(&report) } else { next(&report, capture) };
    (report.input.renders, report.input.render_seconds) = search.forward.renders;
    report.input.seconds = clock.elapsed().as_secs_f64();
    let mut description = search.description_parts(&found.fit.theta)?;
    if let Some(objects) = &objects {
        description.add(objects, &evidence);
    }
    Ok(Diagnosis { report, camera, frames, description, percepts })
}

/// Names what the scene does not have, whose places were left out of every figure.
fn say_objects(report: &mut Report, objects: &Objects) {
    let (gap, none) = (report.gap.after, report.gap.after - report.gap.before);
    let share = Parameter { value: serde_json::json!(objects.share), ci95: None, unit: String::new() };
    report.effects.push(EffectFound {
        name: "undescribed_object".to_owned(),
        share: 0.0,
        parameters: [("pixel_share".to_owned(), share)].into(),
        camera: false,
        gap_without: gap,
        gap_with: gap,
        gap_alone: report.gap.before,
        gain_ci95: [0.0, f64::max(none, 0.0)],
        alternatives: Vec::new(),
        footage: String::new(),
    });
    if report.verdict == Verdict::NoGap {
        report.verdict = Verdict::Explained;
    }
    let covers = format!(
        "Something that the scene does not have, or that moves otherwise than described, covers {:.1} % of the frames. \
         Its places were left out. Elsewhere: ",
        100.0 * objects.share
    );
    report.sentence.insert_str(0, &covers);
}

/// Candidates for which there was no time.
fn add_late(report: &mut Report, found: &Found) {
    for name in &found.late {
        report.candidates.retain(|c| c.name != *name);
        if !found.set.contains(name) {
            report.candidates.push(without_time(name));
        }
    }
}

/// Why some candidates are not tried.
struct Told {
    /// See [`typical_motion_px`]; nothing where a camera rests.
    motion_px: Option<f64>,
    geometry: Option<Geometry>,
    aligned: bool,
    /// Whether there are a few stills only.
    stills: bool,
}

impl Told {
    fn new(forward: &Forward, evidence: &Evidence, given: &Given<'_>, aligned: Option<&Aligned>) -> Self {
        let motion_px = typical_motion_px(forward, evidence);
        Self {
            motion_px: (!given.capture.camera.static_camera).then_some(motion_px),
            geometry: given.pair.map(|p| p.sim.geometry),
            aligned: aligned.is_some_and(|a| a.is_rough()),
            stills: given.pair.is_some_and(|p| p.stills),
        }
    }

    /// What the report says of a candidate that these frames cannot tell of.
    fn why_not(&self, name: &str) -> Option<Candidate> {
        let (candidate, moves) = (candidate_of(name), changes_places(name));
        if self.geometry == Some(Geometry::None) && candidate.needs_motion {
            return Some(undetermined(name, NO_MOTION[0], NO_MOTION[1]));
        }
        if self.stills && needs_more(name) {
            return Some(undetermined(name, FEW[0], FEW[1]));
        }
        if self.aligned && moves && name != "chromatic_aberration" {
            return Some(undetermined(name, ROUGH[0], ROUGH[1]));
        }
        let rests = self.motion_px.is_none_or(|px| px < LEAST_MOTION_PX);
        (candidate.needs_motion && rests).then(|| without_motion(name, self.motion_px.unwrap_or(0.0)))
    }
}

/// Why time is not told of by pictures alone, and what to give.
const NO_MOTION: [&str; 2] = [
    "pictures alone do not say how the content moves while a frame is taken",
    "depth/ with trajectory.tum, or motion/, beside the simulated frames",
];
/// Why geometry is not told of by frames that had to be warped, and what to give.
const ROUGH: [&str; 2] = [
    "each simulated frame was warped to lie on the real one, which hides what moves places",
    "simulated frames at the poses of the real ones, or depth/ with trajectory.tum beside them",
];

/// Searches with the description as it stands, and once more with one that may be wrong where that leaves more on the frames to
/// choose by than the discrepancy can make: a description is questioned only where no camera explains the frames. First of
/// all by what is in few places: where these are, if the rest is explained without them, is returned too.
fn searched(search: &mut Search<'_>, watch: &mut dyn Watch) -> Result<(Found, Option<Objects>)> {
    let room = std::mem::take(&mut search.room);
    let exact = search.run(watch)?;
    let left = in_time(search.judge.scores(search.forward, &exact.fit.theta))?;
    if room.is_empty() || left.as_ref().is_some_and(|left| left.beyond_bounds().is_empty()) {
        return Ok((exact, None));
    }
    let late = |mut found: Found, room: &[&'static str]| {
        room.iter().for_each(|n| found.is_late(n));
        Ok((found, None))
    };
    search.forward.budget.stage = Stage::Search;
    if left.is_none() || search.late() || !exact.is_whole() {
        return late(exact, &room);
    }
    let asked = room.contains(&"scene_radiance");
    let Some(objects) = in_time(if asked { search.undescribed(&exact) } else { Ok(None) })? else {
        return late(exact, &room);
    };
    if objects.is_some() {
        return Ok((exact, objects));
    }
    tracing::info!("{:?} leaves more than the discrepancy: {room:?} may be wrong", exact.set);
    search.begin_anew(room.clone());
    let Some(free) = in_time(search.run(watch))? else {
        search.end_as(&exact);
        return late(exact, &room);
    };
    search.forward.budget.stage = Stage::End;
    let questioned = free.set.iter().any(|name| super::description::is_description(name));
    if questioned && (free.is_whole() || in_time(search.explains_more(&free, &exact))? == Some(true)) {
        let objects = if asked { in_time(search.undescribed(&free))?.flatten() } else { None };
        return Ok((free, objects));
    }
    search.end_as(&exact);
    let mut exact = exact;
    if !free.is_whole() {
        exact.leave_out(SEARCH);
        room.iter().for_each(|n| exact.is_late(n));
    }
    Ok((exact, None))
}

/// What is said of a given camera with automatic exposure: frames are judged one by one and in parts, so that the control,
/// which needs all frames before, is not run; a gain that changes from frame to frame stays in the gap.
fn uncontrolled(given: &shutterbug::chain::Settings) -> Option<String> {
    use shutterbug::chain::Effect as _;
    (shutterbug::effects::AutoExposure.variant(given) != 0).then(|| {
        "auto_exposure of the given camera is not simulated here (frames are judged one by one): all frames have \
         exposure_gain alone, and what the control changed from frame to frame counts as gap"
            .to_owned()
    })
}

fn next_of_pair(report: &Report) -> Vec<NextStep> {
    let undetermined = report.candidates.iter().filter(|c| c.state == CandidateState::Undetermined);
    let mut steps: Vec<NextStep> = Vec::new();
    for candidate in undetermined.filter(|c| !c.footage.is_empty()) {
        let purpose = format!("decide {}: supply {}", candidate.name, candidate.footage);
        if steps.len() < 3 {
            let command = "shutterbug diagnose --sim SIM --real REAL --out DIR".to_owned();
            steps.push(NextStep { purpose, command });
        }
    }
    steps
}

fn next(report: &Report, capture: &Capture) -> Vec<NextStep> {
    let root = capture.root.display();
    let mut steps = Vec::new();
    if !report.effects.is_empty() {
        let corrected = report.effects.iter().any(|e| !e.camera);
        let description = if corrected { " --description DIR" } else { "" };
        steps.push(NextStep {
            purpose: "simulate with the effects found (DIR is this report's folder)".to_owned(),
            command: format!(
                "shutterbug simulate {root} --camera DIR/camera.toml{description} --method exact --out FRAMES"
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

/// Effects of the given camera that the simulation here leaves out.
fn not_simulated(capture: &Capture) -> Vec<String> {
    let known = &capture.camera.settings;
    let left_out = shutterbug::effects::LIST.iter().filter(|e| {
        let candidate = super::model::CANDIDATES.iter().any(|c| c.name == e.id());
        known.has(e.id()) && !candidate && !known.is_neutral(e.id(), e.specs())
    });
    let said = |e: &&dyn shutterbug::chain::Effect| {
        match e.id() {
        "auto_exposure" => "camera.toml has [auto_exposure], which diagnose does not simulate: its gain changes from frame to \
                            frame, and what it changes is part of the gap here. Record with the exposure locked, or take it \
                            out of camera.toml and look at where.by_frame"
            .to_owned(),
        name => {
            format!("camera.toml has [{name}], which diagnose does not simulate: what it does is part of the gap here")
        }
    }
    };
    left_out.map(said).collect()
}

pub(super) fn candidates(options: &DiagnoseOptions) -> Result<Vec<&'static str>> {
    let all = all_names();
    for name in &options.without {
        if !all.contains(&name.as_str()) {
            let path = std::path::Path::new("--without");
            return Err(Error::unknown_name(path, None, "candidate", name, all));
        }
    }
    Ok(all.into_iter().filter(|n| !options.without.iter().any(|w| w == n)).collect())
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

#[cfg(test)]
mod tests {
    use super::uncontrolled;
    use shutterbug::chain::{Settings, Value};
    use shutterbug::effects::AutoExposure;

    #[test]
    fn a_camera_with_automatic_exposure_is_said_to_be_simulated_without() {
        let mut given = Settings::default();
        assert_eq!(uncontrolled(&given), None);
        given.set(&AutoExposure, "target", Value::Number(0.2)).expect("in range");
        assert!(
            uncontrolled(&given)
                .expect("said")
                .contains("auto_exposure of the given camera is not simulated")
        );
    }
}
