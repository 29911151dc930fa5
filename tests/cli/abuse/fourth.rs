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
    // So many that it is not done before it stands still.
    let pose = |i: i32| {
        let i = f64::from(i);
        format!("{} 0 {} 0 0.5 -0.5 0.5 -0.5\n", 10.0 + 0.04 * i, 0.01 * i)
    };
    capture.write("trajectory.tum", (-2..202).map(pose).collect::<String>());
    capture.write("frames.csv", frames_csv(200));
    let child = capture.command(out, more).stderr(Stdio::piped()).spawn().unwrap();
    let signal = |name: &str| {
        assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
    };
    while !out.join("000000.png").exists() {
        std::thread::yield_now();
    }
    signal("-STOP");
    assert!(!out.join("000199.png").exists(), "the run was too fast to be interfered with");
    meanwhile();
    signal("-CONT");
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
    let file = out.join("000199.png");
    let put = || fs::write(&file, "mine").unwrap();
    let output = interfered(&capture, &out, &[], put);
    assert_refused(&output, 1, &["000199.png: found a file; expected no such file yet, or --overwrite"]);
    assert_eq!(fs::read(&file).unwrap(), b"mine");
    let named = |name: &str| fs::read_to_string(out.join("manifest.jsonl")).unwrap().contains(name);
    assert!(named("000000.png") && !named("000199.png"), "the manifest names it");
    assert_refused(&capture.simulate(&out, &[]), 1, &["000199.png"]);
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

/// A row of one px, or a single one, on either side.
#[test]
fn pairs_of_a_few_px_are_refused() {
    for size in [[1, 1], [320, 1], [1, 240], [15, 200]] {
        let folder = tempfile::tempdir().unwrap();
        for side in ["sim", "real"] {
            fs::create_dir(folder.path().join(side)).unwrap();
            for i in 0..6u32 {
                let picture =
                    image::GrayImage::from_fn(size[0], size[1], |x, y| image::Luma([(x + y + i) as u8]));
                picture.save(folder.path().join(format!("{side}/{i:06}.png"))).unwrap();
            }
        }
        let mut diagnose = shutterbug();
        diagnose.arg("diagnose").arg("--sim").arg(folder.path().join("sim"));
        diagnose.arg("--real").arg(folder.path().join("real")).arg("--out").arg(folder.path().join("out"));
        let found = format!("000000.png: found a picture of {}x{} px", size[0], size[1]);
        assert_refused(&diagnose.output().unwrap(), 1, &[&found, "at least 16 px a side"]);
    }
}

/// What would be ignored is a mistake.
#[test]
fn options_of_pairs_are_not_taken_with_a_capture() {
    let capture = Capture::new();
    for more in [&["--unpaired"][..], &["--match", "match.csv"]] {
        let mut diagnose = shutterbug();
        diagnose.arg("diagnose").arg(capture.root()).args(more).arg("--out").arg(capture.beside("out"));
        assert_refused(&diagnose.output().unwrap(), 2, &["cannot be used with", more[0]]);
    }
}

