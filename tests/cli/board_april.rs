//! `shutterbug board --pattern aprilgrid`: frames of a grid of tags, rendered by `simulate` through a lens and a
//! readout that are known. The grid is drawn here by Kalibr's rules, not by the program.
#![allow(clippy::unwrap_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use glam::{DQuat, DVec2, DVec3};
use serde_json::Value;
use shutterbug::capture::Capture;

/// The first twelve codes of the family t36h11, as `kalibr_create_target_pdf` of ethz-asl/kalibr lists them: the
/// highest bit is upper left, 1 is white.
const CODES: [u64; 12] = [
    0xd5d628584,
    0xd97f18b49,
    0xdd280910e,
    0xe479e9c98,
    0xebcbca822,
    0xf31dab3ac,
    0x056a5d085,
    0x10652e1d4,
    0x22b1dfead,
    0x265ad0472,
    0x34fe91b86,
    0x3ff962cd5,
];
const TAGS: [usize; 2] = [4, 3];
const SIDE_M: f64 = 0.05;
const SPACING: f64 = 0.25;
const K1: f64 = -0.18;
const READOUT_S: f64 = 0.022;
const FRAMES: usize = 24;

/// Rectangles: left, below, width, height, m; and whether they are dark.
fn rectangles(codes: &[u64]) -> Vec<([f64; 4], bool)> {
    let gap_m = SPACING * SIDE_M;
    let mut all = Vec::new();
    for (id, code) in codes.iter().enumerate() {
        let (column, row) = ((id % TAGS[0]) as f64, (id / TAGS[0]) as f64);
        let (x, y) = (column * (SIDE_M + gap_m), row * (SIDE_M + gap_m));
        let cell_m = SIDE_M / 10.0;
        for (i, j) in (0..10).flat_map(|j| (0..10).map(move |i| (i, j))) {
            // Rows of the code from above.
            let inside = (2..8).contains(&i) && (2..8).contains(&j);
            let white = inside && (code >> (35 - 6 * (7 - j) - (i - 2))) & 1 == 1;
            all.push(([x + i as f64 * cell_m, y + j as f64 * cell_m, cell_m, cell_m], !white));
        }
        all.push(([x + SIDE_M, y, gap_m, SIDE_M], false));
        all.push(([x, y + SIDE_M, SIDE_M, gap_m], false));
        for (a, b) in [(-gap_m, -gap_m), (SIDE_M, -gap_m), (SIDE_M, SIDE_M), (-gap_m, SIDE_M)] {
            all.push(([x + a, y + b, gap_m, gap_m], true));
        }
    }
    all
}

/// Camera to world at a time: in front of the board, whose x goes right and whose y goes up.
fn pose(t: f64) -> (DQuat, DVec3) {
    let angles = [0.40 * (4.1 * t).sin(), 0.40 * (3.3 * t + 1.0).sin(), 0.3 * (5.2 * t + 2.0).sin()];
    // A camera that looks against z has its y downwards.
    let turn = DQuat::from_rotation_x(std::f64::consts::PI)
        * DQuat::from_euler(glam::EulerRot::XYZ, angles[0], angles[1], angles[2]);
    let middle = DVec3::new(0.125, 0.0875, 0.0);
    let at = DVec3::new(0.03 * (6.0 * t).sin(), 0.02 * (5.0 * t + 0.5).cos(), 0.33 + 0.03 * (3.0 * t).sin());
    (turn, middle - turn * at)
}

