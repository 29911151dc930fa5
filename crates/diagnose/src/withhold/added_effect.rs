//! An effect that is added by the list of `docs/add-an-effect.md` is hidden and diagnosed like any other, though
//! nothing in `diagnose` or here has heard of it.

use std::path::Path;

use super::hidden::{Hidden, Kind};
use super::make::Case;
use super::{Form, WithholdOptions};
use crate::diagnose::{DiagnoseOptions, Progress, Report, Verdict, diagnose, effect_names};
use shutterbug::capture::{CameraFile, Capture};
use shutterbug::chain::Value;
use shutterbug::effects;
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};

const ADDED: &str = "split_toning";
const AMOUNT: f64 = 0.05;

struct Silent;

impl Progress for Silent {
    fn step(&mut self, _: &str, _: &str, _: usize, _: usize) {}
}

/// A capture whose camera has the effect, and whose `camera.toml` does not know it.
fn capture(folder: &Path) -> Capture {
    let options = WithholdOptions {
        falsified: Vec::new(),
        out: folder.to_owned(),
        count: 1,
        seed: 2026,
        size_px: [96, 72],
        frames: Some(8),
        recordings: Vec::new(),
        program: folder.join("unused"),
        device: None,
        keep_frames: true,
        only: Vec::new(),
        form: Form::Capture,
    };
    let hide = |camera: &CameraFile| {
        let mut settings = camera.settings.clone();
        settings.set(effects::by_id(ADDED).expect("in the list"), "amount", Value::Number(AMOUNT))?;
        Ok(Hidden { kind: Kind::Single, names: vec![ADDED], settings })
    };
    let path = folder.join("capture");
    let case = Case::make(&options, 0, &path, true, &hide).expect("can be made");
    case.render(&|| false).expect("can be rendered");
    Capture::read(&path, None).expect("is complete")
}

fn report(capture: &Capture, without: &[&str]) -> Report {
    let options = ContextOptions { device: DeviceChoice::First, validation: Validation::Off };
    let context = Context::new(&options).expect("a device");
    let without = without.iter().map(|n| (*n).to_owned()).collect();
    let options = DiagnoseOptions { without, ..DiagnoseOptions::default() };
    diagnose(&context, capture, &options, &mut Silent).expect("comes to a verdict").report
}

#[test]
fn an_added_effect_is_a_candidate_and_found() {
    assert!(effect_names().contains(&ADDED), "it has a fit line");
    let folder = tempfile::tempdir().expect("a folder");
    let capture = capture(folder.path());
    let found = report(&capture, &[]);
    let names: Vec<&str> = found.effects.iter().map(|e| e.name.as_str()).collect();
    assert_eq!((names, found.verdict), (vec![ADDED], Verdict::Explained), "{}", found.sentence);
    let amount = &found.effects[0].parameters["amount"];
    let value = amount.value.as_f64().expect("a number");
    assert!((value / AMOUNT - 1.0).abs() < 0.02, "{value} for {AMOUNT}");
    // Control: where it is no candidate nobody names it.
    let blind = report(&capture, &[ADDED]);
    assert_eq!(blind.verdict, Verdict::UnknownEffect, "{}", blind.sentence);
}
