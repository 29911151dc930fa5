//! Nothing of the user's is ever lost.

use super::*;

/// L1, L2: an output on, in or around the capture.
#[test]
fn an_output_that_overlaps_an_input_is_refused_and_nothing_is_touched() {
    let capture = Capture::new();
    capture.write("real/000000.png", "a picture that is the user's");
    let before = contents(capture.folder.path());
    let root = capture.root();
    for (out, how) in [
        (root.clone(), "is the input"),
        (root.join("real"), "lies inside"),
        (capture.folder.path().to_owned(), "contains"),
    ] {
        for overwrite in [&[][..], &["--overwrite"]] {
            assert_refused(&capture.simulate(&out, overwrite), 1, &[how]);
            let mut diagnose = shutterbug();
            diagnose.arg("diagnose").arg(&root).arg("--out").arg(&out).args(overwrite);
            assert_refused(&diagnose.output().unwrap(), 1, &[how]);
        }
    }
    assert_eq!(contents(capture.folder.path()), before);
}

/// L3, and a link that leads to the input.
#[test]
fn a_single_file_replaces_another_only_when_asked_and_never_its_input() {
    let capture = Capture::new();
    let camera = capture.root().join("camera.toml");
    let convert = |out: &Path, to: &str, more: &[&str]| {
        shutterbug()
            .args(["camera", "convert"])
            .arg(&camera)
            .args(["--to", to, "--out"])
            .arg(out)
            .args(more)
            .output()
            .unwrap()
    };
    assert_refused(&convert(&camera, "ros", &["--overwrite"]), 1, &["the input itself"]);
    let out = capture.beside("camera.yaml");
    assert_done(&convert(&out, "ros", &[]));
    let first = fs::read(&out).unwrap();
    assert_refused(&convert(&out, "kalibr", &[]), 1, &["--overwrite"]);
    assert_eq!(fs::read(&out).unwrap(), first);
    assert_done(&convert(&out, "kalibr", &["--overwrite"]));
    assert_ne!(fs::read(&out).unwrap(), first, "control");
    assert_eq!(fs::read_to_string(&camera).unwrap(), CAMERA);
}

/// Nothing is read from it or written to it, and nothing waits for its other end.
#[test]
#[cfg(unix)]
fn an_out_that_is_no_folder_is_called_what_it_is() {
    let capture = Capture::new();
    let (file, pipe) = (capture.beside("file"), capture.beside("pipe"));
    fs::write(&file, "mine").unwrap();
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let root = capture.root();
    let inputs: [&[&str]; 6] = [
        &["simulate"],
        &["diagnose"],
        &["calibrate", "noise"],
        &["calibrate", "readout", "--led-hz", "100"],
        &["board", "--size", "9x6"],
        &["import"],
    ];
    let cases = [
        (file.clone(), "found --out naming a file"),
        (file.join("below"), "found a file above --out"),
        (pipe.clone(), "found --out naming a pipe"),
        (PathBuf::from("/dev/null"), "found --out naming a device"),
    ];
    for (out, says) in &cases {
        let says = [*says, "expected a folder: new, empty or an earlier run's"];
        let mut withhold = shutterbug();
        withhold.args(["withhold", "--count", "1", "--out"]).arg(out);
        assert_refused(&withhold.output().unwrap(), 1, &says);
        for more in [&[][..], &["--overwrite"], &["--resume"]] {
            assert_refused(&capture.simulate(out, more), 1, &says);
        }
        for words in inputs {
            let mut command = shutterbug();
            let code = command.args(words).arg(&root).arg("--out").arg(out).output().unwrap().status.code();
            assert_eq!(code, Some(1), "{words:?}");
        }
    }
    assert_eq!(fs::read(&file).unwrap(), b"mine");
}

/// What a power cut may leave: the last line is on the disk before its file has its name, so the file of a line that
/// was cut off is not there. A file that is there and in no line may be anybody's.
#[test]
fn a_manifest_whose_last_line_was_cut_off_names_the_rest() {
    if !device_is_there("a_manifest_whose_last_line_was_cut_off_names_the_rest") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    assert_done(&capture.simulate(&out, &[]));
    let manifest = out.join("manifest.jsonl");
    let text = fs::read_to_string(&manifest).unwrap();
    let name = |line: &str| {
        let rest = line.split_once("\"name\":\"").unwrap().1;
        rest.split_once('"').unwrap().0.to_owned()
    };
    let last = name(text.lines().next_back().unwrap());
    let before = contents(&out);
    fs::write(&manifest, &text[..text.len() - 30]).unwrap();
    assert_refused(
        &capture.simulate(&out, &["--resume"]),
        1,
        &["that no run made there", &format!("({last})")],
    );
    fs::remove_file(out.join(&last)).unwrap();
    assert_done(&capture.simulate(&out, &["--resume"]));
    let after: Vec<PathBuf> = contents(&out).into_iter().map(|(path, _)| path).collect();
    assert_eq!(after, before.into_iter().map(|(path, _)| path).collect::<Vec<_>>());
    assert!(fs::read_to_string(&manifest).unwrap().contains(&last));
}