fn capture(folder: &Path, codes: &[u64]) {
    fs::create_dir_all(folder).unwrap();
    let mut obj = String::from("mtllib scene.mtl\n");
    let mut count = 0;
    let mut quad = |obj: &mut String, [x, y, w, h]: [f64; 4], z: f64, name: &str| {
        for (a, b) in [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)] {
            writeln!(obj, "v {:.9} {:.9} {z:.9}", x + a, y + b).unwrap();
        }
        let v: [usize; 4] = [1, 2, 3, 4].map(|k| count + k);
        writeln!(obj, "usemtl {name}\nf {} {} {} {}", v[0], v[1], v[2], v[3]).unwrap();
        count += 4;
    };
    quad(&mut obj, [-0.06, -0.06, 0.37, 0.295], -0.0005, "paper");
    quad(&mut obj, [-3.0, -3.0, 6.0, 6.0], -0.3, "wall");
    for (place, dark) in rectangles(codes) {
        quad(&mut obj, place, 0.0, if dark { "ink" } else { "paper" });
    }
    fs::write(folder.join("scene.obj"), obj).unwrap();
    let kd = |name: &str, v: f64| format!("newmtl {name}\nKd {v} {v} {v}\n");
    fs::write(folder.join("scene.mtl"), kd("paper", 0.62) + &kd("ink", 0.03) + &kd("wall", 0.2)).unwrap();
    let camera = format!(
        "width = 480\nheight = 360\nfx = 400.0\nfy = 400.0\ncx = 243.0\ncy = 178.0\nframe_period_s = 0.0333333333\n\
         [lens_distortion]\nk1 = {K1}\nk2 = 0.04\n[rolling_shutter]\nreadout_time_s = {READOUT_S}\n\
         scan_order = \"top_to_bottom\"\n"
    );
    fs::write(folder.join("camera.toml"), camera).unwrap();
    let mut path = String::new();
    for i in 0..=1000 {
        let t = 1e-3 * f64::from(i);
        let (q, p) = pose(t);
        writeln!(
            path,
            "{t:.6} {:.9} {:.9} {:.9} {:.12} {:.12} {:.12} {:.12}",
            p.x, p.y, p.z, q.x, q.y, q.z, q.w
        )
        .unwrap();
    }
    fs::write(folder.join("trajectory.tum"), path).unwrap();
    let mut list = String::from("#timestamp [ns],filename\n");
    for i in 0..FRAMES {
        writeln!(list, "{},{i:06}.png", (i as f64 / 30.0 * 1e9).round()).unwrap();
    }
    fs::write(folder.join("frames.csv"), list).unwrap();
}

