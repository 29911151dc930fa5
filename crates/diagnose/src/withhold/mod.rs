//! Checks of `diagnose` on withheld effects: captures are made with effects that are hidden, diagnosed blind, and only
//! then are the answers opened and scored.
//!
//! * Frames come from the accumulation reference and the CPU chain, never from the engine that the fits use.
//! * An answer is sealed by its SHA-256, printed and written to `seals.txt` before the diagnosis starts. The answer
//!   itself is on no disk until the diagnosis has ended: it is drawn again from the seed, and must have the sealed
//!   hash.
//! * The diagnosis is a process of its own that is given the capture's folder and, for runs without one candidate, the
//!   name of that candidate.
//! * A run that was interrupted goes on where it stopped: a case that has a `score.json` is done.

#[cfg(all(test, feature = "added-effect"))]
mod added_effect;
mod alike;
mod child;
mod curve;
mod curve_page;
mod curve_result;
mod draw;
mod falsify;
mod form;
mod hidden;
mod make;
mod motion;
mod page;
mod room;
mod score;

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

pub use curve::{CurveOptions, curves};
pub use curve_result::{Curve, CurveCase, CurvePoint, CurveResult};
pub use falsify::Falsified;
pub use form::Form;
pub use hidden::Kind;
pub use score::{CaseScore, ParameterScore, Summary, Tally};

use crate::diagnose::{REPORT_FILE, Report};
use crate::out;
use child::made;
use make::Case;
use shutterbug::capture::{CameraFile, read_text};
use shutterbug::chain::Settings;
use shutterbug::error::{Error, Result, counted};
use shutterbug::files::{self, Limit};
use shutterbug::plane::write_atomic;

/// Goes up with every change of what a seed makes, so that no run goes on with cases of another generator.
const GENERATOR: u32 = 8;

/// What to make and check.
#[derive(Clone, Debug)]
pub struct WithholdOptions {
    /// Folder of everything.
    pub out: PathBuf,
    /// Number of captures.
    pub count: usize,
    /// Seed of everything.
    pub seed: u64,
    /// Width and height of the frames, px.
    pub size_px: [u32; 2],
    /// Frames a capture; else 10 to 16, drawn.
    pub frames: Option<usize>,
    /// TUM files of recorded motion; half of the captures move as these do.
    pub recordings: Vec<PathBuf>,
    /// The program whose `diagnose` is checked.
    pub program: PathBuf,
    /// Device for the diagnosis.
    pub device: Option<String>,
    /// Keep the real frames of a case that is done (they are most of its bytes).
    pub keep_frames: bool,
    /// Numbers of the cases to make, from 0; all if empty. Cases do not depend on each other.
    pub only: Vec<usize>,
    /// What of the descriptions is falsified, in every capture.
    pub falsified: Vec<Falsified>,
    /// What a diagnosis is given.
    pub form: Form,
}

/// All scores and the table over them, as in `withhold.json`.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct WithholdResult {
    /// Everything that the captures depend on.
    pub options: serde_json::Value,
    /// The table.
    pub summary: Summary,
    /// One entry a case.
    pub cases: Vec<CaseScore>,
}

/// Makes, diagnoses and scores; writes `withhold.json` and `withhold.html` after each case. `say` is told what goes on,
/// a line at a time; when `stop` says so, the run ends after what it is at.
///
/// # Errors
/// A folder of a run with other options; files that cannot be read or written; a diagnosis that fails;
/// [`Error::CasesInterrupted`].
pub fn withhold(
    options: &WithholdOptions,
    say: &mut dyn FnMut(&str),
    stop: &dyn Fn() -> bool,
) -> Result<WithholdResult> {
    fs::create_dir_all(&options.out).map_err(|e| Error::io(&options.out, "create the folder", e))?;
    let manifest = begin(options)?;
    let candidates = crate::diagnose::effect_names();
    let available = falsify::tells(&options.falsified, options.form.tells(&hidden::available(&candidates)));
    say(&format!(
        "{} hidden: {}",
        counted(available.len(), "effect can be", "effects can be"),
        available.join(", ")
    ));
    let (clock, mut fresh) = (Instant::now(), 0usize);
    let mut result = WithholdResult { options: manifest, summary: Summary::default(), cases: Vec::new() };
    for index in 0..options.count {
        let folder = options.out.join(format!("case-{index:03}"));
        let score = match read_score(&folder)? {
            Some(score) => score,
            None if !options.only.is_empty() && !options.only.contains(&index) => continue,
            None => {
                let score = unless_stopped([index, options.count], stop, || {
                    one_case(options, &available, &candidates, index, &folder, say, stop)
                })?;
                fresh += 1;
                let left = (options.count - index - 1) as f64 * clock.elapsed().as_secs_f64() / fresh as f64;
                let mark = match (score.exact, score.exact_or_alike) {
                    (true, _) => "right",
                    (_, true) => "told as what does the same here",
                    _ => "WRONG",
                };
                say(&format!(
                    "case {}/{}: {mark}: hidden [{}], said {} [{}]; {:.0} min left",
                    index + 1,
                    options.count,
                    score.hidden.join(", "),
                    score.verdict,
                    score.found.join(", "),
                    left / 60.0
                ));
                score
            }
        };
        result.cases.push(score);
        result.summary = Summary::of(&result.cases);
        let json = serde_json::to_string_pretty(&result).expect("all keys are strings");
        write_atomic(&options.out.join("withhold.json"), json.as_bytes())?;
    }
    page::write(&result, &options.out)?;
    Ok(result)
}

