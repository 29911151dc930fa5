//! `diagnose --real` of footage beside a gyro, without a scene: frames of a far scene by `simulate`, with a readout,
//! an exposure and clocks that are known.
#![allow(clippy::unwrap_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use glam::{DQuat, DVec3};
use serde_json::Value;

use crate::dice_support::Dice;

const FRAMES: usize = 24;
const READOUT_S: f64 = 0.018;
const EXPOSURE_S: f64 = 0.012;
const OFFSET_S: f64 = 0.004;

/// Camera to world at a time: it stands still and looks around.
fn turn(t: f64) -> DQuat {
    // Looks along +x with z up.
    let level = DQuat::from_mat3(&glam::DMat3::from_cols(-DVec3::Y, -DVec3::Z, DVec3::X));
    let angles = [
        0.16 * (7.3 * t).sin() + 0.05 * (17.0 * t).sin(),
        0.22 * (5.1 * t + 1.0).sin() + 0.04 * (19.0 * t + 0.3).sin(),
        0.10 * (6.2 * t + 2.0).sin(),
    ];
    level * DQuat::from_euler(glam::EulerRot::XYZ, angles[0], angles[1], angles[2])
}

/// Rates about the camera's axes, rad/s.
fn rate(t: f64) -> DVec3 {
    let step = 1e-5;
    (turn(t - step).inverse() * turn(t + step)).to_scaled_axis() / (2.0 * step)
}

/// A wall of patches, far away, with finer ones on top.
fn scene(folder: &Path) {
    let mut dice = Dice(5);
    let (mut obj, mut mtl) = (String::from("mtllib scene.mtl\n"), String::new());
    for m in 0..32 {
        let [r, g, b] = [0, 1, 2].map(|_| 0.03 + 0.75 * dice.roll().powi(2));
        writeln!(mtl, "newmtl m{m}\nKd {r} {g} {b}").unwrap();
    }
    let mut vertices = 0;
    let mut quad = |obj: &mut String, dice: &mut Dice, x: f64, [y, z, w, h]: [f64; 4]| {
        for (a, b) in [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)] {
            writeln!(obj, "v {x} {} {}", y + a, z + b).unwrap();
        }
        let v: [usize; 4] = [1, 2, 3, 4].map(|k| vertices + k);
        let m = (dice.roll() * 32.0) as usize;
        writeln!(obj, "usemtl m{m}\nf {} {} {} {}", v[0], v[1], v[2], v[3]).unwrap();
        vertices += 4;
    };
    for (i, j) in (0..40).flat_map(|i| (0..32).map(move |j| (i, j))) {
        let at = [-200.0 + 10.0 * f64::from(i), -160.0 + 10.0 * f64::from(j), 10.0, 10.0];
        quad(&mut obj, &mut dice, 100.0, at);
        let [y, z] = [0, 1].map(|k| at[k] + 7.0 * dice.roll());
        let [w, h] = [0, 1].map(|_| 2.0 + 4.0 * dice.roll());
        quad(&mut obj, &mut dice, 99.9, [y, z, w, h]);
    }
    fs::write(folder.join("scene.obj"), obj).unwrap();
    fs::write(folder.join("scene.mtl"), mtl).unwrap();
}

const CAMERA: &str = "width = 320\nheight = 240\nfx = 280.0\nfy = 280.0\ncx = 160.0\ncy = 120.0\n\
frame_period_s = 0.0333333333\n";

