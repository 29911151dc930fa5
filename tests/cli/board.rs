//! `shutterbug board`: cameras that are known exactly, and photographs whose camera OpenCV has calibrated.
#![allow(clippy::unwrap_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::board_support::Oracle;
use crate::long_support::some_of;
use glam::{DQuat, DVec3};
use serde_json::Value;
use shutterbug::capture::Capture;
use shutterbug::plane::{Plane, write_png_atomic};

fn board(frames: &Path, out: &Path, more: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_shutterbug"))
        .arg("board")
        .arg(frames)
        .arg("--out")
        .arg(out)
        .args(more)
        .output()
        .unwrap()
}

/// board.json of a run that must succeed.
fn fitted(frames: &Path, out: &Path, more: &[&str]) -> Value {
    let done = board(frames, out, more);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    serde_json::from_str(&fs::read_to_string(out.join("board.json")).unwrap()).unwrap()
}

fn value(report: &Value, name: &str) -> f64 {
    report["camera"][name]["value"].as_f64().unwrap_or(0.0)
}

/// Ten photographs by a camera at rest.
fn stills(oracle: &Oracle, folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    for i in 0..10 {
        let a = f64::from(i);
        let angles = [0.5 * (1.7 * a).sin(), 0.5 * (2.3 * a + 1.0).sin(), 0.4 * (a * 1.1).sin()];
        let shift = [0.05 * (1.3 * a).cos(), 0.03 * (2.1 * a).sin()];
        let pose = oracle.looking(angles, shift, 0.2 + 0.01 * a);
        write_png_atomic(&folder.join(format!("{i:02}.png")), &oracle.photograph(|_| pose, 0.0)).unwrap();
    }
}

#[test]
fn the_camera_comes_back_from_photographs() {
    let oracle = Oracle::new();
    let folder = tempfile::tempdir().unwrap();
    let (frames, out) = (folder.path().join("photos"), folder.path().join("capture"));
    stills(&oracle, &frames);
    let report = fitted(&frames, &out, &["--size", "7x4", "--square-m", "0.03"]);
    assert!(report["views"].as_array().unwrap().len() >= 9, "{report}");
    // Three standard deviations, which the intervals state; and those are narrow.
    for (name, truth, narrow) in
        [("fx", 250.0, 2.0), ("fy", 250.0, 2.0), ("cx", 163.0, 1.5), ("cy", 118.5, 1.5), ("k1", -0.25, 0.02)]
    {
        let (found, low) = (value(&report, name), report["camera"][name]["ci95"][0].as_f64().unwrap());
        let half = found - low;
        assert!(half < narrow && (found - truth).abs() < 1.6 * half, "{name} {found} +- {half} for {truth}");
    }
    let rms = |name: &str| report["rms_px"][name].as_f64().unwrap();
    assert!(rms("with_lens_and_readout") < 0.15, "{}", rms("with_lens_and_readout"));
    assert!(rms("pinhole_alone") > 5.0 * rms("with_lens_and_readout"), "control: a pinhole does not do");
    // The capture can be read, is a pinhole, and the pictures are in it as they were.
    let capture = Capture::read(&out, None).unwrap();
    assert!(capture.camera.static_camera && capture.camera.background_ignored);
    assert!(capture.camera.settings.iter().next().is_none(), "no effect is described");
    let name = &capture.frames[0].filename;
    assert_eq!(fs::read(out.join("real").join(name)).unwrap(), fs::read(frames.join(name)).unwrap());
    let reach = report["print"]["reach_squares"].as_array().unwrap();
    assert!(reach.iter().all(|r| r.as_f64().unwrap() > 0.9), "{reach:?}");
    // What was found, read as a table, gives the same camera without looking.
    let again = folder.path().join("again");
    let table = out.join("corners.csv");
    let second = fitted(&frames, &again, &["--corners", table.to_str().unwrap(), "--square-m", "0.03"]);
    let k1 = [&report, &second].map(|r| value(r, "k1"));
    // The table has four decimals of a px.
    assert!((k1[0] - k1[1]).abs() < 1e-5, "{k1:?}");
    assert!((value(&second, "cx") - value(&report, "cx")).abs() < 1e-3);
    // Smaller frames have the same camera, in their own px.
    let small = folder.path().join("small");
    fitted(&frames, &small, &["--size", "7x4", "--square-m", "0.03", "--shrink", "2"]);
    let small = Capture::read(&small, None).unwrap();
    let (k, whole) = (small.camera.intrinsics, capture.camera.intrinsics);
    assert_eq!((k.width, k.height), (160, 120));
    assert!((2.0 * k.fx - whole.fx).abs() < 1e-9 && (2.0 * k.cx - whole.cx).abs() < 1e-9);
    let frame =
        shutterbug::plane::read_rgb8(&small.root.join("real").join(&small.frames[0].filename)).unwrap();
    assert_eq!((frame.width, frame.height), (160, 120));
}

