//! Hidden effects are found, with their parameters, and nothing else is; what is no candidate is not sold as one.
#![allow(clippy::unwrap_used)]

use crate::diagnose_support::{
    CAMERA, FRAMES, frames_of, make, make_by, names, near, parameter, run, run_exact,
};
use crate::gpu_support::device;
use crate::long_support::{left_out, long};
use shutterbug::capture::Capture;
use shutterbug::engine::{ExactOptions, Method};
use shutterbug::plane::metrics::mean_absolute_difference;
use shutterbug_diagnose::diagnose::{CandidateState, Report, Verdict, effect_names};

/// All candidates but those that a test asks of.
fn all_but(asked: &[&str]) -> Vec<&'static str> {
    effect_names().into_iter().filter(|n| !asked.contains(n)).collect()
}

/// Candidates that resemble no shutter and no blur.
const OF_VALUES: [&str; 18] = [
    "jpeg",
    "bayer_mosaic",
    "chroma_subsampling",
    "chromatic_aberration",
    "lens_distortion",
    "white_balance",
    "saturation",
    "tone_curve",
    "exposure_gain",
    "flicker",
    "vignetting",
    "gamma",
    "black_level",
    "quantization",
    "hot_pixels",
    "shot_noise",
    "row_noise",
    "fixed_pattern_noise",
];

#[test]
fn nothing_hidden_is_no_gap() {
    let Some(context) = device("nothing_hidden") else { return };
    let folder = tempfile::tempdir().unwrap();
    let capture = make(&context.0, folder.path(), "", "", 1.0, 1);
    let report = run(&context.0, &capture, &[]).report;
    assert_eq!(report.verdict, Verdict::NoGap, "{:?} {:?}", report.gap, names(&report));
    assert!(report.effects.is_empty() && report.gap.before < 0.3, "{:?}", report.gap);
    // Control: the same frames against a camera that claims a rolling shutter are a gap.
    let wrong = "[rolling_shutter]\nreadout_time_s = 0.02\n";
    std::fs::write(folder.path().join("camera.toml"), format!("{}{wrong}", crate::diagnose_support::CAMERA))
        .unwrap();
    let capture = Capture::read(folder.path(), None).unwrap();
    let report = run(&context.0, &capture, &all_but(&["rolling_shutter", "exposure_gain"])).report;
    assert_ne!(report.verdict, Verdict::NoGap, "{:?}", report.gap);
    assert!(report.gap.before > 1.0, "{:?}", report.gap);
}

#[test]
fn shutter_and_blur_are_told_apart_and_camera_toml_reproduces_them() {
    let Some(context) = device("shutter_and_blur") else { return };
    let folder = tempfile::tempdir().unwrap();
    let hidden = "[rolling_shutter]\nreadout_time_s = 0.021\nscan_order = \"bottom_to_top\"\n[motion_blur]\n\
        exposure_time_s = 0.012\n";
    let capture = make(&context.0, folder.path(), hidden, "", 1.0, 2);
    let diagnosis = run_exact(&context.0, &capture, &OF_VALUES);
    let report = &diagnosis.report;
    assert_eq!(names(report), ["motion_blur", "rolling_shutter"], "{:?}", report.gap);
    near(report, "rolling_shutter", "readout_time_s", 0.021, 0.03);
    near(report, "motion_blur", "exposure_time_s", 0.012, 0.03);
    assert_eq!(report.verdict, Verdict::Explained);
    assert!(report.gap.closed_fraction > 0.93, "{:?}", report.gap);
    let shares: f64 = report.effects.iter().map(|e| e.share).sum();
    assert!((shares - 1.0).abs() < 1e-9 && report.effects[0].share >= report.effects[1].share);
    let offset = report.candidates.iter().find(|c| c.name == "time_offset").unwrap();
    assert_eq!(offset.state, CandidateState::Rejected, "imitates part of both");
    assert!(offset.gap_with.unwrap() < 0.9 * report.gap.before, "the imitation is worth a test: {offset:?}");

    // What was written is what `simulate` reads, and gives the reported difference.
    let out = tempfile::tempdir().unwrap();
    let report = diagnosis.write(out.path(), &capture).unwrap();
    let text = std::fs::read_to_string(out.path().join("report.json")).unwrap();
    let read = Report::from_json(out.path(), &text).unwrap().effects;
    assert_eq!(read.len(), report.effects.len());
    for (read, written) in read.iter().zip(&report.effects) {
        // The last digit of a number may be rounded on its way through a text.
        assert_eq!(read.name, written.name);
        assert!((read.gap_with - written.gap_with).abs() < 1e-9 && (read.share - written.share).abs() < 1e-9);
    }
    let camera = out.path().join("camera.toml");
    let diagnosed = Capture::read(folder.path(), Some(&camera)).unwrap();
    let simulated = frames_of(&context.0, &diagnosed, Method::Exact(ExactOptions::default()));
    let difference = |pictures: &[shutterbug::plane::Plane<u8>]| -> f64 {
        let held = &report.input.held_out_frames;
        let one = |&f: &usize| {
            let path = folder.path().join(format!("real/{f:06}.png"));
            mean_absolute_difference(&pictures[f], &shutterbug::plane::read_rgb8(&path).unwrap())
        };
        held.iter().map(one).sum::<f64>() / held.len() as f64
    };
    let after = report.measures.iter().find(|m| m.name == "mean_absolute_difference").unwrap();
    assert!((difference(&simulated) - after.after).abs() < 0.05, "{} {after:?}", difference(&simulated));
    let given = frames_of(&context.0, &capture, Method::Exact(ExactOptions::default()));
    assert!((difference(&given) - after.before).abs() < 0.1 && after.before > after.after + 1.0, "control");
}