/// Corners that no camera sees are no camera, and copies of one view are one.
#[test]
fn boards_that_say_nothing_of_a_camera_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("photographs")).unwrap();
    for i in 0..8u64 {
        let value =
            |x: u32, y: u32| mutations::Dice(u64::from(x) << 32 | u64::from(y) << 8 | i).roll(256) as u8;
        let picture = image::GrayImage::from_fn(320, 240, |x, y| image::Luma([value(x, y)]));
        picture.save(at(&format!("photographs/{i}.png"))).unwrap();
    }
    let board = |pattern: &str, corner: &mut dyn FnMut(usize, usize) -> [f64; 2]| {
        let line = |k: usize, i: usize, [x, y]: [f64; 2]| format!("{k}.png,{},{},{x},{y}\n", i % 7, i / 7);
        let all = (0..8 * 35).map(|i| line(i / 35, i % 35, corner(i / 35, i % 35)));
        fs::write(at("corners.csv"), all.collect::<String>()).unwrap();
        let mut command = shutterbug();
        command
            .arg("board")
            .arg(at("photographs"))
            .args(["--size", "7x5", "--pattern", pattern, "--corners"])
            .arg(at("corners.csv"));
        command.arg("--out").arg(at("out")).output().unwrap()
    };
    let mut dice = mutations::Dice(3);
    let mut random = |_: usize, _: usize| [dice.roll(320) as f64, dice.roll(240) as f64];
    let words = "corners.csv: found corners that are not where squares meet";
    assert_refused(&board("checkerboard", &mut random), 1, &[words]);
    // Of tags that is not asked.
    assert_refused(&board("aprilgrid", &mut random), 1, &["photographs: found "]);
    assert!(!at("out").exists(), "a camera was written");
    let dark = |x: u32, y: u32| ((x + 20) / 30 + (y + 20) / 30).is_multiple_of(2);
    let squares =
        image::GrayImage::from_fn(320, 240, |x, y| image::Luma([if dark(x, y) { 40 } else { 200 }]));
    squares.save(at("photographs/0.png")).unwrap();
    (1..8).for_each(|i| {
        assert!(fs::copy(at("photographs/0.png"), at(&format!("photographs/{i}.png"))).is_ok())
    });
    let copies =
        board("checkerboard", &mut |_, i| [40.0 + 30.0 * (i % 7) as f64, 40.0 + 30.0 * (i / 7) as f64]);
    assert_refused(&copies, 1, &["in 1 picture ", "1.png: the same picture as 0.png"]);
}

/// A flat field is several pictures of a surface, and dark ones are darker.
#[test]
fn flat_fields_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let noise = |x: u32, y: u32, seed: u64| {
        let roll =
            |k: u64| mutations::Dice(u64::from(x) << 40 | u64::from(y) << 16 | seed << 4 | k).roll(9) as f64;
        roll(1) + roll(2) - 8.0
    };
    let photographs = |name: &str, level: f64, count: u64| {
        fs::create_dir(at(name)).unwrap();
        for i in 0..count {
            let value = |x: u32, y: u32| (level + noise(x, y, 7 + i) + 0.5 * noise(x, y, 1)) as u8;
            let picture = image::GrayImage::from_fn(160, 128, |x, y| image::Luma([value(x, y)]));
            picture.save(at(&format!("{name}/{i}.png"))).unwrap();
        }
    };
    photographs("flat", 120.0, 4);
    photographs("bright", 200.0, 2);
    photographs("dark", 20.0, 2);
    photographs("copies", 120.0, 1);
    fs::copy(at("copies/0.png"), at("copies/1.png")).unwrap();
    let calibrate = |frames: &str, dark: Option<&str>| {
        let mut command = shutterbug();
        command.args(["calibrate", "flat", "--overwrite"]).arg(at(frames));
        if let Some(dark) = dark {
            command.arg("--dark").arg(at(dark));
        }
        command.arg("--out").arg(at("out")).output().unwrap()
    };
    assert_refused(&calibrate("copies", None), 1, &["1.png: found the same picture as"]);
    assert_refused(&calibrate("flat", Some("flat")), 1, &["0.png: found the same picture as"]);
    assert_refused(
        &calibrate("flat", Some("bright")),
        1,
        &["bright: found pictures with a mean of", "the cap on"],
    );
    assert!(!at("out/camera.toml").exists());
    assert_done(&calibrate("flat", Some("dark")));
}

const SENSOR: &str = "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  \
                      data: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n\
                      rate_hz: 20\nresolution: [32, 24]\ncamera_model: pinhole\nintrinsics: [30.0, 30.0, 16.0, 12.0]\n\
                      distortion_model: radial-tangential\ndistortion_coefficients: [0.0, 0.0, 0.0, 0.0]\n";