fn shutterbug(args: &[&str], paths: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_shutterbug")).args(args).args(paths).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Frames as the camera would have delivered them; nothing without a device.
fn rendered(folder: &Path, codes: &[u64]) -> Option<PathBuf> {
    let (scene, frames) = (folder.join("scene"), folder.join("frames"));
    capture(&scene, codes);
    let done = shutterbug(&["simulate", "--out", frames.to_str().unwrap()], &[&scene]);
    if done.status.code() == Some(1) && text(&done.stderr).contains("Vulkan") {
        assert!(std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_none(), "{}", text(&done.stderr));
        eprintln!("SKIPPED april grids: {}", text(&done.stderr));
        return None;
    }
    assert!(done.status.success(), "{}", text(&done.stderr));
    fs::copy(scene.join("frames.csv"), frames.join("frames.csv")).unwrap();
    Some(frames)
}

const GRID: [&str; 8] =
    ["--pattern", "aprilgrid", "--size", "4x3", "--square-m", "0.05", "--tag-spacing", "0.25"];

fn board(frames: &Path, out: &Path, more: &[&str]) -> Output {
    let mut args = vec!["board", frames.to_str().unwrap(), "--out", out.to_str().unwrap()];
    args.extend(more);
    shutterbug(&args, &[])
}

fn fitted(frames: &Path, out: &Path, more: &[&str]) -> Value {
    let done = board(frames, out, more);
    assert!(done.status.success(), "{}", text(&done.stderr));
    serde_json::from_str(&fs::read_to_string(out.join("board.json")).unwrap()).unwrap()
}

fn value(report: &Value, name: &str) -> f64 {
    report["camera"][name]["value"].as_f64().unwrap_or(0.0)
}

/// Where the camera really saw a corner: the pose at the time of its line, by iteration, through the lens.
fn seen_at(frame: usize, corner: [usize; 2]) -> DVec2 {
    let along = |k: usize| (k / 2) as f64 * SIDE_M * (1.0 + SPACING) + (k % 2) as f64 * SIDE_M;
    let world = DVec3::new(along(corner[0]), along(corner[1]), 0.0);
    let mut px = DVec2::new(243.0, 178.0);
    for _ in 0..20 {
        let (turn, at) = pose(frame as f64 / 30.0 + READOUT_S * px.y / 360.0);
        let p = turn.inverse() * (world - at);
        let (x, y) = (p.x / p.z, p.y / p.z);
        let s = x * x + y * y;
        let bent = 1.0 + s * (K1 + s * 0.04);
        px = DVec2::new(243.0 + 400.0 * x * bent, 178.0 + 400.0 * y * bent);
    }
    px
}

#[test]
fn lens_readout_and_poses_come_back_from_tags() {
    let folder = tempfile::tempdir().unwrap();
    let Some(frames) = rendered(folder.path(), &CODES) else { return };
    let out = folder.path().join("capture");
    let report = fitted(&frames, &out, &GRID);
    assert!(report["views"].as_array().unwrap().len() >= FRAMES - 2, "{report}");
    // Every corner is where the camera saw the corner of that number.
    let table = fs::read_to_string(out.join("corners.csv")).unwrap();
    let (mut count, mut squares) = (0, 0.0);
    for line in table.lines().skip(1) {
        let f: Vec<&str> = line.split(',').collect();
        let frame: usize = f[0].trim_end_matches(".png").parse().unwrap();
        let off = DVec2::new(f[3].parse().unwrap(), f[4].parse().unwrap())
            - seen_at(frame, [f[1].parse().unwrap(), f[2].parse().unwrap()]);
        assert!(off.length() < 1.0, "{line}: {off}");
        (count, squares) = (count + 1, squares + off.length_squared());
    }
    let rms_px = (squares / f64::from(count)).sqrt();
    eprintln!("{count} corners, {rms_px:.3} px rms");
    assert!(count > 900 && rms_px < 0.12, "{count} corners, {rms_px} px");
    for (name, truth, within) in
        [("fx", 400.0, 1.2), ("cx", 243.0, 1.0), ("k1", K1, 0.0054), ("readout_rows_s", READOUT_S, 0.00044)]
    {
        let found = value(&report, name);
        eprintln!("{name} {found}");
        assert!((found - truth).abs() < within, "{name} {found} for {truth}");
    }
    let rms = |r: &Value, name: &str| r["rms_px"][name].as_f64().unwrap();
    assert!(rms(&report, "pinhole_alone") > 4.0 * rms(&report, "with_lens_and_readout"), "control: {report}");
    // The poses are the camera's, in Kalibr's axes.
    let capture = Capture::read(&out, None).unwrap();
    let at = capture.frames.iter().position(|f| f.filename == "000012.png").unwrap();
    let found = capture.world_from_camera(at, capture.shutter(at).start_s);
    let (turn, place) = pose(12.0 / 30.0);
    let (off_rad, off_m) = (found.rotation.angle_between(turn), (found.translation_m - place).length());
    eprintln!("pose off by {off_rad} rad, {off_m} m");
    assert!(off_rad < 4e-3 && off_m < 2e-3, "{off_rad} rad, {off_m} m");
    // The same by Kalibr's file.
    let yaml = folder.path().join("target.yaml");
    fs::write(&yaml, "target_type: 'aprilgrid'\ntagCols: 4\ntagRows: 3\ntagSize: 0.05\ntagSpacing: 0.25\n")
        .unwrap();
    let by_file = fitted(&frames, &folder.path().join("by_file"), &["--target", yaml.to_str().unwrap()]);
    assert_eq!(by_file["camera"], report["camera"]);
    controls(&frames, folder.path());
}

/// What is said of the board and is not so is named.
fn controls(frames: &Path, folder: &Path) {
    let out = folder.join("refused");
    let said = |more: &[&str]| {
        let done = board(frames, &out, more);
        assert!(done.status.code().is_some_and(|c| c > 0), "{}", text(&done.stdout));
        text(&done.stderr)
    };
    let with = |from: &str, to: &str| -> Vec<String> {
        GRID.iter().map(|a| if *a == from { to.to_owned() } else { (*a).to_owned() }).collect()
    };
    let refs = |all: &[String]| -> String { said(&all.iter().map(String::as_str).collect::<Vec<_>>()) };
    let gap = refs(&with("0.25", "0.3"));
    assert!(gap.contains("--tag-spacing") && gap.contains("found tags that lie 0.25"), "{gap}");
    let turned = refs(&with("4x3", "3x4"));
    assert!(turned.contains("do not lie as those of a board of 3x4"), "{turned}");
}

#[test]
fn tags_that_the_board_has_not_are_named() {
    let folder = tempfile::tempdir().unwrap();
    // Tags 4 to 11 stand where 0 to 7 should.
    let Some(frames) = rendered(folder.path(), &CODES[4..]) else { return };
    let done = board(
        &frames,
        &folder.path().join("capture"),
        &["--pattern", "aprilgrid", "--size", "2x2", "--square-m", "0.05", "--tag-spacing", "0.25"],
    );
    assert_eq!(done.status.code(), Some(1), "{}", text(&done.stdout));
    assert!(text(&done.stderr).contains("the last one of the board is 3"), "{}", text(&done.stderr));
}
