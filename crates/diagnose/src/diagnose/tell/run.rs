//! A diagnosis from beginning to end.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use super::advice::{next, next_of_pair, not_simulated, uncontrolled};
use super::describe::{describe, undetermined, without_motion, without_time};
use super::output::{Diagnosis, show, time_of_writing};
use super::setup_checks;
use super::task::{Drawn, FramePercepts, figures, percepts};
use crate::diagnose::evidence::budget::{Budget, Budgeted, Count, Stage, in_time};
use crate::diagnose::evidence::{Evidence, RealFrame};
use crate::diagnose::expect::compared::Shown;
use crate::diagnose::expect::cover::Cover;
use crate::diagnose::expect::forward::{Forward, Reduced};
use crate::diagnose::expect::journal::{Journal, key};
use crate::diagnose::expect::light::lights;
use crate::diagnose::expect::model::{Theta, candidate_of};
use crate::diagnose::expect::options::{DiagnoseOptions, Progress, candidates, changes_places};
use crate::diagnose::expect::pair::{Aligned, FEW, Geometry, Pair, needs_more};
use crate::diagnose::expect::settings::{apply, theta_of};
use crate::diagnose::report::*;
use crate::diagnose::search::decide::MOST_COMPARED;
use crate::diagnose::search::found::{Found, PERCEPTS};
use crate::diagnose::search::objects::Objects;
use crate::diagnose::search::question::Question;
use crate::diagnose::search::searches::{Outcome, search_all};
use crate::diagnose::search::{Search, Watch};
use shutterbug::capture::{CameraFile, Capture};
use shutterbug::chain::Settings;
use shutterbug::error::{Result, counted};
use shutterbug::gpu::Context;

/// How often where frames are compared is looked for.
const COVER_ROUNDS: usize = 2;
/// Speed below which nothing about time can be seen: px over one frame period, of the fastest tenth of the picture.
const LEAST_MOTION_PX: f64 = 0.5;

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
    /// What of the description may be wrong. Photographs of a camera at rest have poses and light of their own;
    /// pictures without depth say neither.
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
    let names = candidates(options)?;
    let Prepared { evidence, mut forward, mut cover, aligned, set_up, journal } =
        prepare(given, options, clock, progress)?;
    let told = Told::new(&forward, &evidence, given, aligned.as_ref());
    let base = given.base();
    let question = Question {
        evidence: &evidence,
        seed: options.seed,
        names: names.iter().copied().filter(|n| told.why_not(n).is_none()).collect(),
        room: given.room(options),
        shown: crate::diagnose::search::shown::Shown::in_frames(&evidence, &names, &base),
        base,
    };
    let mut relay = Relay { progress, journal, stage: String::new(), step: 0, steps: 0 };
    find_compared_places(&question, &mut forward, cover.as_mut(), &mut relay)?;
    let masks = cover.as_ref().map(|c| c.masks.as_slice());
    let seen = question.look(&mut forward, masks)?;
    let mut elsewhere = None;
    let mut outcome = search_all(&question, &mut forward, (&seen, masks), &mut elsewhere, &mut relay)?;
    let mut report = reported(given, &mut outcome, &evidence, &set_up)?;
    report.candidates.extend(names.iter().filter_map(|n| told.why_not(n)));
    add_late(&mut report, &outcome.found);
    report.input.seed = options.seed;
    let Outcome { mut search, mut found, objects } = outcome;
    search.budget().enter(Stage::Must);
    let frames = show(&mut search, &mut found, &evidence, &mut report)?;
    if let Some(aligned) = aligned {
        report.input.kind = "pair".to_owned();
        report.input.method = aligned.method.to_owned();
        report.input.alignment = Some(aligned.of(&frames));
        if aligned.is_rough() {
            say_rough(&mut report);
        }
    }
    let camera = corrected(given, &found, &mut report)?;
    let percepts = add_percepts(given, &mut search, &mut found, (&frames, &camera), &mut report)?;
    report.warnings.extend(found.said());
    report.next = if given.pair.is_some() { next_of_pair(&report) } else { next(&report, given.capture) };
    (report.input.renders, report.input.render_seconds) = search.forward.renders_made();
    report.input.seconds = clock.elapsed().as_secs_f64();
    let mut description = search.description_parts(&found.fit.theta)?;
    report.warnings.extend(description.late.iter().map(|l| l.said(|at| evidence.frames[at].index)));
    if let Some(objects) = &objects {
        description.add(objects, &evidence);
    }
    Ok(Diagnosis { report, camera, frames, description, percepts })
}