/// A data set of EuRoC's kind with pictures of these names and sizes, imported.
fn euroc(folder: &Path, pictures: &[(&str, [u32; 2])]) -> Output {
    let data = folder.join("set/mav0/cam0/data");
    fs::create_dir_all(&data).unwrap();
    fs::write(folder.join("set/mav0/cam0/sensor.yaml"), SENSOR).unwrap();
    let mut list = "#timestamp [ns],filename\n".to_owned();
    for (i, (name, [width, height])) in pictures.iter().enumerate() {
        list += &format!("{},{name}\n", 1000 + 50_000_000 * i);
        let picture = image::GrayImage::from_fn(*width, *height, |x, y| image::Luma([(9 * x + y) as u8]));
        picture.save_with_format(data.join(name), image::ImageFormat::Png).unwrap();
    }
    fs::write(folder.join("set/mav0/cam0/data.csv"), list).unwrap();
    let mut import = shutterbug();
    import.arg("import").arg(folder.join("set")).arg("--out").arg(folder.join("out")).output().unwrap()
}

/// A picture does not take the place of a file that says what the pictures are.
#[test]
fn pictures_under_the_names_of_other_files_are_refused() {
    for name in
        ["frames.csv", "camera.toml", "manifest.jsonl", "Manifest.JSONL", "import.json", "trajectory.tum"]
    {
        let folder = tempfile::tempdir().unwrap();
        let output = euroc(folder.path(), &[("0.png", [32, 24]), (name, [32, 24])]);
        assert_refused(&output, 1, &[&format!("a picture called `{name}`")]);
        assert!(!folder.path().join("out").join(name).exists());
    }
}

/// A camera's numbers are those of pictures of its size.
#[test]
fn pictures_of_another_size_than_the_camera_are_said_or_refused() {
    let run = |sizes: [[u32; 2]; 3]| {
        let folder = tempfile::tempdir().unwrap();
        let pictures: Vec<_> = ["0.png", "1.png", "2.png"].into_iter().zip(sizes).collect();
        euroc(folder.path(), &pictures)
    };
    let same = run([[32, 24]; 3]);
    assert_done(&same);
    assert!(!said(&same).contains("another size"), "{}", said(&same));
    let one = run([[32, 24], [16, 12], [32, 24]]);
    assert_done(&one);
    assert!(said(&one).contains("1 of 3 pictures of another size (1.png: 16x12 px)"), "{}", said(&one));
    assert_eq!(said(&one).matches("another size").count(), 1);
    assert_refused(
        &run([[16, 12]; 3]),
        1,
        &["3 of 3 pictures of another size", "32x24 px, as the camera has"],
    );
}

/// A material file that is none is not left away.
#[test]
fn materials_that_are_no_file_are_refused() {
    for pipe in [true, false] {
        let capture = Capture::new();
        let file = capture.root().join("colours.mtl");
        fs::remove_file(&file).unwrap();
        if pipe {
            assert!(Command::new("mkfifo").arg(&file).status().unwrap().success());
        } else {
            fs::create_dir(&file).unwrap();
        }
        let what = if pipe { "a pipe, socket or device" } else { "a folder" };
        let output = capture.simulate(&capture.beside("out"), &[]);
        assert_refused(&output, 1, &[&format!("scene.obj:1: found `colours.mtl`, which is {what}")]);
    }
}

/// A pipe in the place of the Vulkan loader is not waited for.
#[test]
fn a_pipe_is_no_vulkan_loader() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut child = shutterbug()
        .arg("devices")
        .env("SHUTTERBUG_VULKAN_LIBRARY", &pipe)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    for _ in 0..200 {
        if child.try_wait().unwrap().is_some() {
            return assert_refused(&child.wait_with_output().unwrap(), 1, &["no regular file"]);
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    child.kill().unwrap();
    panic!("it waits for the pipe");
}
