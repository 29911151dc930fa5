//! Frames that cannot be judged are refused in one line that says why.
#![allow(clippy::unwrap_used)]

use std::f64::consts::PI;
use std::fs;

use glam::DQuat;

use crate::diagnose_support::{CAMERA, make, run};
use crate::gpu_support::device;
use shutterbug::camera::Pose;
use shutterbug::capture::Capture;
use shutterbug::plane::{Plane, write_png_atomic};
use shutterbug_diagnose::diagnose::{DiagnoseOptions, Progress, Report, Verdict, diagnose, effect_names};

struct Silent;

impl Progress for Silent {
    fn step(&mut self, _: &str, _: &str, _: usize, _: usize) {}
}

#[test]
#[ignore = "long: half a minute"]
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

/// Candidates of several kinds.
const SOME: [&str; 6] = ["exposure_gain", "gamma", "vignetting", "read_noise", "pose_offset", "defocus"];

/// Where no candidate matters.
const ONE: [&str; 1] = ["exposure_gain"];

/// Diagnoses with these candidates only.
fn brief(context: &crate::gpu_support::Watched, capture: &Capture, kept: &[&str]) -> Result<Report, String> {
    let without = effect_names().into_iter().filter(|n| !kept.contains(n)).map(str::to_owned).collect();
    let options = DiagnoseOptions { without, ..DiagnoseOptions::default() };
    diagnose(&context.0, capture, &options, &mut Silent).map(|d| d.report).map_err(|e| e.to_string())
}

#[test]
#[ignore = "long: a minute"]
fn frames_of_another_scene_are_no_effect_of_the_camera() {
    let Some(context) = device("another_scene") else { return };
    let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let capture = make(&context.0, folder.path(), "", "", 1.0, 7);
    make(&context.0, other.path(), "", "", 1.0, 1234);
    for f in 0..9 {
        let name = format!("real/{f:06}.png");
        fs::copy(other.path().join(&name), folder.path().join(&name)).unwrap();
    }
    let report = brief(&context, &capture, &SOME).unwrap();
    assert_eq!(report.verdict, Verdict::UnknownEffect, "{:?}", report.gap);
    assert!(report.effects.is_empty(), "an invented cause: {:?}", report.effects);
    assert_eq!(report.gap.closed_fraction, 0.0);
    assert!(report.sentence.contains("this scene") && report.sentence.contains("no effect of the camera"));
    assert!(
        report.warnings.iter().any(|w| w.contains("do not seem to show this scene")),
        "{:?}",
        report.warnings
    );
    // Control: its own frames with an effect that is no candidate are a gap of another kind.
    let capture = make(&context.0, folder.path(), "[white_balance]\nr = 1.3\nb = 0.8\n", "", 1.0, 7);
    let report = brief(&context, &capture, &SOME).unwrap();
    assert!(!report.sentence.contains("this scene") && report.gap.before > 2.0, "{}", report.sentence);
    assert!(!report.warnings.iter().any(|w| w.contains("this scene")), "{:?}", report.warnings);
}

/// Poses of another convention show another part of the room: the convention in which the frames fit is named.
#[test]
fn poses_in_another_convention_are_asked_about() {
    let Some(context) = device("poses_convention") else { return };
    let folder = tempfile::tempdir().unwrap();
    let capture = make(&context.0, folder.path(), "", "", 1.0, 7);
    let report = brief(&context, &capture, &ONE).unwrap();
    assert!(!report.sentence.contains("trajectory.tum"), "control: {}", report.sentence);
    let path = folder.path().join("trajectory.tum");
    let upside_down: fn(&Pose) -> Pose = |p| Pose { rotation: p.rotation * DQuat::from_rotation_x(PI), ..*p };
    type Written<'a> = (&'a str, fn(&Pose) -> Pose);
    let conventions: [Written<'_>; 2] =
        [("from the world to the camera", Pose::inverse), ("OpenGL", upside_down)];
    for (words, written) in conventions {
        fs::write(&path, capture.trajectory.mapped(written).to_tum(capture.epoch_ns)).unwrap();
        let capture = Capture::read(folder.path(), None).unwrap();
        let report = brief(&context, &capture, &ONE).unwrap();
        let said = &report.warnings[0];
        assert!(said.contains("trajectory.tum") && said.contains(words), "{said}");
        assert!(report.sentence.contains(said.as_str()), "first of all: {}", report.sentence);
    }
}

