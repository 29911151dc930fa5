//! The pages of `docs/reference` are what the program says of itself (`tools/reference` writes them), and a report is
//! what `docs/reference/report.schema.json` says. Skipped by name where there is no Python.

#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};

const PROGRAM: &str = env!("CARGO_BIN_EXE_shutterbug");

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// Runs `tools/reference`; none where there is no Python.
fn reference(arguments: &[&str]) -> Option<Output> {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("SKIPPED: no python3");
        return None;
    }
    let tool = root().join("tools/reference");
    Some(Command::new("python3").arg(tool).args(arguments).output().expect("python3 runs"))
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

#[test]
fn the_pages_are_what_the_program_says() {
    let Some(output) = reference(&["--check", "--program", PROGRAM]) else { return };
    assert!(output.status.success(), "{}", said(&output));

    // Control: a page that says something else.
    let folder = tempfile::tempdir().unwrap();
    for page in ["cli.md", "camera.md"] {
        let text = std::fs::read_to_string(root().join("docs/reference").join(page)).unwrap();
        let text = if page == "camera.md" { text.replacen("gain", "gian", 1) } else { text };
        std::fs::write(folder.path().join(page), text).unwrap();
    }
    let folder = folder.path().to_str().unwrap();
    let output = reference(&["--check", "--program", PROGRAM, "--folder", folder]).unwrap();
    let text = said(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("camera.md") && !text.contains("cli.md"), "{text}");
}

#[test]
fn a_report_is_what_the_schema_says() {
    if reference(&["--help"]).is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let camera = |more: &str| {
        let pinhole = "width = 96\nheight = 72\nfx = 75.0\nfy = 75.0\ncx = 48.0\ncy = 36.0\n";
        format!("{pinhole}frame_period_s = 0.033333333\nshading = \"lit\"\n{more}")
    };
    std::fs::write(at("ideal.toml"), camera("")).unwrap();
    std::fs::write(at("hidden.toml"), camera("[exposure_gain]\ngain = 0.7\n")).unwrap();
    let capture = root().join("demo/capture");
    let run = |arguments: &[&str]| {
        let output = Command::new(PROGRAM).args(arguments).output().expect("the program runs");
        assert!(output.status.success(), "{arguments:?}: {}", said(&output));
    };
    for (camera, out) in [("ideal.toml", "sim"), ("hidden.toml", "real")] {
        run(&["simulate", capture.to_str().unwrap(), "--camera", &at(camera), "--out", &at(out)]);
    }
    run(&[
        "diagnose",
        "--sim",
        &at("sim"),
        "--real",
        &at("real"),
        "--out",
        &at("found"),
        "--time-limit-s",
        "60",
    ]);

    let report = at("found/report.json");
    let output = reference(&["--validate", &report]).unwrap();
    assert!(output.status.success(), "{}", said(&output));

    // Control: a verdict that is none, and a key that is missing.
    let text = std::fs::read_to_string(&report).unwrap();
    let wrong = text.replacen("\"verdict\": \"", "\"verdict\": \"not_", 1);
    let lacking = text.replacen("\"sentence\"", "\"sentense\"", 1);
    for (text, says) in [(wrong, "report.verdict"), (lacking, "lacks sentence")] {
        std::fs::write(at("wrong.json"), text).unwrap();
        let output = reference(&["--validate", &at("wrong.json")]).unwrap();
        assert_eq!(output.status.code(), Some(1));
        assert!(said(&output).contains(says), "{}", said(&output));
    }
}
