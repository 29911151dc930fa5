//! The command line on the capture that ships with the project: what it writes, what it refuses, and that nothing
//! already written is lost.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::device_is_there;
use shutterbug::plane::{read_exr_plane, read_rgb8};

const DEMO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../demo/capture");

fn shutterbug() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
    command.env("SHUTTERBUG_VALIDATION", "1").stdin(Stdio::null());
    command
}

fn simulate(out: &Path, more: &[&str]) -> Output {
    // One sample a pixel: these tests are about files, not about edges.
    let samples: &[&str] = if more.contains(&"--samples") { &[] } else { &["--samples", "1"] };
    shutterbug().args(["simulate", DEMO, "--out"]).arg(out).args(samples).args(more).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn both_camera() -> PathBuf {
    Path::new(DEMO).join("../cameras/noise.toml")
}

fn frames(dir: &Path) -> Vec<PathBuf> {
    let is_png = |p: &PathBuf| p.extension().is_some_and(|e| e == "png");
    let mut all: Vec<_> = fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()).filter(is_png).collect();
    all.sort();
    all
}

fn bytes_of_all(dir: &Path) -> Vec<Vec<u8>> {
    frames(dir).iter().map(|p| fs::read(p).unwrap()).collect()
}

fn assert_refused(output: &Output, code: i32, words: &[&str]) {
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{message}");
    for word in words {
        assert!(message.contains(word), "`{word}` is not in: {message}");
    }
    if code == 1 {
        let errors = message.lines().filter(|line| line.starts_with("shutterbug: error: ")).count();
        assert_eq!(errors, 1, "one line is enough: {message}");
    }
}

#[test]
fn writes_every_frame_its_instants_times_and_planes() {
    if !device_is_there("writes_every_frame_its_instants_times_and_planes") {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let camera = both_camera();
    let output = simulate(
        dir.path(),
        &["--camera", camera.to_str().unwrap(), "--timings", "--planes", "color,motion,depth"],
    );
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(frames(dir.path()).len(), 6);
    let frame = read_rgb8(&dir.path().join("000003.png")).unwrap();
    assert_eq!((frame.width, frame.height), (320, 240));
    assert!(frame.data.iter().any(|&v| v > 60), "a frame is never blank");

    let instants = fs::read_to_string(dir.path().join("instants.csv")).unwrap();
    let row: Vec<i64> =
        instants.lines().nth(1).unwrap().split(',').skip(1).take(3).map(|n| n.parse().unwrap()).collect();
    // 30 ms of readout: the last of 240 lines starts 29.875 ms after the first and is exposed for 12 ms.
    assert_eq!((row[2] - row[0], row[1] - row[0]), (41_875_000, 20_937_500));

    let timings: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(dir.path().join("timings.json")).unwrap()).unwrap();
    let passes: Vec<_> =
        timings["passes"].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert!(passes.contains(&"raster") && passes.contains(&"readback"), "{passes:?}");
    assert_eq!(timings["frames"], 6);

    let depth = read_exr_plane(&dir.path().join("depth/000003.exr"), &["Z"]).unwrap();
    assert!(depth.data.iter().all(|&z| z > 0.1 && z < 100.0), "the scene is a closed room");
    let motion = read_exr_plane(&dir.path().join("motion/000003.exr"), &["forward.u", "forward.v"]).unwrap();
    assert!(motion.data.iter().any(|&v| v.abs() > 1.0), "the camera moves");
    let color = read_exr_plane(&dir.path().join("color/000003.exr"), &["R", "G", "B", "A"]).unwrap();
    assert!(color.data.iter().skip(3).step_by(4).all(|&a| a == 1.0));
}

#[test]
fn same_seed_same_bits_other_seed_other_noise() {
    if !device_is_there("same_seed_same_bits_other_seed_other_noise") {
        return;
    }
    let dirs = [(); 3].map(|()| tempfile::tempdir().unwrap());
    let camera = both_camera();
    for (dir, seed) in dirs.iter().zip(["7", "7", "8"]) {
        let more = ["--camera", camera.to_str().unwrap(), "--seed", seed];
        assert!(simulate(dir.path(), &more).status.success());
    }
    let [a, b, c] = dirs.each_ref().map(|d| bytes_of_all(d.path()));
    assert_eq!(a, b);
    assert!(a.iter().zip(&c).all(|(a, c)| a != c));
}