/// L2, L3, N5: what is not the program's own is not touched; what an earlier run left is.
#[test]
fn a_folder_holds_only_what_runs_made_there() {
    if !device_is_there("a_folder_holds_only_what_runs_made_there") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("000001.png"), "mine").unwrap();
    assert_refused(&capture.simulate(&out, &[]), 1, &["000001.png", "--overwrite"]);
    assert_eq!(contents(&out), [(out.join("000001.png"), b"mine".to_vec())]);
    assert_done(&capture.simulate(&out, &["--overwrite"]));
    assert_ne!(fs::read(out.join("000001.png")).unwrap(), b"mine", "asked for");

    // Again without a word: the folder is the program's own.
    assert_done(&capture.simulate(&out, &[]));
    let manifest = fs::read_to_string(out.join("manifest.jsonl")).unwrap();
    for word in ["\"command\":\"simulate\"", "000003.png", "sha256", "colours.mtl"] {
        assert!(manifest.contains(word), "{word}: {manifest}");
    }
    // A shorter list of frames leaves no frame of the longer one behind.
    capture.write("frames.csv", frames_csv(2));
    assert_done(&capture.simulate(&out, &[]));
    assert!(!out.join("000002.png").exists() && out.join("000001.png").exists());

    // One's own file beside, and a changed one.
    for (name, text) in [("notes.txt", "mine"), ("000000.png", "painted over")] {
        let before = fs::read(out.join(name)).ok();
        fs::write(out.join(name), text).unwrap();
        assert_refused(&capture.simulate(&out, &["--seed", "3"]), 1, &[name]);
        assert_eq!(fs::read_to_string(out.join(name)).unwrap(), text);
        match before {
            Some(bytes) => fs::write(out.join(name), bytes).unwrap(),
            None => fs::remove_file(out.join(name)).unwrap(),
        }
    }
    let camera = capture.root().join("camera.toml");
    let mut other = shutterbug();
    other.args(["withhold", "--count", "1", "--out"]).arg(&out);
    assert_refused(&other.output().unwrap(), 1, &["what `simulate` made"]);
    assert!(camera.exists() && out.join("000000.png").exists());
}

/// L4: nothing is removed before the new run can put something in its place.
#[test]
fn a_run_that_cannot_begin_leaves_the_earlier_ones_frames() {
    if !device_is_there("a_run_that_cannot_begin_leaves_the_earlier_ones_frames") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    assert_done(&capture.simulate(&out, &[]));
    let before = contents(&out);
    let no_driver = |more: &[&str]| {
        let mut command = capture.command(&out, more);
        command
            .env("VK_DRIVER_FILES", "/nonexistent")
            .env("VK_ICD_FILENAMES", "/nonexistent")
            .output()
            .unwrap()
    };
    assert_eq!(no_driver(&[]).status.code(), Some(1));
    assert_eq!(capture.simulate(&out, &["--device", "no such device"]).status.code(), Some(1));
    assert_eq!(contents(&out), before);
}

/// N1: a hash of everything that was read decides whether a resumed run is the same.
#[test]
fn resume_refuses_input_that_changed_wherever_it_lies() {
    if !device_is_there("resume_refuses_input_that_changed_wherever_it_lies") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    assert_done(&capture.simulate(&out, &[]));
    fs::remove_file(out.join("000002.png")).unwrap();
    capture.write("colours.mtl", MATERIALS.replace("0.6 0.1", "0.1 0.6"));
    assert_refused(&capture.simulate(&out, &["--resume"]), 1, &["other input or options"]);
    capture.write("colours.mtl", MATERIALS);
    assert_done(&capture.simulate(&out, &["--resume"]));
    assert!(out.join("000002.png").exists(), "control: unchanged input is gone on with");
}