/// Frames that are searched at half of their size: what a smaller camera tells is what the whole one does.
#[test]
#[ignore = "long: more than half a minute"]
fn large_frames_tell_the_same_at_a_smaller_size() {
    let Some(context) = device("large_frames") else { return };
    let folder = tempfile::tempdir().unwrap();
    let camera = "width = 640\nheight = 360\nfx = 550.0\nfy = 550.0\ncx = 322.0\ncy = 178.5\n\
        frame_period_s = 0.04\n";
    let hidden = "[rolling_shutter]\nreadout_time_s = 0.021\nscan_order = \"bottom_to_top\"\n[vignetting]\n\
        a1 = -0.3\na2 = 0.05\n";
    let capture = make_by(&context.0, folder.path(), (camera, FRAMES), [hidden, ""], 0.5, 2);
    let asked = ["rolling_shutter", "time_offset", "pose_offset", "vignetting", "exposure_gain", "gamma"];
    let report = run(&context.0, &capture, &all_but(&asked)).report;
    assert_eq!(names(&report), ["rolling_shutter", "vignetting"], "{:?}", report.gap);
    near(&report, "rolling_shutter", "readout_time_s", 0.021, 0.01);
    near(&report, "vignetting", "a1", -0.3, 0.05);
    // The imitation was fitted at the smaller size alone.
    let offset = report.candidates.iter().find(|c| c.name == "time_offset").unwrap();
    assert!(offset.gap_with.unwrap() < 0.9 * report.gap.before, "{offset:?}");
}

#[test]
#[ignore = "long: more than a minute"]
fn values_and_noise_are_told_apart() {
    let Some(context) = device("values_and_noise") else { return };
    let folder = tempfile::tempdir().unwrap();
    let hidden = "[vignetting]\na1 = -0.4\na2 = 0.05\n[read_noise]\nsigma = 0.012\n";
    let capture = make(&context.0, folder.path(), hidden, "", 1.0, 3);
    let report = run(&context.0, &capture, &[]).report;
    assert_eq!(names(&report), ["read_noise", "vignetting"], "{:?}", report.gap);
    near(&report, "read_noise", "sigma", 0.012, 0.05);
    let (a1, _) = parameter(&report, "vignetting", "a1");
    let (a2, _) = parameter(&report, "vignetting", "a2");
    assert!((a1 + a2 + 0.35).abs() < 0.02, "corner {a1} + {a2}");
    assert!(report.gap.floor > 0.5 && report.gap.after < 1.1 * report.gap.floor, "{:?}", report.gap);
}

/// The neighbours' colours are filled in one way or another, and a filter behind that hides which.
#[test]
fn how_a_mosaic_was_filled_in_is_told_behind_a_filter() {
    let Some(context) = device("filled_in") else { return };
    let folder = tempfile::tempdir().unwrap();
    let hidden = "[bayer_mosaic]\npattern = \"GBRG\"\ndemosaic = \"malvar_he_cutler\"\n[noise_reduction]\n\
        luma_sigma_px = 0.7\nchroma_sigma_px = 1.5\n";
    let capture = make(&context.0, folder.path(), hidden, "", 1.0, 7);
    let asked = ["bayer_mosaic", "noise_reduction", "sharpening", "defocus"];
    let without: Vec<&str> = effect_names().into_iter().filter(|n| !asked.contains(n)).collect();
    let report = run(&context.0, &capture, &without).report;
    assert_eq!(names(&report), ["bayer_mosaic", "noise_reduction"], "{:?}", report.gap);
    let mosaic = report.effects.iter().find(|e| e.name == "bayer_mosaic").unwrap();
    let chosen = |name: &str| mosaic.parameters[name].value.as_str().unwrap().to_owned();
    assert_eq!([chosen("pattern"), chosen("demosaic")], ["GBRG", "malvar_he_cutler"]);
    near(&report, "noise_reduction", "luma_sigma_px", 0.7, 0.05);
    near(&report, "noise_reduction", "chroma_sigma_px", 1.5, 0.05);
}