/// Frames of a camera in motion, with frames.csv.
fn recording(oracle: &Oracle, folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let mut list = String::from("#timestamp [ns],filename\n");
    let pose = |t: f64| -> (DQuat, DVec3) {
        let angles = [0.35 * (4.1 * t).sin(), 0.35 * (3.3 * t + 1.0).sin(), 0.3 * (5.2 * t + 2.0).sin()];
        oracle.looking(
            angles,
            [0.03 * (6.0 * t).sin(), 0.02 * (5.0 * t + 0.5).cos()],
            0.24 + 0.03 * (3.0 * t).sin(),
        )
    };
    for i in 0..30 {
        let start_s = f64::from(i) / 30.0;
        let name = format!("{i:06}.png");
        write_png_atomic(&folder.join(&name), &oracle.photograph(pose, start_s)).unwrap();
        writeln!(list, "{},{name}", (start_s * 1e9).round()).unwrap();
    }
    fs::write(folder.join("frames.csv"), list).unwrap();
}

#[test]
fn a_board_in_motion_gives_readout_and_lens() {
    let folder = tempfile::tempdir().unwrap();
    let cameras = [(0.024, "down"), (-0.018, "up"), (0.0, "global")];
    for (readout_s, name) in some_of("a_board_in_motion", 3, cameras) {
        let oracle = Oracle { readout_s, ..Oracle::new() };
        let (frames, out) = (folder.path().join(name), folder.path().join(format!("{name}_capture")));
        recording(&oracle, &frames);
        let report = fitted(&frames, &out, &["--size", "7x4", "--square-m", "0.03"]);
        let found = value(&report, "readout_rows_s");
        // A global shutter has none: 0.
        assert!((found - readout_s).abs() < 0.03 * readout_s.abs() + 2e-4, "{name}: {found} for {readout_s}");
        assert!((value(&report, "k1") + 0.25).abs() < 0.01, "{name}: {}", value(&report, "k1"));
        let capture = Capture::read(&out, None).unwrap();
        assert!(!capture.camera.static_camera && capture.frames.len() >= 26, "{}", capture.frames.len());
        if readout_s == 0.0 {
            continue;
        }
        // The first line of a frame is read at its timestamp: its pose there is the oracle's.
        let frame = capture.frames.iter().position(|f| f.filename == "000014.png").unwrap();
        let pose = capture.world_from_camera(frame, capture.shutter(frame).start_s);
        let t = 14.0 / 30.0;
        let angles =
            [0.35 * f64::sin(4.1 * t), 0.35 * f64::sin(3.3 * t + 1.0), 0.3 * f64::sin(5.2 * t + 2.0)];
        let turn = oracle.looking(angles, [0.0; 2], 0.24).0;
        let off = pose.rotation.angle_between(turn);
        assert!(off < 4e-3, "{name}: {off} rad");
        // Control: taken for stills, the same frames leave far more.
        let stills = folder.path().join(format!("{name}_stills"));
        fs::create_dir(&stills).unwrap();
        for i in 0..30 {
            let name = format!("{i:06}.png");
            fs::copy(frames.join(&name), stills.join(&name)).unwrap();
        }
        let still = fitted(&stills, &folder.path().join(format!("{name}_as_stills")), &["--size", "7x4"]);
        let rms = |r: &Value| r["rms_px"]["with_lens_and_readout"].as_f64().unwrap();
        assert!(rms(&still) > 1.5 * rms(&report), "{name}: {} {}", rms(&still), rms(&report));
    }
}

