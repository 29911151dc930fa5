//! What the page shows: the report as it is, and beside it the charts' coordinates and the pictures' bytes.

use std::path::Path;

use serde::Serialize;

use super::chart::{Chart, line_chart};
use super::embed::{PictureBudget, data_uri, size_of_picture};
use super::percepts::{self, Overlay};
use crate::diagnose::{Asked, Bin, Candidate, CandidateState, FrameEntry, PoseOff, Report, Verdict};
use shutterbug::error::Result;

/// Most frames that a page carries pictures of: more would be slow to open, and five pictures a frame add up.
const MAX_FRAMES: usize = 60;

/// Everything that the template reads.
#[derive(Serialize)]
pub(super) struct Page<'a> {
    report: &'a Report,
    verdict: &'static str,
    asked: Asked,
    frames: Vec<FrameView<'a>>,
    /// Index into `frames` of the one that is shown first.
    first: usize,
    frames_total: usize,
    exact: bool,
    maps: MapViews,
    description: DescriptionView,
    waterfall: Vec<Bar>,
    waterfall_height: f64,
    profiles: Vec<Profile<'a>>,
    rejected: Vec<&'a Candidate>,
    undetermined: Vec<&'a Candidate>,
    camera: String,
}

#[derive(Serialize)]
struct FrameView<'a> {
    entry: &'a FrameEntry,
    real: String,
    simulated: String,
    diagnosed: String,
    difference_before: String,
    difference_after: String,
    percepts: Overlay,
}

#[derive(Serialize)]
struct MapViews {
    before: String,
    after: String,
    bias_before: String,
    bias_after: String,
}

/// What is wrong with the description: pictures and charts of it.
#[derive(Serialize)]
struct DescriptionView {
    factors: Vec<String>,
    objects: Vec<String>,
    rotation: Option<Chart>,
    position: Option<Chart>,
}

/// A horizontal bar of the waterfall, px.
#[derive(Serialize)]
struct Bar {
    name: String,
    kind: &'static str,
    x: f64,
    width: f64,
    y: f64,
    /// What stands at its end: "7.10" or "−5.20".
    label: String,
}

/// A profile as chart and table.
#[derive(Serialize)]
struct Profile<'a> {
    title: &'static str,
    x_label: &'static str,
    bins: &'a [Bin],
    /// Absent where bins are names: those are drawn as bars.
    line: Option<Chart>,
    bars: Vec<BinBars>,
    bars_height: f64,
}

#[derive(Serialize)]
struct BinBars {
    label: String,
    y: f64,
    before: f64,
    after: f64,
    before_dn: f64,
    after_dn: f64,
}

impl<'a> Page<'a> {
    /// # Errors
    /// A picture that cannot be read.
    pub(super) fn new(report: &'a Report, folder: &Path, camera: String) -> Result<Self> {
        let shown = shown_frames(&report.frames);
        let size = |name: &String| size_of_picture(folder, name);
        let total = shown.iter().flat_map(|f| names(f)).map(size).sum();
        let budget = PictureBudget::for_total(total);
        let uri = |name: &str| data_uri(folder, name, budget);
        let overlays = percepts::read(folder, &report.percepts.file)?;
        let view = |entry: &'a FrameEntry| -> Result<FrameView<'a>> {
            let [real, simulated, diagnosed, before, after] = names(entry).map(|n| uri(n));
            let (real, simulated, diagnosed) = (real?, simulated?, diagnosed?);
            Ok(FrameView {
                entry,
                real,
                simulated,
                diagnosed,
                difference_before: before?,
                difference_after: after?,
                percepts: overlays.get(&entry.index).cloned().unwrap_or_default(),
            })
        };
        let frames = shown.into_iter().map(view).collect::<Result<Vec<_>>>()?;
        let maps = MapViews {
            before: uri(&report.maps.before)?,
            after: uri(&report.maps.after)?,
            bias_before: uri(&report.maps.bias_before)?,
            bias_after: uri(&report.maps.bias_after)?,
        };
        let all = |names: &[String]| names.iter().map(|n| uri(n)).collect::<Result<Vec<_>>>();
        let off = &report.description.poses;
        let chart = |of: fn(&PoseOff) -> f64| {
            let x: Vec<f64> = off.iter().map(|p| p.time_s - off[0].time_s).collect();
            (off.len() > 1).then(|| line_chart(&x, &[("after", off.iter().map(of).collect())]))
        };
        let description = DescriptionView {
            factors: all(&report.description.factors)?,
            objects: all(&report.description.objects)?,
            rotation: chart(|p| 1e3 * p.rotation_rad),
            position: chart(|p| 1e3 * p.position_m),
        };
        let with_state =
            |state| report.candidates.iter().filter(move |c: &&Candidate| c.state == state).collect();
        let (waterfall, waterfall_height) = waterfall(report);
        Ok(Self {
            report,
            asked: report.asked(),
            verdict: verdict_text(report.verdict),
            first: worst_held_out(&frames),
            frames,
            frames_total: report.frames.len(),
            exact: budget.exact,
            maps,
            description,
            waterfall,
            waterfall_height,
            profiles: profiles(report),
            rejected: with_state(CandidateState::Rejected),
            undetermined: with_state(CandidateState::Undetermined),
            camera,
        })
    }
}

fn names(frame: &FrameEntry) -> [&String; 5] {
    let p = &frame.pictures;
    [&p.real, &p.simulated, &p.diagnosed, &p.difference_before, &p.difference_after]
}

fn verdict_text(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::NoGap => "No gap",
        Verdict::Explained => "Explained",
        Verdict::PartlyExplained => "Partly explained",
        Verdict::UnknownEffect => "Unknown effect",
        Verdict::Undetermined => "Undetermined",
    }
}