#[test]
fn a_cause_that_is_no_candidate_is_not_sold_as_another() {
    let Some(context) = device("no_candidate") else { return };
    let folder = tempfile::tempdir().unwrap();
    let capture = make(&context.0, folder.path(), "[black_level]\noffset = 0.05\n", "", 1.0, 4);
    let asked = ["black_level", "exposure_gain", "gamma", "glare"];
    let with = run_exact(&context.0, &capture, &all_but(&asked)).report;
    assert_eq!(names(&with), ["black_level"], "control: with it the cause is named");
    near(&with, "black_level", "offset", 0.05, 0.03);
    let folder = tempfile::tempdir().unwrap();
    let hidden = "[rolling_shutter]\nreadout_time_s = 0.03\nscan_order = \"right_to_left\"\n";
    let capture = make(&context.0, folder.path(), hidden, "", 1.0, 5);
    let mut left = vec!["rolling_shutter"];
    if !long() {
        left.extend(OF_VALUES);
        left_out("a_cause_that_is_no_candidate", "effects on values in the place of a readout");
    }
    let without = run(&context.0, &capture, &left).report;
    assert_ne!(without.verdict, Verdict::Explained, "{:?} {:?}", without.gap, names(&without));
    assert_ne!(without.verdict, Verdict::NoGap);
    assert!(without.effects.iter().all(|e| e.name != "rolling_shutter"));
}

/// Of a global shutter a frame says one number of a flicker: three frames do not know its frequency, depth and phase
/// beside the level about which it goes.
#[test]
fn a_flicker_about_another_level_is_told_of_a_global_shutter() {
    let Some(context) = device("flicker_about_another_level") else { return };
    let folder = tempfile::tempdir().unwrap();
    let hidden = "[exposure_gain]\ngain = 0.92\n[flicker]\ndepth = 0.09\nfrequency_hz = 102.5\n\
        phase_rad = 0.7\n[white_balance]\nr = 0.8\nb = 0.95\n";
    let capture = make_by(&context.0, folder.path(), (CAMERA, 14), [hidden, ""], 1.0, 9);
    let asked = ["exposure_gain", "flicker", "white_balance", "gamma", "vignetting", "saturation"];
    let report = run_exact(&context.0, &capture, &all_but(&asked)).report;
    assert_eq!(names(&report), ["exposure_gain", "flicker", "white_balance"], "{:?}", report.gap);
    near(&report, "exposure_gain", "gain", 0.92, 0.01);
    near(&report, "flicker", "depth", 0.09, 0.05);
    near(&report, "white_balance", "r", 0.8, 0.01);
}

/// More contrast over 20 px is on no list. A sharpening takes it up with the largest radius that it may have.
#[test]
fn an_effect_is_named_beside_one_at_the_end_of_its_range() {
    /// Share of what differs from its surroundings that is added.
    const CONTRAST: f64 = 0.15;
    let Some(context) = device("beside_one_at_the_end") else { return };
    let folder = tempfile::tempdir().unwrap();
    let capture = make(&context.0, folder.path(), "[rolling_shutter]\nreadout_time_s = 0.021\n", "", 1.0, 8);
    for path in std::fs::read_dir(folder.path().join("real")).unwrap().map(|f| f.unwrap().path()) {
        let picture = image::open(&path).unwrap().into_rgb8();
        let mut more = picture.clone();
        for (value, mean) in more.iter_mut().zip(image::imageops::fast_blur(&picture, 20.0).iter()) {
            let stretched = f64::from(*value) + CONTRAST * (f64::from(*value) - f64::from(*mean));
            *value = stretched.round().clamp(0.0, 255.0) as u8;
        }
        more.save(&path).unwrap();
    }
    let asked = ["rolling_shutter", "sharpening"];
    let report = run_exact(&context.0, &capture, &all_but(&asked)).report;
    assert_eq!(report.verdict, Verdict::UnknownEffect, "{:?} {:?}", report.gap, names(&report));
    assert_eq!(names(&report), ["rolling_shutter"], "{:?}", report.gap);
    near(&report, "rolling_shutter", "readout_time_s", 0.021, 0.03);
}

#[test]
#[ignore = "long: a minute"]
fn without_motion_time_is_undetermined() {
    let Some(context) = device("without_motion") else { return };
    let folder = tempfile::tempdir().unwrap();
    let capture = make(&context.0, folder.path(), "[exposure_gain]\ngain = 0.9\n", "", 0.0, 6);
    let report = run(&context.0, &capture, &[]).report;
    assert_eq!(names(&report), ["exposure_gain"]);
    near(&report, "exposure_gain", "gain", 0.9, 0.01);
    for name in ["rolling_shutter", "motion_blur", "time_offset"] {
        let c = report.candidates.iter().find(|c| c.name == name).unwrap();
        assert_eq!(c.state, CandidateState::Undetermined, "{name}");
        assert!(!c.footage.is_empty());
    }
}
