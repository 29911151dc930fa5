//! A fourth set of bad inputs, on the commands of 2026-11-25: what happens to `--out` while a run writes, boards and
//! charts that are none, recordings, time limits.

use super::*;

/// A pipe is somebody's: it is neither replaced nor waited for, with and without `--overwrite`.
#[test]
fn what_is_no_regular_file_is_not_replaced() {
    let capture = Capture::new();
    let pipe = capture.beside("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for more in [&[][..], &["--overwrite"]] {
        let mut convert = shutterbug();
        convert.args(["camera", "convert", "--to", "ros"]).arg(capture.root().join("camera.toml"));
        let output = convert.arg("--out").arg(&pipe).args(more).output().unwrap();
        assert_refused(&output, 1, &["pipe: found a pipe, socket or device; expected a regular file"]);
        assert!(!pipe.metadata().unwrap().is_file() && !pipe.symlink_metadata().unwrap().is_symlink());
    }
}

/// A second mount of the capture is the capture.
#[test]
fn an_output_on_a_second_mount_of_the_input_is_refused() {
    let capture = Capture::new();
    let second = capture.beside("second");
    fs::create_dir(&second).unwrap();
    let mount = Command::new("mount").arg("--bind").arg(capture.root()).arg(&second).output();
    if !mount.as_ref().is_ok_and(|done| done.status.success()) {
        eprintln!("SKIPPED an_output_on_a_second_mount_of_the_input_is_refused: no mount: {mount:?}");
        return;
    }
    let before = contents(&capture.root());
    let said: Vec<_> = [(second.clone(), "is the input"), (second.join("new"), "lies inside")]
        .map(|(out, how)| (capture.simulate(&out, &["--overwrite"]), how))
        .into();
    let mut convert = shutterbug();
    convert.args(["camera", "convert", "--to", "ros", "--overwrite"]).arg(capture.root().join("camera.toml"));
    let single = convert.arg("--out").arg(second.join("camera.toml")).output().unwrap();
    let left = contents(&capture.root());
    assert!(Command::new("umount").arg(&second).status().unwrap().success());
    said.iter().for_each(|(output, how)| assert_refused(output, 1, &[how]));
    assert_refused(&single, 1, &["the input itself"]);
    assert_eq!(left, before);
}

/// Runs a simulation of many frames; `meanwhile` is called when the first is there and the run stands still.
fn interfered(capture: &Capture, out: &Path, more: &[&str], meanwhile: impl FnOnce()) -> Output {
    capture.write("frames.csv", frames_csv(10));
    let mut child = capture.command(out, more).stderr(Stdio::piped()).spawn().unwrap();
    let signal = |name: &str| {
        assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
    };
    while !out.join("000000.png").exists() {
        std::thread::yield_now();
    }
    signal("-STOP");
    assert!(!out.join("000009.png").exists(), "the run was too fast to be interfered with");
    meanwhile();
    signal("-CONT");
    let _ = &mut child;
    child.wait_with_output().unwrap()
}

/// What the user puts into the folder during a run is not the run's, unless everything there was given up.
#[test]
fn a_file_that_the_user_puts_there_during_a_run_stays() {
    let test = "a_file_that_the_user_puts_there_during_a_run_stays";
    if !device_is_there(test) {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    let file = out.join("000009.png");
    let put = || fs::write(&file, "mine").unwrap();
    let output = interfered(&capture, &out, &[], put);
    assert_refused(&output, 1, &["000009.png: found a file; expected no such file yet, or --overwrite"]);
    assert_eq!(fs::read(&file).unwrap(), b"mine");
    let named = |name: &str| fs::read_to_string(out.join("manifest.jsonl")).unwrap().contains(name);
    assert!(named("000000.png") && !named("000009.png"), "the manifest names it");
    assert_refused(&capture.simulate(&out, &[]), 1, &["000009.png"]);
    fs::remove_file(&file).unwrap();
    assert_done(&capture.simulate(&out, &["--resume"]));
    fs::remove_dir_all(&out).unwrap();
    assert_done(&interfered(&capture, &out, &["--overwrite"], put));
    assert_ne!(fs::read(&file).unwrap(), b"mine", "control: --overwrite");
}

/// A run writes into the folder that it was given, not into one that has come in its place.
#[test]
fn a_folder_that_is_replaced_during_a_run_is_left_alone() {
    if !device_is_there("a_folder_that_is_replaced_during_a_run_is_left_alone") {
        return;
    }
    for (replaced, more) in [(true, &[][..]), (true, &["--overwrite"]), (false, &["--planes", "depth"])] {
        let capture = Capture::new();
        let (out, moved) = (capture.beside("out"), capture.beside("moved"));
        let output = interfered(&capture, &out, more, || {
            fs::rename(&out, &moved).unwrap();
            if replaced {
                fs::create_dir(&out).unwrap();
                fs::write(out.join("notes.txt"), "mine").unwrap();
            }
        });
        assert_refused(&output, 1, &["out: found another folder or none", "moved, replaced or removed"]);
        assert_eq!(contents(&out).len(), usize::from(replaced));
        assert_eq!(out.exists(), replaced);
        assert!(moved.join("000000.png").exists());
    }
}
