//! What a diagnosis found, as data: `report.json` (docs/reference/report.md) and everything that a page about it
//! needs.
//!
//! Grey levels are DN (0 to 255). Unless said otherwise figures are of held-out frames, which no fit has seen. Paths
//! are relative to the folder of the report, with `/`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Deserializer, Serialize};

use shutterbug::error::{Error, Result};
use shutterbug::plane::write_atomic;

/// Name of the report in its folder.
pub const REPORT_FILE: &str = "report.json";

/// The whole of `report.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The outcome in one word.
    pub verdict: Verdict,
    /// The outcome in one or two sentences.
    pub sentence: String,
    /// The headline.
    pub gap: Gap,
    /// Supported effects, largest share first; empty for [`Verdict::NoGap`].
    pub effects: Vec<EffectFound>,
    /// All other candidates.
    pub candidates: Vec<Candidate>,
    /// Where the gap lies.
    #[serde(rename = "where")]
    pub places: Where,
    /// From `before` to `after` to `floor`, one step per effect.
    pub waterfall: Vec<WaterfallStep>,
    /// Other measures of the same gap, for people.
    pub measures: Vec<Measure>,
    /// The task-level gap: what image processing finds.
    #[serde(default)]
    pub percepts: Percepts,
    /// One entry per frame of the capture that could be compared.
    pub frames: Vec<FrameEntry>,
    /// Mean maps over the held-out frames.
    pub maps: Maps,
    /// What is wrong with the description, to look at.
    #[serde(skip_serializing_if = "DescriptionShown::is_empty", default)]
    pub description: DescriptionShown,
    /// What went in.
    pub input: Input,
    /// The held-out gains behind the interval, per resample of the bootstrap.
    pub bootstrap: Bootstrap,
    /// Things that a reader should know: "frames 3 and 4 are black and were left out".
    pub warnings: Vec<String>,
    /// Commands to use next.
    pub next: Vec<NextStep>,
}

/// What is wrong with the description, as pictures of a few frames and the path's error over time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DescriptionShown {
    /// The factor on the radiance of the surfaces, seen through the camera: grey where it is 1.
    pub factors: Vec<String>,
    /// The factor that is white; its inverse is black.
    #[serde(deserialize_with = "figure")]
    pub white_factor: f64,
    /// Frames in which something is that the scene does not have: all else is darkened.
    pub objects: Vec<String>,
    /// How far the poses are off, by frame.
    pub poses: Vec<PoseOff>,
}

impl DescriptionShown {
    fn is_empty(&self) -> bool {
        self.factors.is_empty() && self.objects.is_empty() && self.poses.is_empty()
    }
}

/// How far the pose of one frame is off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseOff {
    /// The frame's timestamp, s.
    pub time_s: f64,
    /// Angle, rad.
    pub rotation_rad: f64,
    /// Distance, m.
    pub position_m: f64,
    /// Where time stamps that are off would do the same: how long after its stamp the frame was taken, s.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub late_s: Option<f64>,
}

/// The outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Real and simulated frames differ no more than those of two correct renderers.
    NoGap,
    /// The effects found leave no more than that.
    Explained,
    /// The effects found help, but a clear gap remains.
    PartlyExplained,
    /// There is a clear gap, and no known effect explains it.
    UnknownEffect,
    /// The time limit came before the search had ended, the set-up is not what it should be, or most of the picture
    /// could not be compared: nothing is denied that was not looked at.
    Undetermined,
}

/// The headline: a proper score (continuous ranked probability score), the mean over pixels and a fixed bank of linear
/// statistics, on held-out frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// "DN".
    pub unit: String,
    /// Of the given camera.
    #[serde(deserialize_with = "figure")]
    pub before: f64,
    /// With the effects found.
    #[serde(deserialize_with = "figure")]
    pub after: f64,
    /// What the model with the effects found would score on frames of its own.
    #[serde(deserialize_with = "figure")]
    pub floor: f64,
    /// `(before - after) / (before - floor)`, 0 to 1; 0 when there is no gap.
    #[serde(deserialize_with = "figure")]
    pub closed_fraction: f64,
    /// 95 % interval by bootstrap over blocks of the picture.
    #[serde(deserialize_with = "pair")]
    pub closed_fraction_ci95: [f64; 2],
    /// Number of held-out frames.
    pub held_out_frames: usize,
    /// 95 % interval of `before`.
    #[serde(deserialize_with = "pair")]
    pub before_ci95: [f64; 2],
    /// 95 % interval of `after`.
    #[serde(deserialize_with = "pair")]
    pub after_ci95: [f64; 2],
    /// The margin: what two correct simulations may score on these frames, DN. A gap within it is none.
    #[serde(deserialize_with = "figure")]
    pub renderer_difference: f64,
}