fn shutterbug(args: &[&str], paths: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_shutterbug")).args(args).args(paths).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Frames with `frames.csv`, a pinhole and `imu.csv`; nothing without a device.
fn footage(folder: &Path, name: &str, effects: &str) -> Option<PathBuf> {
    let (capture, real) = (folder.join(format!("{name}_capture")), folder.join(name));
    fs::create_dir_all(&capture).unwrap();
    scene(&capture);
    fs::write(capture.join("camera.toml"), format!("{CAMERA}{effects}")).unwrap();
    let (mut path, mut list) = (String::new(), String::from("#timestamp [ns],filename\n"));
    for k in -300..=1300 {
        let t = 1e-3 * f64::from(k);
        let q = turn(t);
        writeln!(path, "{:.6} 0 0 0 {:.12} {:.12} {:.12} {:.12}", 10.0 + t, q.x, q.y, q.z, q.w).unwrap();
    }
    for i in 0..FRAMES {
        writeln!(list, "{},{i:06}.png", 10_000_000_000 + (i as f64 / 30.0 * 1e9).round() as i64).unwrap();
    }
    fs::write(capture.join("trajectory.tum"), path).unwrap();
    fs::write(capture.join("frames.csv"), &list).unwrap();
    let done = shutterbug(&["simulate", "--seed", "3", "--out", real.to_str().unwrap()], &[&capture]);
    if done.status.code() == Some(1) && text(&done.stderr).contains("Vulkan") {
        assert!(std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_none(), "{}", text(&done.stderr));
        eprintln!("SKIPPED footage beside a gyro: {}", text(&done.stderr));
        return None;
    }
    assert!(done.status.success(), "{}", text(&done.stderr));
    fs::write(real.join("frames.csv"), &list).unwrap();
    fs::write(real.join("camera.toml"), CAMERA).unwrap();
    gyro(&real, 1.0, 0.0, 1.0);
    Some(real)
}

/// Rates of a gyro with that scale whose clock runs so many times as fast.
fn gyro_of(real: &Path, scale: f64, clock: f64) {
    gyro_with(real, &|w| scale * w, clock);
}

/// Rates made of the camera's, of a clock that runs so many times as fast.
fn gyro_with(real: &Path, rates: &dyn Fn(DVec3) -> DVec3, clock: f64) {
    let mut table = String::from("#timestamp [ns],wx,wy,wz\n");
    for k in -120..=520 {
        let t = 2.5e-3 * f64::from(k);
        let w = rates(rate(t));
        writeln!(table, "{},{},{},{}", 10_000_000_000 + (clock * t * 1e9) as i64, w.x, w.y, w.z).unwrap();
    }
    fs::write(real.join("imu.csv"), table).unwrap();
}

/// Rates at 400 Hz, scaled and later by so much, with the noise of a cheap sensor and so many times its drift.
fn gyro(real: &Path, scale: f64, late_s: f64, drift: f64) {
    let mut dice = Dice(9);
    let mut table = String::from("# axes of the camera\n#timestamp [ns],wx,wy,wz,ax,ay,az\n");
    for k in -120..=520 {
        let t = 2.5e-3 * f64::from(k);
        let noise = DVec3::from([0, 1, 2].map(|_| 0.004 * (dice.roll() - 0.5)));
        let w = scale * rate(t - late_s) + drift * DVec3::new(0.01, -0.006, 0.004) + noise;
        writeln!(table, "{},{},{},{},0,0,9.8", 10_000_000_000 + (t * 1e9) as i64, w.x, w.y, w.z).unwrap();
    }
    fs::write(real.join("imu.csv"), table).unwrap();
}

fn report(real: &Path, out: &Path) -> Value {
    let done = shutterbug(&["diagnose", "--overwrite", "--real", real.to_str().unwrap(), "--out"], &[out]);
    assert!(done.status.success(), "{}", text(&done.stderr));
    assert!(out.join("report.html").is_file() && out.join("camera.toml").is_file());
    let report: Value = serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    eprintln!("{}", report["sentence"]);
    report
}

/// Value and half width; nothing where it is not found.
fn found(report: &Value, effect: &str, name: &str) -> Option<[f64; 2]> {
    let all = report["effects"].as_array().unwrap();
    let parameter = &all.iter().find(|e| e["name"] == effect)?["parameters"][name];
    let value = parameter["value"].as_f64()?;
    let half = value - parameter["ci95"][0].as_f64()?;
    eprintln!("{name} {value:.6} +- {half:.6}");
    Some([value, half])
}

fn state(report: &Value, name: &str) -> String {
    let all = report["candidates"].as_array().unwrap();
    let one = all.iter().find(|c| c["name"] == name).unwrap_or_else(|| panic!("{name} is no candidate"));
    format!("{}: {} / {}", one["state"].as_str().unwrap(), one["why"], one["footage"])
}

fn holds(found: Option<[f64; 2]>, truth: f64, most_half: f64) {
    let [value, half] = found.expect("found");
    assert!(half <= most_half, "{half} is wider than {most_half}");
    // Three standard deviations.
    assert!((value - truth).abs() <= 1.53 * half.max(0.005 * truth.abs()), "{value} +- {half} for {truth}");
}

/// A camera of which a gyro tells all three.
fn moving() -> String {
    format!(
        "[rolling_shutter]\nreadout_time_s = {READOUT_S}\n[motion_blur]\nexposure_time_s = {EXPOSURE_S}\n\
         [read_noise]\nsigma = 0.004\n[time_offset]\noffset_s = {OFFSET_S}\n"
    )
}

#[test]
fn a_gyro_tells_readout_exposure_and_clocks() {
    let folder = tempfile::tempdir().unwrap();
    let Some(real) = footage(folder.path(), "rolling", &moving()) else { return };
    let out = folder.path().join("out");
    let all = report(&real, &out);
    assert_eq!(all["verdict"], "explained", "{all}");
    holds(found(&all, "rolling_shutter", "readout_time_s"), READOUT_S, 0.0009);
    holds(found(&all, "motion_blur", "exposure_time_s"), EXPOSURE_S, 0.0018);
    holds(found(&all, "time_offset", "offset_s"), OFFSET_S, 0.0015);
    let order = &all["effects"].as_array().unwrap().iter().find(|e| e["name"] == "rolling_shutter").unwrap()
        ["parameters"]["scan_order"]["value"];
    assert_eq!(order, "top_to_bottom");
    for name in ["lens_distortion", "shot_noise", "gamma", "vignetting", "pose_offset"] {
        assert!(
            state(&all, name).starts_with("undetermined") && state(&all, name).contains("--sim"),
            "{name}"
        );
    }
    let gap = |key: &str| all["gap"][key].as_f64().unwrap();
    assert!(gap("after") < 0.3 && gap("before") > 4.0 * gap("after"), "{}", all["gap"]);
    // What cannot be told is said before what was found, and what to supply.
    let asked = &all["asked"];
    assert!(asked["cannot_tell"].as_array().unwrap().contains(&Value::from("lens_distortion")), "{asked}");
    assert!(asked["can_tell"].as_array().unwrap().contains(&Value::from("rolling_shutter")), "{asked}");
    assert!(asked["to_settle"][0]["film"].as_str().unwrap().contains("--sim"), "{asked}");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let at = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}"));
    assert!(at("They cannot tell of") < at("<h1>"));
    // What was found goes into the camera.
    let camera = fs::read_to_string(out.join("camera.toml")).unwrap();
    assert!(camera.contains("[rolling_shutter]") && camera.contains("[motion_blur]"), "{camera}");
    assert!(!all["warnings"].to_string().contains("clock runs"), "control: {}", all["warnings"]);
    refused(&real, &out);
}

