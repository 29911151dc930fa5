//! Frames that cannot be judged are refused in one line that says why.
#![allow(clippy::unwrap_used)]

mod diagnose_support;
mod gpu_support;

use std::fs;

use diagnose_support::{make, run};
use gpu_support::device;
use shutterbug::capture::Capture;
use shutterbug::diagnose::{DiagnoseOptions, Progress, diagnose};
use shutterbug::plane::{Plane, write_png_atomic};

struct Silent;

impl Progress for Silent {
    fn step(&mut self, _: &str, _: &str, _: usize, _: usize) {}
}

#[test]
fn frames_that_cannot_be_judged_are_refused() {
    let Some(context) = device("bad_frames") else { return };
    let folder = tempfile::tempdir().unwrap();
    let capture = make(&context.0, folder.path(), "", "", 1.0, 7);
    let real = folder.path().join("real");
    let error = |options: &DiagnoseOptions, capture: &Capture| match diagnose(
        &context.0,
        capture,
        options,
        &mut Silent,
    ) {
        Ok(_) => panic!("was accepted"),
        Err(e) => e.to_string(),
    };
    let all = DiagnoseOptions::default();
    let typo = DiagnoseOptions { without: vec!["motion_blurr".to_owned()], ..all.clone() };
    assert!(error(&typo, &capture).contains("did you mean `motion_blur`"));

    let grey = |w: usize, v: u8| Plane::from_fn(w, 96, |_, _| [v, v, v]);
    let kept = fs::read(real.join("000003.png")).unwrap();
    write_png_atomic(&real.join("000003.png"), &grey(130, 90)).unwrap();
    let said = error(&all, &capture);
    assert!(said.contains("000003.png") && said.contains("130x96") && said.contains("128x96"), "{said}");
    fs::write(real.join("000003.png"), &kept[..kept.len() / 2]).unwrap();
    assert!(error(&all, &capture).contains("000003.png"));
    fs::write(real.join("000003.png"), &kept).unwrap();

    // One black frame is left out, and said so.
    write_png_atomic(&real.join("000004.png"), &grey(128, 0)).unwrap();
    let report = run(&context.0, &capture, &[]).report;
    assert!(report.input.left_out.iter().any(|l| l.index == 4 && l.why == "all black"));
    assert!(!report.warnings.is_empty());

    for f in 0..9 {
        write_png_atomic(&real.join(format!("{f:06}.png")), &grey(128, 255)).unwrap();
    }
    let said = error(&all, &capture);
    assert!(said.contains("0 usable frames") && said.contains("all saturated"), "{said}");
    for f in 2..9 {
        fs::remove_file(real.join(format!("{f:06}.png"))).unwrap();
    }
    assert!(error(&all, &capture).contains("no such file") || error(&all, &capture).contains("usable"));
    fs::remove_dir_all(&real).unwrap();
    assert!(error(&all, &capture).contains("no such folder"));
}