/// N2: a frame counts as done only if it is whole.
#[test]
fn resume_makes_frames_again_that_are_not_as_they_were() {
    if !device_is_there("resume_makes_frames_again_that_are_not_as_they_were") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    let planes = ["--planes", "depth"];
    assert_done(&capture.simulate(&out, &planes));
    let frame = |i: usize| out.join(format!("{i:06}.png"));
    let whole: Vec<_> = (0..4).map(|i| fs::read(frame(i)).unwrap()).collect();
    fs::write(frame(1), &whole[1][..60]).unwrap();
    fs::write(frame(2), "").unwrap();
    let depth = fs::read(out.join("depth/000003.exr")).unwrap();
    fs::write(out.join("depth/000003.exr"), "short").unwrap();
    let again = capture.simulate(&out, &["--planes", "depth", "--resume"]);
    assert_done(&again);
    assert!(said(&again).contains("3 frames written"), "{}", said(&again));
    (0..4).for_each(|i| assert_eq!(fs::read(frame(i)).unwrap(), whole[i], "frame {i}"));
    assert_eq!(fs::read(out.join("depth/000003.exr")).unwrap(), depth);
    // Seventh set: what stood there may be the user's; an empty file is what a power cut leaves.
    assert_eq!(fs::read(out.join("000001.png.changed")).unwrap(), whole[1][..60]);
    assert_eq!(fs::read(out.join("depth/000003.exr.changed")).unwrap(), b"short");
    assert!(!out.join("000002.png.changed").exists());
    assert!(said(&again).contains("000001.png.changed"), "{}", said(&again));
    assert_done(&capture.simulate(&out, &["--planes", "depth", "--resume"]));
}

/// Seventh set: a run that cannot write has not cost the results of the one before.
#[test]
fn results_stay_until_those_of_the_next_run_are_complete() {
    if !device_is_there("results_stay_until_those_of_the_next_run_are_complete") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    assert_done(&capture.simulate(&out, &[]));
    let before = contents(&out);
    let frames = before.iter().filter(|(path, _)| path.extension().is_some_and(|e| e == "png"));
    let least = frames.map(|(_, bytes)| bytes.len()).min().unwrap();
    let limited = |bytes: usize| {
        let script = format!(
            "MESA_SHADER_CACHE_DISABLE=1 exec prlimit --fsize={bytes} \"$0\" simulate \"$1\" --samples 1 --seed 3 \
             --out \"$2\""
        );
        shell(&script, &[capture.root().as_path(), out.as_path()])
    };
    let failed = limited(least - 1);
    assert_refused(&failed, 1, &["cannot write"]);
    assert!(contents(&out) == before, "{:?}", contents(&out).iter().map(|c| &c.0).collect::<Vec<_>>());
    assert_done(&limited(1 << 30));
    assert!(contents(&out) != before, "control: what can be written takes their place");
}

/// W1, W2: links in the output lead nowhere.
#[test]
fn links_in_the_output_are_not_followed() {
    if !device_is_there("links_in_the_output_are_not_followed") {
        return;
    }
    let capture = Capture::new();
    let (out, elsewhere) = (capture.beside("out"), capture.beside("elsewhere"));
    fs::create_dir_all(&out).unwrap();
    fs::create_dir(&elsewhere).unwrap();
    fs::write(elsewhere.join("file"), "mine").unwrap();
    let link = |name: &str, to: &Path| std::os::unix::fs::symlink(to, out.join(name)).unwrap();
    for name in ["000001.png.partial", "simulate.json.partial", "000002.png"] {
        link(name, &elsewhere.join("file"));
    }
    link("color", &elsewhere);
    assert_refused(&capture.simulate(&out, &["--planes", "color"]), 1, &["000001.png.partial"]);
    assert_refused(
        &capture.simulate(&out, &["--planes", "color", "--overwrite"]),
        1,
        &["color: found a link"],
    );
    assert_done(&capture.simulate(&out, &["--overwrite"]));
    assert_eq!(contents(&elsewhere), [(elsewhere.join("file"), b"mine".to_vec())]);
    assert!(out.join("000002.png").symlink_metadata().unwrap().is_file());
}

/// T1: the second run says who holds the folder.
#[test]
fn two_runs_do_not_share_a_folder() {
    if !device_is_there("two_runs_do_not_share_a_folder") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    fs::create_dir(&out).unwrap();
    let held = fs::File::create(out.join(".shutterbug.lock")).unwrap();
    std::io::Write::write_all(&mut &held, b"4711").unwrap();
    held.lock().unwrap();
    assert_refused(&capture.simulate(&out, &[]), 1, &["process 4711"]);
    // What a killed run has left: the file without a holder, and half a frame.
    drop(held);
    fs::write(out.join(".shutterbug-0123456789abcdef.partial"), "half").unwrap();
    assert_done(&capture.simulate(&out, &[]));
    let left: Vec<_> =
        contents(&out).into_iter().filter(|(p, _)| p.to_string_lossy().contains("/.shutterbug")).collect();
    assert!(left.is_empty(), "{left:?}");
}