/// What stands before the first search.
struct Prepared {
    evidence: Evidence,
    forward: Forward,
    /// Where frames are compared, if not everywhere.
    cover: Option<Cover>,
    /// How given frames lie on the real ones.
    aligned: Option<Aligned>,
    /// What the checks of the set-up say.
    set_up: Vec<String>,
    journal: Arc<Mutex<Journal>>,
}

/// Reads the frames, simulates what is sharp in them, and checks the set-up.
fn prepare(
    given: &Given<'_>,
    options: &DiagnoseOptions,
    clock: Instant,
    progress: &mut dyn Progress,
) -> Result<Prepared> {
    let capture = given.capture;
    let mut budget = Budget::new(clock, options.time_limit);
    let mut evidence = Evidence::read(capture, &given.real, &budget)?;
    evidence.warnings.extend(given.pair.iter().flat_map(|p| p.notes.clone()));
    let journal = Journal::open(options, || given.key(&evidence, options))?;
    if journal.found > 0 {
        progress.step(
            "going on",
            &format!("{} of an earlier run found", counted(journal.found, "result", "results")),
            1,
            1,
        );
    }
    budget.count = Count { all: evidence.frames.len(), report: evidence.report.len() };
    if budget.is_limited() {
        budget.has_written(time_of_writing(&evidence.frames[0].dn));
    }
    let sim = given.pair.map(|p| &p.sim);
    let mut forward = Forward::new(given.context, capture, &evidence, sim, budget.clone())?;
    if let (Some(context), None) = (given.context, sim) {
        forward.reduced = Reduced::new(context, capture, &evidence, budget)?;
    }
    let journal = Arc::new(Mutex::new(journal));
    forward.keep_in(&journal);
    let base = given.base();
    let aligned =
        given.pair.map(|_| crate::diagnose::expect::pair::align(&mut forward, &evidence)).transpose()?;
    let compared = capture.camera.background_ignored || given.pair.is_some();
    let from = if given.pair.is_some() { &capture.root } else { &capture.camera.path };
    let cover = compared.then(|| Cover::new(&forward, &base, from)).transpose()?;
    let set_up = setup_checks::look(&mut forward, capture, &evidence, &base)?;
    set_up.iter().for_each(|what| progress.step("set-up", what, 1, 1));
    Ok(Prepared { evidence, forward, cover, aligned, set_up, journal })
}

/// Finds the light of photographs, and leaves out of `cover` what promising candidates do not cover.
fn find_compared_places(
    question: &Question<'_>,
    forward: &mut Forward,
    cover: Option<&mut Cover>,
    watch: &mut dyn Watch,
) -> Result<()> {
    if forward.static_camera {
        let masks = cover.as_ref().map(|c| c.masks.as_slice());
        forward.light = lights(forward, question.evidence, &question.base, masks)?;
    }
    let Some(cover) = cover else { return Ok(()) };
    for _ in 0..COVER_ROUNDS {
        let narrowed = forward.within(Stage::Search, |forward| question.narrow(forward, cover, watch));
        if in_time(narrowed)? != Some(true) {
            break;
        }
    }
    Ok(())
}

/// The report of what was found, with what the set-up and the given camera make of it.
fn reported(
    given: &Given<'_>,
    outcome: &mut Outcome<'_>,
    evidence: &Evidence,
    set_up: &[String],
) -> Result<Report> {
    let Outcome { search, found, objects } = outcome;
    search.budget().enter(Stage::End);
    let mut report = describe(search, found, evidence, given.capture)?;
    if let Some(objects) = objects {
        say_objects(&mut report, objects);
    }
    let odd = in_time(search.odd_frames(found))?;
    setup_checks::begin(&mut report, set_up, evidence, (found, odd));
    report.warnings.extend(crate::diagnose::expect::light::said(&search.forward.light));
    report.warnings.extend(masked(given, report.input.compared_share));
    if given.pair.is_some() {
        report
            .warnings
            .extend(in_time(setup_checks::noise::of_simulation(search, found, evidence))?.flatten());
    } else {
        report.warnings.extend(not_simulated(given.capture));
        report.warnings.extend(uncontrolled(&given.capture.camera.settings));
    }
    report.input.device = given.device();
    Ok(report)
}

