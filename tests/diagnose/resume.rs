//! A diagnosis that was interrupted goes on where it stopped, to the same report to the last byte; what it has kept is
//! of no use to any other.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::diagnose_support::{make, names};
use crate::gpu_support::device;
use shutterbug::capture::Capture;
use shutterbug::error::Error;
use shutterbug::gpu::Context;
use shutterbug_diagnose::diagnose::{DiagnoseOptions, Progress, Report, diagnose};

/// What takes long and has no part in this.
const WITHOUT: [&str; 9] = [
    "jpeg",
    "glare",
    "flicker",
    "sharpening",
    "defocus",
    "chromatic_aberration",
    "bayer_mosaic",
    "chroma_subsampling",
    "motion_blur",
];

/// Asks to stop at the step that it is told.
#[derive(Default)]
struct Stopping {
    at: Option<(&'static str, usize)>,
    stop: Arc<AtomicBool>,
    said: Vec<String>,
}

impl Progress for Stopping {
    fn step(&mut self, stage: &str, what: &str, step: usize, _: usize) {
        self.said.push(format!("{stage}: {what}"));
        if self.at.is_some_and(|(s, n)| stage.starts_with(s) && step == n) {
            self.stop.store(true, Ordering::SeqCst);
        }
    }
}

/// Runs until done or stopped. Returns the text of the report without its times, or the error.
fn run(
    context: &Arc<Context>,
    capture: &Capture,
    out: &Path,
    seed: u64,
    at: Option<(&'static str, usize)>,
) -> (Result<String, Error>, Vec<String>) {
    let mut progress = Stopping { at, ..Stopping::default() };
    let options = DiagnoseOptions {
        seed,
        journal: Some(out.join("progress.jsonl")),
        stop: Some(progress.stop.clone()),
        without: WITHOUT.map(String::from).to_vec(),
        ..DiagnoseOptions::default()
    };
    let done = diagnose(context, capture, &options, &mut progress).map(|diagnosis| {
        let mut report: Report = diagnosis.write(out, capture).unwrap();
        assert_eq!(names(&report), ["lens_distortion", "rolling_shutter"], "{:?}", report.gap);
        (report.input.seconds, report.input.renders, report.input.render_seconds) = (0.0, 0, 0.0);
        report.to_json() + &fs::read_to_string(out.join("camera.toml")).unwrap()
    });
    (done, progress.said)
}

#[test]
#[ignore = "long: more than a minute"]
fn an_interrupted_diagnosis_goes_on_to_the_same_report() {
    let Some(context) = device("resume") else { return };
    let folder = tempfile::tempdir().unwrap();
    let hidden = "[rolling_shutter]\nreadout_time_s = 0.02\n[lens_distortion]\nk1 = -0.12\n";
    let capture = make(&context.0, folder.path(), hidden, "", 1.0, 12);
    let fresh = || tempfile::tempdir().unwrap();
    let (whole, interrupted) = (fresh(), fresh());
    let (done, steps) = run(&context.0, &capture, whole.path(), 3, None);
    let done = done.unwrap_or_else(|e| panic!("{e}"));
    // Stopped while each candidate is tried, while sets are, and near the end.
    let stages = [("each candidate alone", 6), ("candidates beside", 2), ("the set to the end", 2)];
    for (n, at) in stages.into_iter().enumerate() {
        let (stopped, said) = run(&context.0, &capture, interrupted.path(), 3, Some(at));
        let error = stopped.expect_err("it was asked to stop");
        let text = error.to_string();
        assert!(matches!(error, Error::DiagnosisInterrupted { .. }), "{text}");
        assert!(
            text.contains(at.0) && text.contains("progress.jsonl") && text.contains("same command"),
            "{text}"
        );
        assert!(!interrupted.path().join("report.json").exists(), "no report before the end");
        assert!(said.len() < steps.len() + 1);
        assert_eq!(said[0].starts_with("going on"), n > 0, "{said:?}");
        // Every line is whole; stage and candidate can be read by people.
        let journal = fs::read_to_string(interrupted.path().join("progress.jsonl")).unwrap();
        assert!(journal.lines().all(|l| serde_json::from_str::<serde_json::Value>(l).is_ok()));
        assert!(journal.contains(r#""stage":"each candidate alone","what":"rolling_shutter""#));
    }
    let kept = fs::read_to_string(interrupted.path().join("progress.jsonl")).unwrap();
    let (again, _) = run(&context.0, &capture, interrupted.path(), 3, None);
    let again = again.unwrap_or_else(|e| panic!("{e}"));
    let other = again.lines().zip(done.lines()).filter(|(a, b)| a != b);
    let other: Vec<_> = other.take(12).collect();
    assert!(again == done, "not byte for byte: {other:#?}");
    // Control: another seed is another diagnosis and starts anew.
    fs::write(interrupted.path().join("progress.jsonl"), &kept).unwrap();
    let (other, said) = run(&context.0, &capture, interrupted.path(), 4, Some(("each candidate alone", 1)));
    assert!(!said[0].starts_with("going on") && other.is_err(), "{said:?}");
    // Control: what is kept is used. Changed there, it changes the result.
    let spoilt: Vec<String> = kept.lines().map(spoil).collect();
    fs::write(interrupted.path().join("progress.jsonl"), spoilt.join("\n") + "\n").unwrap();
    let (spoilt, said) = run(&context.0, &capture, interrupted.path(), 3, Some(("the set to the end", 1)));
    assert!(said[0].starts_with("going on"));
    assert!(spoilt.is_err());
    assert!(!steps.starts_with(&said[1..]), "a candidate whose fit was spoilt is judged as before");
}

/// The rolling shutter's own fit becomes neutral.
fn spoil(line: &str) -> String {
    let mut value: serde_json::Value = serde_json::from_str(line).unwrap();
    if value["kind"] == "candidate" && value["key"].as_str().unwrap().starts_with("rolling_shutter") {
        // The readout is the one number near the hidden one.
        let values = value["value"]["theta"]["values"].as_array_mut().unwrap();
        let near = |v: &&mut serde_json::Value| (0.01..0.04).contains(&v.as_f64().unwrap());
        values.iter_mut().filter(near).for_each(|v| *v = 0.0.into());
    }
    value.to_string()
}