/// Controls: the rates of another moment, and of the opposite sign, explain nothing and it is said.
fn other_rates_explain_nothing(real: &Path, out: &Path) {
    gyro(real, 1.0, 0.77, 1.0);
    let other = report(real, out);
    assert_eq!(
        (&other["verdict"], other["effects"].as_array().unwrap().len()),
        (&Value::from("unknown_effect"), 0)
    );
    assert!(other["sentence"].as_str().unwrap().contains("does not explain"), "{}", other["sentence"]);
    gyro_of(real, -1.0, 1.0);
    let opposite = report(real, out);
    assert_eq!(opposite["verdict"], "unknown_effect");
    assert!(opposite["sentence"].as_str().unwrap().contains("the opposite sign"), "{}", opposite["sentence"]);
    let faults: [(&dyn Fn(DVec3) -> DVec3, &str); 3] = [
        (&|w| DVec3::new(-w.y, w.x, w.z), "(wy, -wx, wz)"),
        (&|w| w.map(f64::to_degrees), "in degrees/s"),
        (&|_| DVec3::ZERO, "hardly turns"),
    ];
    for (rates, says) in faults {
        gyro_with(real, rates, 1.0);
        let all = report(real, out);
        assert!(all["effects"].as_array().unwrap().is_empty());
        assert!(all["sentence"].as_str().unwrap().contains(says), "{says}: {}", all["sentence"]);
    }
}

/// A camera whose centre is elsewhere: times of lines close little of what it leaves, and nothing is named.
fn another_centre_is_no_cause_of_the_camera(real: &Path, out: &Path) {
    gyro(real, 1.0, 0.0, 1.0);
    let list = fs::read_to_string(real.join("frames.csv")).unwrap();
    let few: Vec<&str> = list.lines().take(11).collect();
    fs::write(real.join("frames.csv"), few.join("\n")).unwrap();
    fs::write(real.join("camera.toml"), CAMERA.replace("cy = 120.0", "cy = 170.0")).unwrap();
    let all = report(real, out);
    assert_eq!(
        (&all["verdict"], all["effects"].as_array().unwrap().len()),
        (&Value::from("unknown_effect"), 0),
        "{}",
        all["sentence"]
    );
    fs::write(real.join("frames.csv"), list).unwrap();
    fs::write(real.join("camera.toml"), CAMERA).unwrap();
}