/// Parameters of several effects, by the names of `camera.toml`.
pub type Together = BTreeMap<String, BTreeMap<String, f64>>;

/// An effect that the frames support.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffectFound {
    /// Name of the contract.
    pub name: String,
    /// Shapley share of the gap that the set closes; the shares of all effects sum to 1.
    #[serde(deserialize_with = "figure")]
    pub share: f64,
    /// By the contract's names.
    pub parameters: BTreeMap<String, Parameter>,
    /// Whether it is the camera's; else it is what is wrong with the description.
    #[serde(skip_serializing_if = "is_true", default = "yes")]
    pub camera: bool,
    /// Gap with all effects found but this one (the others fitted anew).
    #[serde(deserialize_with = "figure")]
    pub gap_without: f64,
    /// Gap with all effects found.
    #[serde(deserialize_with = "figure")]
    pub gap_with: f64,
    /// Gap with this effect alone (fitted alone).
    #[serde(deserialize_with = "figure")]
    pub gap_alone: f64,
    /// Gain of this effect in the set, DN: 95 % interval, from blocks of the picture.
    #[serde(deserialize_with = "pair")]
    pub gain_ci95: [f64; 2],
    /// Effects that do the same on these frames, within noise and what correct simulations differ by.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub alternatives: Vec<String>,
    /// Effects that do the same on any frames together, none of them alone, with their parameters.
    #[serde(skip_serializing_if = "Together::is_empty", default)]
    pub same_together: Together,
    /// What to film to tell it from its alternatives; empty where there is none.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub footage: String,
}

/// A fitted parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// A number, a name (`top_to_bottom`) or a list of numbers (`rotvec_rad`).
    pub value: serde_json::Value,
    /// 95 % interval: `[from, to]`, or a list of such pairs; absent for names.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub ci95: Option<serde_json::Value>,
    /// Unit in words.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub unit: String,
}

/// A candidate that is not among the effects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Name of the contract.
    pub name: String,
    /// What became of it.
    pub state: CandidateState,
    /// Why, in a sentence; for undetermined ones, what footage would decide.
    pub why: String,
    /// Gap with this candidate alone, fitted; absent where it could not be fitted.
    pub gap_with: Option<f64>,
    /// Its best parameters when fitted alone.
    pub parameters: BTreeMap<String, Parameter>,
    /// Footage that would decide; empty unless undetermined.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub footage: String,
}

/// What became of a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CandidateState {
    /// The frames would show it, and do not.
    Rejected,
    /// The frames cannot tell.
    Undetermined,
}

/// Where the gap lies: mean absolute difference (DN) before and after, by what it may depend on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Where {
    /// The two or three most telling sentences.
    pub summary: Vec<String>,
    /// By row, top first.
    pub by_row: Vec<Bin>,
    /// By column, left first.
    pub by_column: Vec<Bin>,
    /// By distance from the principal point, px.
    pub by_radius: Vec<Bin>,
    /// By speed of the content, px/s.
    pub by_speed: Vec<Bin>,
    /// By direction of the content's motion, degrees from right, clockwise as seen.
    pub by_direction: Vec<Bin>,
    /// By simulated value, DN.
    pub by_intensity: Vec<Bin>,
    /// Red, green, blue.
    pub by_channel: Vec<Bin>,
    /// By band of spatial frequency: finest first.
    pub by_frequency: Vec<Bin>,
    /// By object of the scene, with the material where there is one object only.
    pub by_object: Vec<Bin>,
    /// By frame.
    pub by_frame: Vec<Bin>,
}