/// All frames, or evenly spaced ones of a long capture.
fn shown_frames(frames: &[FrameEntry]) -> Vec<&FrameEntry> {
    let count = frames.len().min(MAX_FRAMES);
    (0..count).map(|i| &frames[i * frames.len() / count]).collect()
}

/// The held-out frame in which the gap is widest: the picture that says most.
fn worst_held_out(frames: &[FrameView]) -> usize {
    let key = |f: &FrameView| (f.entry.held_out, f.entry.before);
    let better = |a: &FrameView, b: &FrameView| {
        let ((held_a, gap_a), (held_b, gap_b)) = (key(a), key(b));
        held_a.cmp(&held_b).then(gap_a.total_cmp(&gap_b))
    };
    (0..frames.len()).max_by(|a, b| better(&frames[*a], &frames[*b])).unwrap_or(0)
}

/// Length of the longest bar, px.
const BAR_WIDTH: f64 = 420.0;
/// From one bar to the next, px.
const BAR_STEP: f64 = 26.0;

fn waterfall(report: &Report) -> (Vec<Bar>, f64) {
    let steps = &report.waterfall;
    let finite = |v: f64| if v.is_finite() { v.max(0.0) } else { 0.0 };
    let most = steps.iter().map(|s| finite(s.from).max(finite(s.to))).fold(0.0, f64::max);
    let scale = if most > 0.0 { BAR_WIDTH / most } else { 0.0 };
    let bar = |(i, step): (usize, &crate::diagnose::WaterfallStep)| {
        let total = ["before", "after", "floor"].contains(&step.name.as_str());
        let (from, to) = match (finite(step.from), finite(step.to)) {
            // The floor comes down to zero, the gap before comes up from it: what is drawn is its height.
            (from, to) if total => (0.0, from.max(to)),
            both => both,
        };
        let rest = step.name == "unexplained";
        // A gap below the floor leaves nothing to explain.
        let below = rest && to > from;
        let kind = match (total, rest, to > from) {
            (true, ..) => "total",
            (_, true, true) => "below",
            (_, true, false) => "unexplained",
            (.., true) => "worse",
            _ => "closed",
        };
        let change = to - from;
        let label = match (total, change < 0.0) {
            (true, _) => format!("{to:.2}"),
            (false, false) if below => format!("{change:.2}"),
            (false, true) => format!("\u{2212}{:.2}", -change),
            (false, false) => format!("+{change:.2}"),
        };
        Bar {
            name: if below { "below the floor".to_owned() } else { super::plain_name(&step.name) },
            kind,
            x: scale * from.min(to),
            width: (scale * change.abs()).max(1.0),
            y: BAR_STEP * i as f64,
            label,
        }
    };
    (steps.iter().enumerate().map(bar).collect(), BAR_STEP * steps.len() as f64)
}

fn profiles(report: &Report) -> Vec<Profile<'_>> {
    let w = &report.places;
    let all: [(&'static str, &'static str, &[Bin], bool); 10] = [
        ("By row", "row, px from the top", &w.by_row, true),
        ("By column", "column, px from the left", &w.by_column, true),
        ("By radius", "distance from the principal point, px", &w.by_radius, true),
        ("By speed", "speed of the content, px/s", &w.by_speed, true),
        ("By direction", "direction of motion, degrees clockwise from right", &w.by_direction, true),
        ("By intensity", "simulated value, DN", &w.by_intensity, true),
        ("By channel", "", &w.by_channel, false),
        ("By spatial frequency", "", &w.by_frequency, false),
        ("By object or material", "", &w.by_object, false),
        ("By frame", "frame", &w.by_frame, true),
    ];
    let shown = all.into_iter().filter(|(_, _, bins, _)| !bins.is_empty());
    shown.map(|(title, x_label, bins, line)| profile(title, x_label, bins, line)).collect()
}

fn profile<'a>(title: &'static str, x_label: &'static str, bins: &'a [Bin], line: bool) -> Profile<'a> {
    // A line through fewer points says less than bars with names.
    const FEWEST_FOR_A_LINE: usize = 4;
    let line = (line && bins.len() >= FEWEST_FOR_A_LINE).then(|| {
        let x: Vec<f64> = bins.iter().map(|b| 0.5 * (b.from + b.to)).collect();
        // An open last bin has no middle.
        let x: Vec<f64> = x.iter().zip(bins).map(|(x, b)| if x.is_finite() { *x } else { b.from }).collect();
        let of = |f: fn(&Bin) -> f64| bins.iter().map(f).collect::<Vec<f64>>();
        line_chart(&x, &[("before", of(|b| b.before)), ("after", of(|b| b.after))])
    });
    let most = bins.iter().flat_map(|b| [b.before, b.after]).filter(|v| v.is_finite()).fold(0.0, f64::max);
    let length = |v: f64| if v.is_finite() && most > 0.0 { 220.0 * v.max(0.0) / most } else { 0.0 };
    let bar = |(i, b): (usize, &Bin)| BinBars {
        label: shortened(&b.label),
        y: 30.0 * i as f64,
        before: length(b.before),
        after: length(b.after),
        before_dn: b.before,
        after_dn: b.after,
    };
    let bars: Vec<_> = if line.is_some() { Vec::new() } else { bins.iter().enumerate().map(bar).collect() };
    Profile { title, x_label, bins, line, bars_height: 30.0 * bars.len() as f64, bars }
}

/// A label that fits beside its bar; the table has the whole.
fn shortened(label: &str) -> String {
    const MOST: usize = 22;
    if label.chars().count() <= MOST {
        return label.to_owned();
    }
    label.chars().take(MOST - 1).chain(['…']).collect()
}