/// A run that is killed at any moment leaves frames that are whole or not there, and is gone on with to the same end.
#[test]
fn a_killed_run_leaves_whole_files_and_goes_on_to_the_same_end() {
    if !device_is_there("a_killed_run_leaves_whole_files_and_goes_on_to_the_same_end") {
        return;
    }
    let capture = Capture::new();
    capture.write("frames.csv", frames_csv(8));
    let (whole, out) = (capture.beside("whole"), capture.beside("out"));
    assert_done(&capture.simulate(&whole, &[]));
    for kill in 0..8 {
        let mut child = capture.command(&out, &["--resume"]).stderr(Stdio::null()).spawn().unwrap();
        // As many files as it takes, not as much time.
        while child.try_wait().unwrap().is_none() && contents(&out).len() < kill {
            std::thread::yield_now();
        }
        child.kill().unwrap();
        child.wait().unwrap();
        for (path, bytes) in contents(&out).iter().filter(|(p, _)| p.extension().is_some_and(|e| e == "png"))
        {
            assert_eq!(
                *bytes,
                fs::read(whole.join(path.file_name().unwrap())).unwrap(),
                "{}",
                path.display()
            );
        }
    }
    assert_done(&capture.simulate(&out, &["--resume"]));
    let pictures = |folder: &Path| -> Vec<Vec<u8>> {
        let all = contents(folder).into_iter().filter(|(p, _)| p.extension().is_some_and(|e| e == "png"));
        all.map(|(_, bytes)| bytes).collect()
    };
    assert_eq!(pictures(&out), pictures(&whole));
}

/// A manifest may be a stranger's: what it names outside its folder or through a link stays, and so do files whose
/// names only look like those of a run that was killed.
#[test]
fn a_manifest_of_a_stranger_removes_nothing_elsewhere() {
    if !device_is_there("a_manifest_of_a_stranger_removes_nothing_elsewhere") {
        return;
    }
    let capture = Capture::new();
    let (out, mine) = (capture.beside("out"), capture.beside("elsewhere/mine.txt"));
    fs::create_dir_all(mine.parent().unwrap()).unwrap();
    fs::write(&mine, "mine").unwrap();
    fs::create_dir_all(out.join("sub")).unwrap();
    std::os::unix::fs::symlink(mine.parent().unwrap(), out.join("link")).unwrap();
    let names =
        ["../elsewhere/mine.txt", mine.to_str().unwrap(), "sub/../../elsewhere/mine.txt", "link/mine.txt"];
    let sha256 = shutterbug_diagnose::out::sha256_hex(b"mine");
    let line = |name: &&str| format!("{{\"name\":\"{name}\",\"bytes\":4,\"sha256\":\"{sha256}\"}}\n");
    let start = "{\"shutterbug\":\"0.1.0\",\"command\":\"simulate\",\"arguments\":[],\"made_from\":{}}\n";
    let lines: String = names.iter().chain(&["old.png"]).map(line).collect();
    fs::write(out.join("manifest.jsonl"), format!("{start}{lines}")).unwrap();
    fs::write(out.join("old.png"), "mine").unwrap();
    fs::write(out.join(".shutterbug-diary.partial"), "mine").unwrap();
    assert_refused(&capture.simulate(&out, &[]), 1, &[".shutterbug-diary.partial", "link"]);
    assert_done(&capture.simulate(&out, &["--overwrite"]));
    assert!(mine.exists() && out.join(".shutterbug-diary.partial").exists());
    assert!(!out.join("old.png").exists(), "control: what it names in the folder is removed");
}

/// W1, for the file that a diagnosis appends to: also where `--overwrite` does not look at what is there.
#[test]
fn a_diagnosis_writes_through_no_link() {
    let capture = Capture::new();
    let (out, mine) = (capture.beside("out"), capture.beside("mine.txt"));
    let picture = image::RgbImage::from_fn(32, 24, |x, y| image::Rgb([x as u8 * 7, y as u8 * 9, 80]));
    fs::create_dir_all(capture.root().join("real")).unwrap();
    for i in 0..4 {
        picture.save(capture.root().join(format!("real/{i:06}.png"))).unwrap();
    }
    fs::create_dir(&out).unwrap();
    fs::write(&mine, "mine").unwrap();
    std::os::unix::fs::symlink(&mine, out.join("progress.jsonl")).unwrap();
    let mut diagnose = shutterbug();
    diagnose.arg("diagnose").arg(capture.root()).arg("--out").arg(&out).arg("--overwrite");
    assert_refused(&diagnose.output().unwrap(), 1, &["progress.jsonl"]);
    assert_eq!(fs::read(&mine).unwrap(), b"mine");
}