#[test]
#[ignore = "long: a minute"]
fn clocks_that_are_late_or_fast_are_told_and_wrong_scales_and_centres_explain_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let Some(real) = footage(folder.path(), "rolling", &moving()) else { return };
    let out = folder.path().join("out");
    // A clock that is later by 0.1 s is an offset, a gyro that drifts by 0.6 rad/s drifts, and nothing else changes.
    gyro(&real, 1.0, 0.1, 50.0);
    let late = report(&real, &out);
    holds(found(&late, "rolling_shutter", "readout_time_s"), READOUT_S, 0.0009);
    holds(found(&late, "motion_blur", "exposure_time_s"), EXPOSURE_S, 0.0018);
    holds(found(&late, "time_offset", "offset_s"), OFFSET_S + 0.1, 0.0015);
    // A clock that runs 2 % fast changes nothing that is measured by the frames', and is said.
    gyro_of(&real, 1.0, 1.02);
    let fast = report(&real, &out);
    holds(found(&fast, "rolling_shutter", "readout_time_s"), READOUT_S, 0.0009);
    holds(found(&fast, "motion_blur", "exposure_time_s"), EXPOSURE_S, 0.0018);
    assert!(fast["warnings"].to_string().contains("clock runs 2.0"), "{}", fast["warnings"]);
    // Controls: rates that are too large, and another centre, explain nothing and it is said.
    gyro(&real, 1.2, 0.0, 1.0);
    let scaled = report(&real, &out);
    assert_eq!(
        (&scaled["verdict"], scaled["effects"].as_array().unwrap().len()),
        (&Value::from("unknown_effect"), 0)
    );
    assert!(
        scaled["sentence"].as_str().unwrap().contains("times as far as the gyro"),
        "{}",
        scaled["sentence"]
    );
    assert!(state(&scaled, "rolling_shutter").starts_with("undetermined"));
    another_centre_is_no_cause_of_the_camera(&real, &out);
    other_rates_explain_nothing(&real, &out);
}

#[test]
#[ignore = "long: a minute"]
fn a_sensor_that_reads_from_below_and_one_that_reads_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let effects = "[rolling_shutter]\nreadout_time_s = 0.012\nscan_order = \"bottom_to_top\"\n[motion_blur]\n\
    exposure_time_s = 0.02\n";
    let Some(real) = footage(folder.path(), "up", effects) else { return };
    let all = report(&real, &folder.path().join("out"));
    holds(found(&all, "rolling_shutter", "readout_time_s"), 0.012, 0.0009);
    holds(found(&all, "motion_blur", "exposure_time_s"), 0.02, 0.003);
    assert!(fs::read_to_string(folder.path().join("out/camera.toml")).unwrap().contains("bottom_to_top"));
    let Some(real) = footage(folder.path(), "global", "[read_noise]\nsigma = 0.004\n") else { return };
    let all = report(&real, &folder.path().join("out_global"));
    assert!(found(&all, "rolling_shutter", "readout_time_s").is_none(), "{all}");
    assert!(state(&all, "rolling_shutter").starts_with("rejected"), "{}", state(&all, "rolling_shutter"));
    // No exposure, so none is told, and not the clocks that depend on it.
    assert!(found(&all, "motion_blur", "exposure_time_s").is_none(), "{all}");
    assert!(state(&all, "motion_blur").contains("at most"), "{}", state(&all, "motion_blur"));
}

/// What is missing or wrong is one clear line.
fn refused(real: &Path, out: &Path) {
    let said = || {
        let done =
            shutterbug(&["diagnose", "--overwrite", "--real", real.to_str().unwrap(), "--out"], &[out]);
        let said = text(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{said}");
        assert_eq!(said.lines().filter(|l| l.contains("error: ")).count(), 1, "{said}");
        said
    };
    let imu = fs::read_to_string(real.join("imu.csv")).unwrap();
    fs::write(real.join("imu.csv"), "#timestamp [ns],wx,wy,wz\n10000000000,0,x,0\n").unwrap();
    assert!(said().contains("imu.csv:2"));
    fs::write(real.join("imu.csv"), "1,0,0,0\n2,0,0,0\n").unwrap();
    assert!(said().contains("cover 0 pairs of frames"));
    fs::remove_file(real.join("imu.csv")).unwrap();
    let missing = said();
    assert!(missing.contains("imu.csv") && missing.contains("--sim"), "{missing}");
    fs::write(real.join("imu.csv"), imu).unwrap();
    let camera = fs::read_to_string(real.join("camera.toml")).unwrap();
    fs::write(real.join("camera.toml"), camera.replace("width = 320", "width = 400")).unwrap();
    assert!(said().contains("400x240"));
    // Through a lens that folds inside the picture nothing can be placed.
    fs::write(real.join("camera.toml"), format!("{camera}[lens_distortion]\nk1 = -0.9\n")).unwrap();
    assert!(said().contains("turns back"));
    fs::remove_file(real.join("camera.toml")).unwrap();
    assert!(said().contains("camera.toml"));
    fs::write(real.join("camera.toml"), camera).unwrap();
    fs::remove_file(real.join("frames.csv")).unwrap();
    assert!(said().contains("frames.csv"));
}