/// Runs a case, unless somebody has asked to stop. An interruption within it is one of the run.
fn unless_stopped<T>(
    [done, total]: [usize; 2],
    stop: &dyn Fn() -> bool,
    case: impl FnOnce() -> Result<T>,
) -> Result<T> {
    match if stop() { Err(Error::CasesInterrupted { done, total }) } else { case() } {
        Err(Error::Interrupted { .. } | Error::CasesInterrupted { .. }) => {
            Err(Error::CasesInterrupted { done, total })
        }
        other => other,
    }
}

fn one_case(
    options: &WithholdOptions,
    available: &[&'static str],
    candidates: &[&'static str],
    index: usize,
    folder: &Path,
    say: &mut dyn FnMut(&str),
    stop: &dyn Fn() -> bool,
) -> Result<CaseScore> {
    let capture = folder.join("capture");
    let hide = |camera: &CameraFile| {
        let fits = |settings: &Settings| hidden::has_rays(settings, &camera.intrinsics);
        hidden::draw(options.seed, index, available, &camera.settings, &fits)
    };
    // Simulated frames show what their camera models: an ideal one shows nothing.
    let plain = options.form != Form::Capture;
    let case = Case::make(options, index, &capture, plain, &hide)?;
    let answer = case.answer();
    let seal = sha256_hex(answer.as_bytes());
    say(&format!("case {}/{}: sealed answer {seal}", index + 1, options.count));
    append(&options.out.join("seals.txt"), &format!("{seal}  case-{index:03}/answer.json\n"))?;
    case.render(stop)?;
    let left_out = if case.hidden.kind == Kind::LeftOut { &case.hidden.names[..] } else { &[] };
    let sim = folder.join("sim");
    if options.form != Form::Capture {
        options.form.make(options, index, (&capture, &sim), stop)?;
    }
    let blind = diagnose(options, &capture, &folder.join("diagnosis"), None, left_out, stop)?;
    // Opened: the diagnosis has ended.
    write_atomic(&folder.join("answer.json"), answer.as_bytes())?;
    let opened = serde_json::from_str(&answer).expect("just written as JSON");
    let mut score = CaseScore::new(&opened, case.hidden.kind, &case.motion, Ok(&blind));
    let asked = matches!(case.hidden.kind, Kind::Single | Kind::Several);
    if asked && options.form == Form::Capture {
        let camera = folder.join("true-camera.toml");
        case.write_true_camera(&camera)?;
        // Nothing is tried: what is asked for is the score of the true camera by the same judge.
        let truth = diagnose(options, &capture, &folder.join("truth"), Some(&camera), candidates, stop)?;
        let g = &blind.gap;
        score.closed_by_truth =
            Some((g.before - truth.gap.before) / (g.before - g.floor)).filter(|f| f.is_finite());
    }
    let json = serde_json::to_string_pretty(&score).expect("all keys are strings");
    page::keep_picture(&capture, folder)?;
    if !options.keep_frames {
        let real = capture.join("real");
        fs::remove_dir_all(&real).map_err(|e| Error::io(&real, "remove", e))?;
        if options.form != Form::Capture {
            fs::remove_dir_all(&sim).map_err(|e| Error::io(&sim, "remove", e))?;
        }
    }
    write_atomic(&folder.join("score.json"), json.as_bytes())?;
    Ok(score)
}

/// Runs `diagnose` in a process of its own. One that fails (no device, no memory, frames that cannot be used) says
/// nothing about what was hidden: it is an error, no wrong answer, and the case is not done.
fn diagnose(
    options: &WithholdOptions,
    capture: &Path,
    out: &Path,
    camera: Option<&Path>,
    without: &[&str],
    stop: &dyn Fn() -> bool,
) -> Result<Report> {
    out::made_elsewhere(out)?;
    let mut command = Command::new(&options.program);
    command.arg("diagnose");
    if options.form == Form::Capture {
        command.arg(capture);
    } else {
        let sim = capture.with_file_name("sim");
        command.arg("--sim").arg(sim).arg("--real").arg(capture.join("real"));
        command.args((options.form == Form::Unpaired).then_some("--unpaired"));
    }
    command.arg("--out").arg(out).stdin(Stdio::null());
    if let Some(camera) = camera {
        command.arg("--camera").arg(camera);
    }
    if !without.is_empty() {
        command.arg("--without").arg(without.join(","));
    }
    // Frames that are given need none.
    if let Some(device) = options.device.as_ref().filter(|_| options.form == Form::Capture) {
        command.arg("--device").arg(device);
    }
    made(command, "diagnosis", capture, stop)?;
    let path = out.join(REPORT_FILE);
    let text = read_text(&path, "the report of the diagnosis", Limit::OWN)?;
    Report::from_json(&path, &text)
}

/// Writes what the captures depend on; a folder of other ones is refused.
fn begin(options: &WithholdOptions) -> Result<serde_json::Value> {
    let recordings: Vec<String> = options
        .recordings
        .iter()
        .filter_map(|p| Some(p.file_name()?.to_string_lossy().into_owned()))
        .collect();
    let mut manifest = serde_json::json!({
        "shutterbug": env!("CARGO_PKG_VERSION"), "generator": GENERATOR, "seed": options.seed,
        "size_px": options.size_px,
        "frames": options.frames, "recordings": recordings,
    });
    if !options.falsified.is_empty() {
        manifest["imperfect"] = serde_json::json!(options.falsified);
    }
    if options.form != Form::Capture {
        manifest["form"] = serde_json::json!(options.form);
    }
    let path = options.out.join("options.json");
    let text = serde_json::to_string_pretty(&manifest).expect("plain data") + "\n";
    match files::read_if_there(&path, Limit::OWN)? {
        Some(before) if before == text.as_bytes() => Ok(manifest),
        Some(_) => {
            let expected = "the same seed, size, frames and recordings as now; use another --out";
            Err(Error::input(&path, None, "a run with other options", expected))
        }
        None => write_atomic(&path, text.as_bytes()).map(|()| manifest),
    }
}

fn read_score(folder: &Path) -> Result<Option<CaseScore>> {
    let path = folder.join("score.json");
    let Some(text) = files::read_if_there(&path, Limit::OWN)? else { return Ok(None) };
    let score = serde_json::from_slice(&text)
        .map_err(|e| Error::input(&path, e.line(), e.to_string(), "a score as this program writes it"))?;
    // A rate counts what was measured, and no more.
    for path in [path, folder.join("answer.json")] {
        if !out::is_as_made(&path) {
            let found =
                if path.exists() { "a file that was changed since" } else { "no such file beside a score" };
            let expected = "what the run wrote; remove the case's folder to run it again";
            return Err(Error::input(&path, None, found, expected));
        }
    }
    Ok(Some(score))
}

fn append(path: &Path, line: &str) -> Result<()> {
    out::grows(path)?;
    let opened = fs::OpenOptions::new().create(true).append(true).open(path);
    opened.and_then(|mut f| f.write_all(line.as_bytes())).map_err(|e| Error::io(path, "write", e))
}

/// SHA-256 as 64 hexadecimal digits.
fn sha256_hex(bytes: &[u8]) -> String {
    out::sha256_hex(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::out::{Out, OutRules};

    #[test]
    fn a_score_that_was_changed_or_lacks_its_answer_is_not_counted() {
        let above = tempfile::tempdir().unwrap();
        let root = above.path().join("out");
        let rules = OutRules { command: "withhold", inputs: &[], overwrite: false, goes_on: true };
        let out = Out::open(&root, &rules).unwrap();
        out.go_on().unwrap();
        let folder = root.join("case-000");
        fs::create_dir(&folder).unwrap();
        let score = |exact: bool| {
            serde_json::json!({
                "case": 0, "kind": "single", "motion": "hand", "hidden": ["gamma"], "found": [], "verdict": "no_gap",
                "sentence": "", "first_right": false, "exact": exact, "gap": [1.0, 1.0, 1.0], "closed": 0.0,
                "closed_by_truth": null, "parameters": [], "seconds": 1.0
            })
            .to_string()
        };
        let (path, answer) = (folder.join("score.json"), folder.join("answer.json"));
        write_atomic(&answer, b"{}").unwrap();
        write_atomic(&path, score(false).as_bytes()).unwrap();
        assert!(read_score(&folder).unwrap().is_some(), "control");
        fs::write(&path, score(true)).unwrap();
        assert!(read_score(&folder).unwrap_err().to_string().contains("changed since"));
        fs::write(&path, score(false)).unwrap();
        fs::remove_file(&answer).unwrap();
        assert!(read_score(&folder).unwrap_err().to_string().contains("no such file beside a score"));
    }
}
