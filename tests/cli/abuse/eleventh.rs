//! The eleventh blind set: outputs on inputs, below another run's, or behind a link; what `simulate` was silent on.

use std::fs;
use std::os::unix::fs::symlink;
use std::time::{Duration, Instant};

use super::*;

#[test]
fn an_output_behind_a_folder_that_is_not_there_yet_is_still_the_input() {
    let capture = Capture::new();
    let before = fs::read(capture.root().join("camera.toml")).unwrap();
    let out = capture.folder.path().join("new/..").join(capture.root().file_name().unwrap());
    for command in ["simulate", "diagnose"] {
        let mut run = shutterbug();
        let done = run.arg(command).arg(capture.root()).arg("--out").arg(&out).arg("--overwrite").output();
        assert_refused(
            &done.unwrap(),
            1,
            &["a folder that is the input", "an --out apart from what is read"],
        );
    }
    assert_eq!(fs::read(capture.root().join("camera.toml")).unwrap(), before);
    assert!(!capture.folder.path().join("new").exists(), "nothing is made");
}

#[test]
fn what_a_calibration_reads_beside_pictures_is_an_input_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("out")).unwrap();
    fs::write(at("out/camera.toml"), CAMERA).unwrap();
    fs::write(at("out/pattern.exr"), "no pattern").unwrap();
    image::GrayImage::from_pixel(32, 24, image::Luma([99])).save(at("flat.png")).unwrap();
    let refused = |command: &[&str], option: &str, file: &str| {
        let mut run = shutterbug();
        run.arg("calibrate").args(command).arg(at("flat.png")).arg("--out").arg(at("out"));
        let done = run.args([option]).arg(at(file)).output().unwrap();
        assert_refused(&done, 1, &["a folder that contains the input", file]);
    };
    refused(&["flat"], "--pattern", "out/pattern.exr");
    refused(&["flat"], "--camera", "out/camera.toml");
    refused(&["edge"], "--camera", "out/camera.toml");
    refused(&["readout", "--led-hz", "100"], "--camera", "out/camera.toml");
    assert_eq!(fs::read_to_string(at("out/camera.toml")).unwrap(), CAMERA);
}

#[test]
fn a_file_is_not_put_in_the_place_of_a_link() {
    let folder = tempfile::tempdir().unwrap();
    let (input, link, target) =
        (folder.path().join("in.toml"), folder.path().join("link"), folder.path().join("target"));
    fs::write(&input, CAMERA).unwrap();
    fs::write(&target, "mine").unwrap();
    symlink(&target, &link).unwrap();
    let convert = |out: &Path| {
        let mut run = shutterbug();
        run.args(["camera", "convert"]).arg(&input).args(["--to", "toml", "--out"]).arg(out);
        run.arg("--overwrite").output().unwrap()
    };
    assert_refused(&convert(&link), 1, &["link: found a link to", "the name of the file itself"]);
    assert_eq!(fs::read_to_string(&target).unwrap(), "mine");
    assert!(link.symlink_metadata().unwrap().is_symlink());
    assert_done(&convert(&target));
    assert!(fs::read_to_string(&target).unwrap().contains("width = 32"), "control");
}

/// The run above would find files that are not its own.
#[test]
fn a_run_does_not_write_below_the_folder_of_another() {
    if !device_is_there("a_run_does_not_write_below_the_folder_of_another") {
        return;
    }
    let capture = Capture::new();
    let out = capture.folder.path().join("out");
    let mut first = shutterbug();
    first.arg("simulate").arg(DEMO).arg("--out").arg(&out).stdout(Stdio::null()).stderr(Stdio::null());
    let mut first = first.spawn().unwrap();
    let begun = Instant::now();
    while !out.join(".shutterbug.lock").exists() && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(1));
    }
    let below = || {
        let mut second = shutterbug();
        second.arg("simulate").arg(capture.root()).arg("--out").arg(out.join("deep/below")).output().unwrap()
    };
    // Only while the first holds it; nothing but that process can end it.
    let refused = below();
    let held = first.try_wait().unwrap().is_none();
    assert!(first.wait().unwrap().success());
    if held {
        assert_refused(&refused, 1, &["a run that is still writing there", "a folder of its own"]);
    }
    assert_done(&below());
}

#[test]
fn frames_of_nothing_but_white_are_named() {
    if !device_is_there("frames_of_nothing_but_white_are_named") {
        return;
    }
    let capture = Capture::new();
    let said = |out: &str| {
        let done = capture.simulate(&capture.beside(out), &[]);
        assert_done(&done);
        String::from_utf8_lossy(&done.stderr).into_owned()
    };
    let plain = said("plain");
    assert!(!plain.contains("white nearly everywhere"), "control: {plain}");
    capture.write("colours.mtl", "newmtl grey\nKd 255 255 255\nnewmtl red\nKd 255 255 255\n");
    let white = said("white");
    assert!(white.contains("4 of 4 frames are white nearly everywhere: frame 0 (000000)"), "{white}");
}

#[test]
fn poses_of_an_object_under_another_ending_are_not_passed_over() {
    let capture = Capture::new();
    capture.write("objects/notes.txt", "mine");
    capture.write("objects/wall.txt", "10 0 0 0 0 0 0 1\n");
    let refused = capture.simulate(&capture.beside("out"), &[]);
    assert_refused(&refused, 1, &["wall.txt: found a file of the object `wall`", "its poses in wall.tum"]);
    fs::remove_file(capture.root().join("objects/wall.txt")).unwrap();
    if device_is_there("poses_of_an_object_under_another_ending_are_not_passed_over") {
        assert_done(&capture.simulate(&capture.beside("out"), &[]));
    }
}
