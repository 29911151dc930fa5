//! What the footage says: times of lines and exposure with intervals, and of all else what to supply.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec2;
use rayon::prelude::*;

use super::Gyroed;
use super::blur::Blurred;
use super::input::Footage;
use super::paths::{COLUMNS, MARGIN_PX, Numbers, OFFSET, ROWS, Timed, seen, time_s};
use super::step::Step;
use crate::diagnose::expect::model::{P, Theta, candidate_of};
use crate::diagnose::expect::pair::channel_at;
use crate::diagnose::report::*;
use crate::diagnose::tell::describe::{listed, undetermined};
use crate::diagnose::tell::output::{make_folders, write_five};
use shutterbug::camera::ScanOrder;
use shutterbug::error::Result;
use shutterbug::plane::{Plane, three, write_atomic};

/// Most pairs of frames with pictures.
const MOST_SHOWN: usize = 8;
/// Of the difference between two frames so many times is shown.
const ENLARGED: f32 = 3.0;
/// What else needs.
const NEEDS_SCENE: [&str; 2] = [
    "a gyro says when lines are exposed and for how long, and nothing else of the camera",
    "simulated frames beside these (--sim), or a scene.obj with a trajectory.tum: a capture",
];
/// What to film where times cannot be told.
const FILM: &str = "ten seconds of turning quickly to all sides, two of rest between, in front of something \
far with many edges";

/// A pair of frames and its pictures: the second frame, the first as it is, the first where the gyro has it, and both
/// differences.
pub(super) struct Shown {
    index: usize,
    filename: String,
    time_s: f64,
    pictures: [Plane<f32>; 5],
    apart_px: [f64; 2],
}

/// What was told of one of the three.
enum Answer {
    /// Values of the parameters with half widths, and the gap without it, px.
    Found(Vec<(P, f64, f64)>, f64),
    /// Why it is not there.
    Rejected(String),
    /// Why it is not known, and what to film.
    Unknown(String, String),
}