/// One bin of a profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    /// Lower edge in the profile's unit; the index for profiles without a unit.
    #[serde(deserialize_with = "figure")]
    pub from: f64,
    /// Upper edge.
    #[serde(deserialize_with = "figure")]
    pub to: f64,
    /// Name for people: "red", "120-160 px", "frame 3".
    pub label: String,
    /// Mean absolute difference before, DN.
    #[serde(deserialize_with = "figure")]
    pub before: f64,
    /// The same with the effects found, DN.
    #[serde(deserialize_with = "figure")]
    pub after: f64,
    /// Mean signed difference (real minus simulated) before, DN.
    #[serde(deserialize_with = "figure")]
    pub bias_before: f64,
    /// The same with the effects found, DN.
    #[serde(deserialize_with = "figure")]
    pub bias_after: f64,
    /// Share of all compared values, 0 to 1.
    #[serde(deserialize_with = "figure")]
    pub weight: f64,
}

/// A step of the waterfall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WaterfallStep {
    /// "before", an effect's name, "unexplained", "floor".
    pub name: String,
    /// Gap at the start of the step, DN.
    #[serde(deserialize_with = "figure")]
    pub from: f64,
    /// Gap at its end, DN.
    #[serde(deserialize_with = "figure")]
    pub to: f64,
}

/// A measure of the gap before and after, means over held-out frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measure {
    /// "mean_absolute_difference", "psnr", "ssim".
    pub name: String,
    /// "DN", "dB", "".
    pub unit: String,
    /// Of the given camera.
    #[serde(deserialize_with = "figure")]
    pub before: f64,
    /// With the effects found.
    #[serde(deserialize_with = "figure")]
    pub after: f64,
}

/// The task-level gap: corners, lines and blobs found in real and in simulated frames, over the held-out frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Percepts {
    /// The file with the percepts of all frames.
    pub file: String,
    /// How far apart percepts may lie to be the same one, px.
    #[serde(deserialize_with = "figure")]
    pub tolerance_px: f64,
    /// "corners", "lines", "blobs".
    pub kinds: Vec<PerceptGap>,
}

/// How percepts of one kind agree: means over the held-out frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PerceptGap {
    /// "corners", "lines", "blobs".
    pub name: String,
    /// Number a real frame.
    #[serde(deserialize_with = "figure")]
    pub real: f64,
    /// Number a frame simulated with the given camera.
    #[serde(deserialize_with = "figure")]
    pub before: f64,
    /// Number a frame simulated with the effects found.
    #[serde(deserialize_with = "figure")]
    pub after: f64,
    /// Twice the pairs over the percepts in both frames, real and simulated with the given camera: 0 to 1.
    #[serde(deserialize_with = "figure")]
    pub matched_before: f64,
    /// The same with the effects found.
    #[serde(deserialize_with = "figure")]
    pub matched_after: f64,
    /// The same of two simulated frames that differ by their noise alone: what a perfect model reaches.
    #[serde(deserialize_with = "figure")]
    pub matched_floor: f64,
    /// Mean distance of pairs before, px; absent where there is none.
    pub offset_before_px: Option<f64>,
    /// The same with the effects found, px.
    pub offset_after_px: Option<f64>,
}

/// One frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameEntry {
    /// Its place in `frames.csv`, from 0.
    pub index: usize,
    /// Its file name there.
    pub filename: String,
    /// Its timestamp, s after the first frame's.
    #[serde(deserialize_with = "figure")]
    pub time_s: f64,
    /// Whether it was kept from the fits.
    pub held_out: bool,
    /// Gap before and after, DN: of the frame and of its change from the frame before, where that was compared too.
    #[serde(deserialize_with = "figure")]
    pub before: f64,
    /// See `before`.
    #[serde(deserialize_with = "figure")]
    pub after: f64,
    /// The pictures.
    pub pictures: FramePictures,
}

/// A frame's pictures in the folder of the report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FramePictures {
    /// The real frame, copied as PNG.
    pub real: String,
    /// Simulated with the given camera.
    pub simulated: String,
    /// Simulated with the effects found.
    pub diagnosed: String,
    /// Difference map before, on the scale of [`Maps::scale_dn`].
    pub difference_before: String,
    /// Difference map after, on the same scale.
    pub difference_after: String,
}