fn real(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/real").join(name);
    if !folder.is_dir() {
        eprintln!("SKIPPED: {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

/// OpenCV 5.0.0, calibrateCamera with five coefficients on its own corners (findChessboardCorners, cornerSubPix 11x11):
/// k1 = -0.2809, -0.2854 on the corners.csv of the set; -0.2900 without k3.
#[test]
fn board_a_has_the_lens_that_opencv_finds() {
    let Some(frames) = real("board_a") else { return };
    let folder = tempfile::tempdir().unwrap();
    let report = fitted(&frames, &folder.path().join("capture"), &["--size", "9x6"]);
    assert_eq!(report["views"].as_array().unwrap().len(), 13);
    let without_k3 = -0.2900;
    assert!((value(&report, "k1") / without_k3 - 1.0).abs() < 0.02, "{}", value(&report, "k1"));
    assert!((value(&report, "fx") / 533.0 - 1.0).abs() < 0.003, "{}", value(&report, "fx"));
    assert!(report["rms_px"]["with_lens_and_readout"].as_f64().unwrap() < 0.25);
    // The outer columns of this sheet are cut to half a square.
    let reach: Vec<f64> =
        report["print"]["reach_squares"].as_array().unwrap().iter().map(|r| r.as_f64().unwrap()).collect();
    assert!(
        (0.4..0.65).contains(&reach[0]) && (0.4..0.65).contains(&reach[1]) && reach[2] > 0.85,
        "{reach:?}"
    );
    // The corners that come with the set count from the first pixel's centre, as OpenCV does.
    let mut table = String::new();
    for line in fs::read_to_string(frames.join("corners.csv")).unwrap().lines().skip(1) {
        let f: Vec<&str> = line.split(',').collect();
        writeln!(table, "{},{},{},{},{}", f[0], f[2], f[3], f[4], f[5]).unwrap();
    }
    let path = folder.path().join("table.csv");
    fs::write(&path, table).unwrap();
    let given = fitted(&frames, &folder.path().join("given"), &["--corners", path.to_str().unwrap()]);
    assert!((value(&given, "k1") / without_k3 - 1.0).abs() < 0.02, "{}", value(&given, "k1"));
    // Half a pixel is added: both tables name the same places then.
    let places = |capture: &str| {
        let text = fs::read_to_string(folder.path().join(capture).join("corners.csv")).unwrap();
        let sum = |i: usize| -> f64 {
            text.lines().skip(1).map(|l| l.split(',').nth(i).unwrap().parse::<f64>().unwrap()).sum()
        };
        [sum(3) / 702.0, sum(4) / 702.0]
    };
    let (found, given) = (places("capture"), places("given"));
    assert!((found[0] - given[0]).abs() < 0.05 && (found[1] - given[1]).abs() < 0.05, "{found:?} {given:?}");
}

/// OpenCV 5.0.0 on 17 of 18: k1 = -0.2315, k2 = 0.0606, k3 = -0.0073.
#[test]
fn board_gopro_needs_three_coefficients() {
    let Some(frames) = real("board_gopro") else { return };
    let folder = tempfile::tempdir().unwrap();
    let report = fitted(&frames, &folder.path().join("capture"), &["--size", "8x6"]);
    assert!((value(&report, "k1") / -0.2315 - 1.0).abs() < 0.02, "{}", value(&report, "k1"));
    assert!((value(&report, "k3") / -0.0073 - 1.0).abs() < 0.15, "{}", value(&report, "k3"));
    let left_out = report["left_out"].as_array().unwrap();
    assert_eq!(left_out.len(), 1, "{left_out:?}");
    assert_eq!(left_out[0]["file"], "11.jpg", "a part of the board, which may be any");
    // In the corners that lens turns back; the frames are without, so that it can be simulated.
    assert!(report["cut_px"][0].as_u64().unwrap() > 0, "{}", report["cut_px"]);
    let capture = Capture::read(&folder.path().join("capture"), None).unwrap();
    let k = capture.camera.intrinsics;
    let [a, b, c] = ["k1", "k2", "k3"].map(|n| value(&report, n));
    let lens = shutterbug::camera::Distortion::BrownConrady { k: [a, b, c], p: [0.0; 2] };
    assert!(shutterbug::camera::Lens::new(k, lens).is_ok(), "{k:?}");
}

#[test]
fn what_cannot_be_used_is_said_in_a_sentence() {
    let oracle = Oracle::new();
    let folder = tempfile::tempdir().unwrap();
    let frames = folder.path().join("photos");
    stills(&oracle, &frames);
    let out = folder.path().join("capture");
    let said = |frames: &Path, more: &[&str]| {
        let done = board(frames, &out, more);
        assert_eq!(done.status.code(), Some(1), "{}", String::from_utf8_lossy(&done.stdout));
        assert!(!out.exists(), "nothing is left of a run that failed");
        let text = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(text.lines().filter(|l| l.contains("error")).count(), 1, "{text}");
        text
    };
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    assert!(said(&empty, &["--size", "7x4"]).contains("no picture"));
    let wrong = said(&frames, &["--size", "8x6"]);
    assert!(wrong.contains("00.png") && wrong.contains("7x4"), "{wrong}");
    let bad = folder.path().join("bad.csv");
    fs::write(&bad, "file,col,row,u_px,v_px\n00.png,0,0,1\n").unwrap();
    let text = said(&frames, &["--corners", bad.to_str().unwrap()]);
    assert!(text.contains("bad.csv:2"), "{text}");
    fs::write(&bad, "nowhere.png,0,0,1,2\n").unwrap();
    assert!(said(&frames, &["--corners", bad.to_str().unwrap()]).contains("nowhere.png"));
    write_png_atomic(&frames.join("99.png"), &Plane::from_fn(64, 64, |_, _| [9u8; 3])).unwrap();
    assert!(said(&frames, &["--size", "7x4"]).contains("found 64x64 px; expected 320x240 px"));
    fs::write(frames.join("99.png"), "no picture").unwrap();
    assert!(said(&frames, &["--size", "7x4"]).contains("99.png"));
    // Control: without it all is well.
    fs::remove_file(frames.join("99.png")).unwrap();
    assert!(board(&frames, &out, &["--size", "7x4"]).status.success());
}