/// Of masks that leave little: in somebody else's tool white may be what is left out.
fn masked(given: &Given<'_>, share: f64) -> Option<String> {
    let masks = given.capture.root.join("mask");
    (share < MOST_COMPARED && masks.is_dir()).then(|| {
        format!(
            "{:.0} % of the picture was compared: in {} 0 is what is left out; is it white there?",
            100.0 * share,
            masks.display()
        )
    })
}

/// The given camera with the effects found.
fn corrected(given: &Given<'_>, found: &Found, report: &mut Report) -> Result<CameraFile> {
    let mut camera = given.capture.camera.clone();
    for name in apply(&mut camera.settings, &found.fit.theta, &found.set)? {
        report
            .warnings
            .push(format!("{name} was found, but `simulate` cannot make it yet: camera.toml lacks it"));
    }
    Ok(camera)
}

/// Corners, lines and blobs of all frames, and what the report says of them; none if there is no time.
fn add_percepts(
    given: &Given<'_>,
    search: &mut Search<'_>,
    found: &mut Found,
    (frames, camera): (&[Shown], &CameraFile),
    report: &mut Report,
) -> Result<Vec<FramePercepts>> {
    let before = Drawn { theta: &search.base.clone(), settings: &given.settings() };
    let after = Drawn { theta: &found.fit.theta, settings: &camera.settings };
    let percepts = search.within(Stage::End, |search| percepts(search.forward, frames, &before, &after));
    let percepts = in_time(percepts)?;
    match &percepts {
        Some(percepts) => report.percepts = figures(frames, percepts),
        None => found.leave_out(PERCEPTS),
    }
    Ok(percepts.unwrap_or_default())
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
        same_together: Together::new(),
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

/// Says of frames that had to be warped what was not judged. What is said of the whole must have been seen in most of
/// it.
fn say_rough(report: &mut Report) {
    let beside_px = report.input.alignment.as_ref().and_then(|a| a.rms_px).unwrap_or(0.0);
    let share = report.input.compared_share;
    let rest = if share < MOST_COMPARED {
        if matches!(report.verdict, Verdict::NoGap | Verdict::Explained) {
            report.verdict = Verdict::Undetermined;
        }
        ", too little to say anything of the whole"
    } else {
        ""
    };
    let said = format!(
        " Where things lie was not judged: the real frames lie {beside_px:.1} px beside the simulated ones, which were \
         warped onto them. All this is of the {:.0} % of the picture that fit then{rest}.",
        100.0 * share
    );
    report.sentence.push_str(&said);
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
    /// Whether all real frames are one and the same picture.
    same: bool,
}

impl Told {
    fn new(forward: &Forward, evidence: &Evidence, given: &Given<'_>, aligned: Option<&Aligned>) -> Self {
        let motion_px = typical_motion_px(forward, evidence);
        Self {
            motion_px: (!given.capture.camera.static_camera).then_some(motion_px),
            geometry: given.pair.map(|p| p.sim.geometry),
            aligned: aligned.is_some_and(|a| a.is_rough()),
            stills: given.pair.is_some_and(|p| p.stills),
            same: are_one(&evidence.frames),
        }
    }

    /// What the report says of a candidate that these frames cannot tell of.
    fn why_not(&self, name: &str) -> Option<Candidate> {
        let (candidate, moves) = (candidate_of(name), changes_places(name));
        if self.geometry == Some(Geometry::None) && candidate.needs_motion {
            return Some(undetermined(name, NO_MOTION[0], NO_MOTION[1]));
        }
        if self.same && (candidate.noise || name == "hot_pixels") {
            return Some(undetermined(name, ONE_FRAME[0], ONE_FRAME[1]));
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
/// Why noise is not told of by one frame that is there several times, and what to give.
const ONE_FRAME: [&str; 2] = [
    "all real frames are one and the same: noise and what the scene shows stay alike",
    "frames that were taken one after another",
];
/// Why geometry is not told of by frames that had to be warped, and what to give.
const ROUGH: [&str; 2] = [
    "each simulated frame was warped to lie on the real one, which hides what moves places",
    "simulated frames at the poses of the real ones, or depth/ with trajectory.tum beside them",
];

/// Whether frames are one picture, several times.
fn are_one(frames: &[RealFrame]) -> bool {
    frames.len() > 1 && frames.windows(2).all(|two| two[0].dn.data == two[1].dn.data)
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
