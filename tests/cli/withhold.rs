//! `withhold` as a process among others.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::device_is_there;

/// Begins one case in a folder and asks the process alone to stop once its diagnosis has begun.
fn stopped(out: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
    let size = ["--count", "1", "--seed", "3", "--width", "128", "--height", "96"];
    command.arg("withhold").args(size).arg("--out").arg(out).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let deadline = Instant::now() + Duration::from_secs(120);
    while !out.join("case-000/diagnosis/progress.jsonl").exists() {
        assert!(Instant::now() < deadline && child.try_wait().unwrap().is_none(), "no diagnosis was caught");
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    child.wait_with_output().unwrap()
}

#[test]
fn a_signal_to_withhold_alone_stops_its_diagnosis_too() {
    if !device_is_there("a_signal_to_withhold_alone_stops_its_diagnosis_too") {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let said = stopped(dir.path());
    let text = String::from_utf8_lossy(&said.stderr);
    assert_eq!(said.status.code(), Some(1), "{text}");
    assert!(text.contains("interrupted after 0 of 1 cases; run the same command again to go on"), "{text}");
    let diagnosis = dir.path().join("case-000/diagnosis");
    assert!(diagnosis.join("progress.jsonl").exists(), "what it had worked out is kept");
    assert!(!diagnosis.join("report.json").exists(), "it was stopped, and did not come to its end");
}

#[test]
fn names_that_are_none_are_refused_before_a_folder_is_made() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    for (option, name, said) in [
        ("--curve", "defocuss", "--curve: unknown effect with grades `defocuss`"),
        ("--imperfect", "lamp", "--imperfect: unknown part of a description `lamp`"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
        command.arg("withhold").arg("--out").arg(&out).args(["--seed", "3", option, name]);
        let done = command.output().unwrap();
        let text = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(2), "{text}");
        assert!(text.contains(said), "{text}");
        assert!(!out.exists());
    }
}