/// The report, and the numbers and names that go into `camera.toml`.
pub(super) fn report(
    footage: &Footage,
    steps: &[Step],
    timed: Option<&Timed>,
    blurred: Option<&Blurred>,
    names: &[&'static str],
) -> (Report, Theta, Vec<&'static str>) {
    let doubt = match timed {
        None => Some("neighbouring frames have too little in common to say how content moves".to_owned()),
        Some(timed) => timed.doubt(),
    };
    let mut theta = Theta::neutral();
    let answers = match (timed, &doubt) {
        (Some(timed), None) => answers(timed, blurred, &mut theta),
        _ => {
            let why = doubt.clone().unwrap_or_default();
            let unknown = || Answer::Unknown(why.clone(), FILM.to_owned());
            vec![("rolling_shutter", unknown()), ("motion_blur", unknown()), ("time_offset", unknown())]
        }
    };
    let gap = gap(timed, steps.len() / 2);
    let asked = answers.into_iter().filter(|(n, _)| names.contains(n)).collect();
    let Sorted { mut effects, mut candidates, set } = sorted(asked, &mut theta, &gap);
    let told = ["rolling_shutter", "motion_blur", "time_offset"];
    let others = names.iter().filter(|n| !told.contains(n));
    candidates.extend(others.map(|n| undetermined(n, NEEDS_SCENE[0], NEEDS_SCENE[1])));
    let leaves = timed.is_some_and(Timed::leaves);
    let verdict = verdict(doubt.is_some(), timed, effects.is_empty());
    share(&mut effects);
    let mut sentence = sentence(doubt.as_deref(), &effects, &gap);
    if leaves && doubt.is_none() {
        sentence += &format!(
            " They are measured to {:.2} px: something else moves them too (the centre or the lens of camera.toml, \
            a near scene).",
            gap.floor
        );
    }
    let report = Report {
        verdict,
        sentence,
        effects,
        candidates,
        places: Where::default(),
        waterfall: Vec::new(),
        measures: Vec::new(),
        percepts: Percepts::default(),
        frames: Vec::new(),
        maps: Maps::default(),
        description: DescriptionShown::default(),
        input: input(footage, steps),
        bootstrap: Bootstrap::default(),
        warnings: warnings(footage, timed),
        next: Vec::new(),
        gap,
    };
    (report, theta, set)
}

/// Of the footage as a whole; `doubt`: whether nothing can be said.
fn verdict(doubt: bool, timed: Option<&Timed>, nothing_found: bool) -> Verdict {
    let leaves = timed.is_some_and(Timed::leaves);
    match (doubt, nothing_found) {
        (true, _) if timed.is_some() => Verdict::UnknownEffect,
        (true, _) => Verdict::Undetermined,
        (false, true) if leaves => Verdict::UnknownEffect,
        (false, true) => Verdict::NoGap,
        (false, false) if leaves => Verdict::PartlyExplained,
        (false, false) => Verdict::Explained,
    }
}

/// Answers as they stand in a report.
struct Sorted {
    effects: Vec<EffectFound>,
    candidates: Vec<Candidate>,
    /// The names that were found.
    set: Vec<&'static str>,
}

/// Sorts answers; numbers that were found go into `theta`.
fn sorted(answers: Vec<(&'static str, Answer)>, theta: &mut Theta, gap: &Gap) -> Sorted {
    let mut half = BTreeMap::new();
    let (mut effects, mut candidates, mut set) = (Vec::new(), Vec::new(), Vec::new());
    for (name, answer) in answers {
        match answer {
            Answer::Found(values, without_px) => {
                for (p, value, width) in values {
                    theta.set(p, value);
                    half.insert(p, width);
                }
                set.push(name);
                effects.push(effect(name, theta, &half, without_px, gap));
            }
            Answer::Rejected(why) => candidates.push(Candidate {
                state: CandidateState::Rejected,
                gap_with: Some(gap.after),
                ..undetermined(name, &why, "")
            }),
            Answer::Unknown(why, film) => candidates.push(undetermined(name, &why, &film)),
        }
    }
    Sorted { effects, candidates, set }
}

fn warnings(footage: &Footage, timed: Option<&Timed>) -> Vec<String> {
    let mut all = footage.notes.clone();
    if footage.is_bent() {
        all.push(
            "displacements are taken through the lens of camera.toml; blur is taken as if there were none"
                .to_owned(),
        );
    }
    all.extend(timed.filter(|t| t.is_trusted()).and_then(Timed::clock));
    all.extend(timed.map(|t| {
        format!(
            "content moves {:.1} px from frame to frame; the scene is taken to be far: what is near moves \
            beside the turn and counts as error",
            t.motion_px
        )
    }));
    all
}

fn input(footage: &Footage, steps: &[Step]) -> Input {
    let k = footage.intrinsics();
    let frames = |odd: bool| {
        let of = steps.iter().enumerate().filter(|(k, _)| (k % 2 == 1) == odd);
        of.map(|(_, s)| s.frames[1]).collect()
    };
    Input {
        kind: "gyro".to_owned(),
        capture: footage.folder.display().to_string(),
        width: k.width,
        height: k.height,
        frames_listed: footage.frames.len(),
        fit_frames: frames(false),
        held_out_frames: frames(true),
        compared_share: 1.0,
        device: "none: frames are given".to_owned(),
        method: "neighbouring frames and a gyro".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        ..Input::default()
    }
}

/// Errors of held-out points, px.
fn gap(timed: Option<&Timed>, held_out_frames: usize) -> Gap {
    let [before, after, known] = timed.map_or([0.0; 3], |t| [t.before_px, t.after_px, t.known_px]);
    let closed = timed.map_or(0.0, Timed::closed);
    let of = |k: usize| {
        let all: Vec<f64> = timed.iter().flat_map(|t| t.by_pair.iter().map(|p| p[k])).collect();
        let n = all.len().max(2) as f64;
        let mean = all.iter().sum::<f64>() / n;
        1.96 * (all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt()
    };
    let around = |v: f64, half: f64| [(v - half).max(0.0), v + half];
    let half = if before > known { of(1) / (before - known) } else { 0.0 };
    Gap {
        unit: "px".to_owned(),
        before,
        after,
        floor: known.min(after),
        closed_fraction: closed,
        closed_fraction_ci95: [(closed - half).max(0.0), (closed + half).min(1.0)],
        held_out_frames,
        before_ci95: around(before, of(0)),
        after_ci95: around(after, of(1)),
        renderer_difference: MARGIN_PX,
    }
}

fn effect(name: &str, theta: &Theta, half: &BTreeMap<P, f64>, without_px: f64, gap: &Gap) -> EffectFound {
    let gain = (without_px - gap.after).max(0.0);
    EffectFound {
        name: name.to_owned(),
        share: gain,
        parameters: theta.report(candidate_of(name), half),
        camera: true,
        gap_without: without_px,
        gap_with: gap.after,
        gap_alone: gap.before,
        gain_ci95: [gain; 2],
        alternatives: Vec::new(),
        same_together: Together::new(),
        footage: String::new(),
    }
}

/// Gains as parts of their sum.
fn share(effects: &mut [EffectFound]) {
    let total: f64 = effects.iter().map(|e| e.share).sum();
    effects.iter_mut().for_each(|e| e.share /= total.max(1e-9));
    effects.sort_by(|a, b| b.share.total_cmp(&a.share));
}

/// The three, in light-path order.
fn answers(timed: &Timed, blurred: Option<&Blurred>, theta: &mut Theta) -> Vec<(&'static str, Answer)> {
    let (n, half) = (&timed.numbers, &timed.half);
    let lines = if n[ROWS] != 0.0 { ROWS } else { COLUMNS };
    let (readout_s, readout_half_s) = (n[lines], half[lines]);
    let there = readout_s.abs() > readout_half_s && readout_s.abs() > 1e-4;
    let shutter = if there {
        theta.scan_order = match (lines == ROWS, readout_s > 0.0) {
            (true, true) => ScanOrder::TopToBottom,
            (true, false) => ScanOrder::BottomToTop,
            (false, true) => ScanOrder::LeftToRight,
            (false, false) => ScanOrder::RightToLeft,
        };
        Answer::Found(vec![(P::Readout, readout_s.abs(), readout_half_s)], timed.offset_alone_px)
    } else {
        let most_s = readout_s.abs() + readout_half_s;
        Answer::Rejected(format!("all lines are exposed at once, to within {:.2} ms", 1e3 * most_s))
    };
    // A sensor that reads from its far end begins there.
    let first_s = n[OFFSET] + if there { readout_s.min(0.0) } else { 0.0 };
    let known = blurred.filter(|b| b.is_known());
    let exposure = match (known, blurred) {
        (Some(b), _) => Answer::Found(vec![(P::Exposure, b.exposure_s, b.half_s)], timed.after_px),
        (None, Some(b)) if b.is_too_long() => Answer::Unknown(
            format!(
                "neighbouring frames differ in their blur by more than an exposure of {:.1} ms, the time between \
                frames, would make: interlaced, blended or processed frames do",
                1e3 * b.period_s
            ),
            FILM.to_owned(),
        ),
        (None, Some(b)) => Answer::Unknown(
            format!(
                "neighbouring frames are too alike in their blur to tell it: it is at most {:.1} ms",
                1e3 * b.most_s
            ),
            FILM.to_owned(),
        ),
        (None, None) => {
            Answer::Unknown("too few frames, or no time, to compare their blur".to_owned(), FILM.to_owned())
        }
    };
    let offset = offset(first_s, half[OFFSET], known, timed);
    vec![("rolling_shutter", shutter), ("motion_blur", exposure), ("time_offset", offset)]
}

/// Of the clocks: what is known is the middle of the first line's exposure.
fn offset(middle_s: f64, half_s: f64, known: Option<&Blurred>, timed: &Timed) -> Answer {
    let Some(b) = known else {
        let why = format!(
            "the middle of the first line's exposure is {:.2} ms (+- {:.2}) behind the timestamp, of which \
            half the exposure, which is not \
             known, is no offset",
            1e3 * middle_s,
            1e3 * half_s
        );
        return Answer::Unknown(why, "what tells the exposure".to_owned());
    };
    let offset_s = middle_s - 0.5 * b.exposure_s;
    let half_s = half_s.hypot(0.5 * b.half_s);
    if offset_s.abs() <= half_s {
        return Answer::Rejected(format!(
            "the clocks agree to within {:.2} ms",
            1e3 * (offset_s.abs() + half_s)
        ));
    }
    Answer::Found(vec![(P::Offset, offset_s, half_s)], timed.before_px)
}

fn sentence(doubt: Option<&str>, effects: &[EffectFound], gap: &Gap) -> String {
    if let Some(doubt) = doubt {
        return format!("Nothing can be said: {doubt}.");
    }
    let ms = |name: &str, key: &str| {
        let effect = effects.iter().find(|e| e.name == name)?;
        effect.parameters.get(key)?.value.as_f64().map(|v| 1e3 * v)
    };
    let mut parts = Vec::new();
    parts.extend(ms("rolling_shutter", "readout_time_s").map(|v| format!("a readout of {v:.2} ms")));
    parts.extend(ms("motion_blur", "exposure_time_s").map(|v| format!("an exposure of {v:.1} ms")));
    parts.extend(ms("time_offset", "offset_s").map(|v| format!("clocks {v:.2} ms apart")));
    if parts.is_empty() {
        return "Frames and gyro agree with lines that are all exposed at their timestamps; what needs a scene \
        is not known.".to_owned();
    }
    format!(
        "The gyro and the frames agree with {}: points of the next frame are then {:.2} px from where they \
        are expected, {:.2} px without.",
        listed(&parts),
        gap.after,
        gap.before
    )
}

/// Pictures of some held-out pairs.
///
/// # Errors
/// Frames that cannot be read.
pub(super) fn shown(footage: &Footage, steps: &[Step], timed: Option<&Timed>) -> Result<Vec<Shown>> {
    let held: Vec<usize> = (1..steps.len()).step_by(2).collect();
    let count = held.len().min(MOST_SHOWN);
    let mut all = Vec::new();
    for k in (0..count).map(|k| held[k * held.len() / count]) {
        let [a, b] = steps[k].frames;
        let (first, second) = (footage.picture(a)?, footage.picture(b)?);
        let moved = timed.map_or_else(|| first.clone(), |t| moved(footage, &first, [a, b], &t.numbers));
        let differ = |other: &Plane<f32>| {
            let data =
                second.data.iter().zip(&other.data).map(|(s, o)| (ENLARGED * (s - o).abs()).min(255.0));
            Plane { data: data.collect(), ..second }
        };
        let (before, after) = (differ(&first), differ(&moved));
        let frame = &footage.frames[b];
        all.push(Shown {
            index: b,
            filename: frame.name.clone(),
            time_s: frame.start_s,
            apart_px: timed.map_or([0.0; 2], |t| t.by_pair[k]),
            pictures: [second, first, moved, before, after],
        });
    }
    Ok(all)
}

/// The first frame of a pair where the gyro has it in the second.
fn moved(footage: &Footage, first: &Plane<f32>, [a, b]: [usize; 2], n: &Numbers) -> Plane<f32> {
    let k = footage.intrinsics();
    let (focal, centre) = (DVec2::new(k.fx, k.fy), DVec2::new(k.cx, k.cy));
    let (w, h) = (first.width, first.height);
    let one = |i: usize| {
        let px = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
        let to_s = time_s(footage, n, b, px);
        let mut before = px;
        for _ in 0..3 {
            let from_s = time_s(footage, n, a, before);
            before = centre + focal * seen(footage, n, (px - centre) / focal, to_s, from_s);
        }
        three(|c| channel_at(first, [before.x as f32, before.y as f32], c))
    };
    let data: Vec<f32> = (0..w * h).into_par_iter().flat_map_iter(one).collect();
    Plane { data, ..*first }
}

impl Gyroed {
    /// Writes `camera.toml`, pictures and, last, `report.json` into a folder; returns the report with the pictures'
    /// paths.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(mut self, folder: &Path) -> Result<Report> {
        const KINDS: [&str; 5] =
            ["real", "neighbour", "neighbour_turned", "difference_before", "difference_after"];
        make_folders(folder, KINDS)?;
        write_atomic(&folder.join("camera.toml"), self.camera.to_toml().as_bytes())?;
        let one = |f: &Shown| -> Result<FrameEntry> {
            let pictures = write_five(folder, KINDS, f.index, &f.pictures)?;
            let [before, after] = f.apart_px;
            let (index, filename, time_s) = (f.index, f.filename.clone(), f.time_s);
            Ok(FrameEntry { index, filename, time_s, held_out: true, before, after, pictures })
        };
        self.report.frames = self.shown.par_iter().map(one).collect::<Result<_>>()?;
        self.report.write(folder)?;
        Ok(self.report)
    }
}