/// Maps of the mean absolute difference.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Maps {
    /// Full white of the difference pictures of single frames, DN.
    #[serde(deserialize_with = "figure")]
    pub scale_dn: f64,
    /// Full white of the mean maps, DN; those of the signed ones are this much brighter or darker.
    #[serde(default, deserialize_with = "figure")]
    pub mean_scale_dn: f64,
    /// Mean over the held-out frames, before.
    pub before: String,
    /// The same, after.
    pub after: String,
    /// Mean SIGNED difference before: grey 128 is none, white is `mean_scale_dn` brighter in reality.
    pub bias_before: String,
    /// The same, after.
    pub bias_after: String,
}

/// What went in.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Input {
    /// "capture" or "pair".
    pub kind: String,
    /// As given on the command line.
    pub capture: String,
    /// Columns, px.
    pub width: u32,
    /// Rows, px.
    pub height: u32,
    /// Frames listed.
    pub frames_listed: usize,
    /// Frames used by fits, by index.
    pub fit_frames: Vec<usize>,
    /// Frames held out, by index.
    pub held_out_frames: Vec<usize>,
    /// Frames left out, with the reason.
    pub left_out: Vec<LeftOut>,
    /// Share of pixels that were compared, 0 to 1.
    #[serde(deserialize_with = "figure")]
    pub compared_share: f64,
    /// Seed of everything random.
    pub seed: u64,
    /// Name of the device.
    pub device: String,
    /// How frames were rendered.
    pub method: String,
    /// Seconds that the diagnosis took.
    #[serde(deserialize_with = "figure")]
    pub seconds: f64,
    /// Frames rendered in this run.
    #[serde(default)]
    pub renders: usize,
    /// Seconds of it that they took.
    #[serde(default, deserialize_with = "figure")]
    pub render_seconds: f64,
    /// Version of this program.
    pub version: String,
    /// How real and simulated frames lie on each other; of pairs of folders.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub alignment: Option<Alignment>,
}

/// How real and simulated frames lie on each other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    /// "exact": they are compared as they lie. "rough": each simulated frame was warped first. "none": they show other
    /// moments.
    pub kind: String,
    /// Root mean square of the displacement, px; absent where none could be measured.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub rms_px: Option<f64>,
}

/// A frame that is not used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Its place in `frames.csv`.
    pub index: usize,
    /// Its file name.
    pub filename: String,
    /// "no such file", "black", "saturated".
    pub why: String,
}

/// What the intervals come from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bootstrap {
    /// Number of resamples.
    pub resamples: usize,
    /// Frames a block.
    pub block: usize,
    /// Closed fraction of each resample, sorted.
    #[serde(deserialize_with = "figures")]
    pub closed_fraction: Vec<f64>,
}

/// Something to do next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NextStep {
    /// What it is for.
    pub purpose: String,
    /// The command.
    pub command: String,
}

fn yes() -> bool {
    true
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_true(v: &bool) -> bool {
    *v
}

/// A figure; `null`, as which JSON has what is not finite, is NaN.
fn figure<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

/// See [`figure`].
fn pair<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<[f64; 2], D::Error> {
    Ok(<[Option<f64>; 2]>::deserialize(from)?.map(|v| v.unwrap_or(f64::NAN)))
}

/// See [`figure`].
fn figures<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Vec<f64>, D::Error> {
    Ok(Vec::<Option<f64>>::deserialize(from)?.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect())
}

impl Report {
    /// Reads the text of `report.json`; `path` is what errors name. Where a figure is `null` it is NaN, so that a
    /// report comes back as it was written, but for the sign of what is infinite.
    ///
    /// # Errors
    /// Text that is no report, with the line.
    pub fn from_json(path: &Path, text: &str) -> Result<Self> {
        serde_json::from_str(text).map_err(|e| {
            Error::input(path, e.line(), e.to_string(), "a report as `shutterbug diagnose` writes it")
        })
    }

    /// Writes `report.json` into a folder; nothing half-written keeps its name.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_atomic(&folder.join(REPORT_FILE), self.to_json().as_bytes())
    }
}