#[test]
fn times_without_poses_and_masks_without_pixels_are_refused() {
    let Some(context) = device("no_poses") else { return };
    let folder = tempfile::tempdir().unwrap();
    let capture = make(&context.0, folder.path(), "", "", 1.0, 7);
    // Frames long after the trajectory's end: an error that names frame and span, and no report.
    let csv = |late: usize| {
        let stamp = |f: usize| {
            100_000_000_000_i64 + 40_000_000 * f as i64 + if f >= 9 - late { 60_000_000_000 } else { 0 }
        };
        let lines: Vec<String> = (0..9).map(|f| format!("{},{f:06}.png", stamp(f))).collect();
        fs::write(
            folder.path().join("frames.csv"),
            format!("#timestamp [ns],filename\n{}\n", lines.join("\n")),
        )
        .unwrap();
    };
    let reread = || Capture::read(folder.path(), None).map_err(|e| e.to_string());
    for (late, first) in [(1, "frame 8 (000008.png)"), (9, "frame 0 (000000.png)")] {
        csv(late);
        let said = reread().and_then(|c| brief(&context, &c, &ONE).map(|_| ())).unwrap_err();
        assert!(
            said.contains(first) && said.contains("trajectory.tum") && said.contains("covers only"),
            "{said}"
        );
        assert!(said.contains("160."), "the span: {said}");
    }
    csv(0);
    assert!(brief(&context, &reread().unwrap(), &ONE).is_ok(), "control");

    // Too few frames.
    for f in 3..9 {
        fs::rename(
            folder.path().join(format!("real/{f:06}.png")),
            folder.path().join(format!("real/kept{f}")),
        )
        .unwrap();
    }
    let said = brief(&context, &capture, &ONE).unwrap_err();
    assert!(
        said.contains("3 usable frames") && said.contains("no such file") && said.contains("at least 4"),
        "{said}"
    );
    for f in 3..9 {
        fs::rename(
            folder.path().join(format!("real/kept{f}")),
            folder.path().join(format!("real/{f:06}.png")),
        )
        .unwrap();
    }

    // A scene that fills hardly any of the picture, whose background is not to be compared.
    let text = "mtllib scene.mtl\nusemtl m1\nv 50 0 0\nv 50 1 0\nv 50 0 1\nf 1 2 3\n";
    fs::write(folder.path().join("scene.obj"), text).unwrap();
    fs::write(folder.path().join("camera.toml"), format!("{CAMERA}background = \"ignore\"\n")).unwrap();
    let said = brief(&context, &reread().unwrap(), &ONE).unwrap_err();
    assert!(said.contains("leaves less than 1 % of the pixels") && said.contains("camera.toml"), "{said}");
}

#[test]
fn what_is_not_simulated_is_said() {
    let Some(context) = device("auto_exposure") else { return };
    let folder = tempfile::tempdir().unwrap();
    let capture = make(&context.0, folder.path(), "", "[auto_exposure]\ntarget = 0.2\n", 1.0, 7);
    let report = brief(&context, &capture, &ONE).unwrap();
    let said =
        report.warnings.iter().any(|w| w.contains("[auto_exposure]") && w.contains("does not simulate"));
    assert!(said, "{:?}", report.warnings);
    let capture = make(&context.0, folder.path(), "", "[gamma]\nexponent = 1.0\n", 1.0, 7);
    assert!(brief(&context, &capture, &ONE).unwrap().warnings.is_empty(), "control");
}