#[test]
fn resume_renders_only_what_is_missing_and_refuses_another_run() {
    if !device_is_there("resume_renders_only_what_is_missing_and_refuses_another_run") {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    assert!(simulate(dir.path(), &[]).status.success());
    let whole = bytes_of_all(dir.path());
    let kept = dir.path().join("000001.png");
    let kept_at = fs::metadata(&kept).unwrap().modified().unwrap();
    fs::remove_file(dir.path().join("000004.png")).unwrap();
    assert!(simulate(dir.path(), &["--resume"]).status.success());
    assert_eq!(bytes_of_all(dir.path()), whole);
    assert_eq!(
        fs::metadata(&kept).unwrap().modified().unwrap(),
        kept_at,
        "a finished frame is not made again"
    );

    let other = simulate(dir.path(), &["--resume", "--seed", "5"]);
    assert_refused(&other, 1, &["simulate.json", "--resume"]);
    assert_eq!(bytes_of_all(dir.path()), whole);
}

/// Frames that move more and less: each kind is drawn from triangles of its own, cut for all frames of that kind.
#[test]
fn frames_that_are_made_later_are_to_the_bit_those_of_one_run() {
    if !device_is_there("frames_that_are_made_later_are_to_the_bit_those_of_one_run") {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let capture = dir.path().join("capture");
    fs::create_dir(&capture).unwrap();
    for entry in fs::read_dir(DEMO).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_file()) {
        fs::copy(&entry, capture.join(entry.file_name().unwrap())).unwrap();
    }
    let camera = fs::read_to_string(capture.join("camera.toml")).unwrap();
    let camera = camera.replace("0.033333333", "0.009") + "\n[rolling_shutter]\nreadout_time_s = 0.008\n";
    fs::write(capture.join("camera.toml"), camera).unwrap();
    let row = |i: u64| format!("{},{i:06}.png\n", 10_000_000_000 + i * 9_000_000);
    let rows: String = (0..40).map(row).collect();
    fs::write(capture.join("frames.csv"), format!("#timestamp [ns],filename\n{rows}")).unwrap();
    let out = dir.path().join("out");
    let run = |more: &[&str]| {
        let mut command = shutterbug();
        command.arg("simulate").arg(&capture).arg("--out").arg(&out).args(more).output().unwrap()
    };
    assert!(run(&[]).status.success());
    let whole = bytes_of_all(&out);
    for i in 16..40 {
        fs::remove_file(out.join(format!("{i:06}.png"))).unwrap();
    }
    assert!(run(&["--resume"]).status.success());
    assert!(bytes_of_all(&out) == whole, "frames differ");
}

#[test]
fn an_interrupted_run_keeps_its_frames_and_goes_on() {
    if !device_is_there("an_interrupted_run_keeps_its_frames_and_goes_on") {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let camera = both_camera();
    // Slow enough to be caught in the middle, also on a fast machine.
    let more = [
        "--camera",
        camera.to_str().unwrap(),
        "--method",
        "accumulation",
        "--renders",
        "600",
        "--frames-in-flight",
        "1",
    ];
    let mut command = shutterbug();
    command.args(["simulate", DEMO, "--samples", "1", "--out"]).arg(dir.path()).args(more);
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let deadline = Instant::now() + Duration::from_secs(60);
    while frames(dir.path()).is_empty() {
        assert!(Instant::now() < deadline && child.try_wait().unwrap().is_none(), "no frame was caught");
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let done = frames(dir.path()).len();
    if done < 6 {
        assert_refused(&output, 1, &["interrupted after", "--resume"]);
    }
    for frame in frames(dir.path()) {
        read_rgb8(&frame).unwrap();
    }
    let partial = fs::read_dir(dir.path())
        .unwrap()
        .any(|e| e.unwrap().path().extension().is_some_and(|x| x == "partial"));
    assert!(!partial, "nothing half-written is left");
}

#[test]
fn a_write_that_fails_is_one_clear_line_and_loses_no_frame() {
    if !device_is_there("a_write_that_fails_is_one_clear_line_and_loses_no_frame") {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    // What stands in the third frame's place cannot be replaced by a file. (Of a full disk: tests/abuse.)
    fs::create_dir(dir.path().join("000002.png")).unwrap();
    let output = simulate(dir.path(), &["--frames-in-flight", "1"]);
    assert_refused(&output, 1, &["000002.png", "found a folder"]);
    fs::remove_dir(dir.path().join("000002.png")).unwrap();
    assert_eq!(frames(dir.path()).len(), 2);
}

#[test]
fn refuses_what_it_cannot_do_with_the_contracts_exit_codes() {
    let dir = tempfile::tempdir().unwrap();
    assert_refused(&simulate(dir.path(), &["--samples", "3"]), 2, &["1, 4 or 16"]);
    assert_refused(&simulate(dir.path(), &["--method", "magic"]), 2, &["magic", "accumulation"]);
    assert_refused(&simulate(dir.path(), &["--renders", "9"]), 2, &["--renders", "--method exact"]);
    let odd = simulate(dir.path(), &["--method", "fast", "--motion-images", "3"]);
    assert_refused(&odd, 2, &["2, 4 or 6"]);
    let absent = shutterbug().args(["simulate", "/nonexistent", "--out"]).arg(dir.path()).output().unwrap();
    assert_refused(&absent, 1, &["/nonexistent"]);
    let no_driver = shutterbug()
        .args(["simulate", DEMO, "--out"])
        .arg(dir.path())
        .envs([("VK_DRIVER_FILES", "/nonexistent"), ("VK_ICD_FILENAMES", "/nonexistent")])
        .output()
        .unwrap();
    assert_refused(&no_driver, 1, &["no Vulkan device", "mesa-vulkan-drivers"]);
    assert!(frames(dir.path()).is_empty(), "never a blank frame");
    if device_is_there("refuses_what_it_cannot_do_with_the_contracts_exit_codes") {
        assert_refused(&simulate(dir.path(), &["--device", "voodoo2"]), 1, &["voodoo2", "Present: 0:"]);
    }
}
