//! Messages: one line each, which steers no terminal, and one table of exit codes.

use super::*;

/// U1, U2: line ends and escape sequences of the input.
#[test]
fn what_stands_in_a_file_cannot_steer_the_terminal() {
    let capture = Capture::new();
    for key in ["\"a\\nb\" = 1\n", "\"a\\u001b[31mred\" = 1\n"] {
        capture.write("camera.toml", format!("{key}{CAMERA}"));
        let output = capture.simulate(&capture.beside("out"), &[]);
        assert_refused(&output, 1, &["camera.toml:1", "unknown key"]);
        assert!(
            !said(&output).contains('\u{1b}') && said(&output).lines().count() == 1,
            "{:?}",
            said(&output)
        );
    }
    capture.write("camera.toml", CAMERA);
    // A warning on the way, and an object's name with a line end.
    capture.write("scene.obj", format!("mtllib \u{1b}[2Jgone.mtl\n{SCENE}"));
    capture.write("objects/a\nb.tum", "10 0 0 0 0 0 0 1\n");
    let output = capture.simulate(&capture.beside("out"), &[]);
    assert_refused(&output, 1, &["a\\nb", "unknown object"]);
    assert!(!said(&output).contains('\u{1b}'), "{:?}", said(&output));
}

/// U1: a name with a line end writes no line of its own into a camera.
#[test]
fn a_name_with_a_line_end_makes_no_line_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let noise = |seed: u32| {
        move |x: u32, y: u32| {
            let v = (x.wrapping_mul(7919) ^ y.wrapping_mul(104_729) ^ seed).wrapping_mul(2_654_435_761) >> 28;
            image::Rgb([(60 + x + v) as u8, (50 + y + v) as u8, (80 + v) as u8])
        }
    };
    let frames = ["a.png", "b\n[x]"].map(|name| folder.path().join(name));
    for (seed, path) in [1, 2].into_iter().zip(&frames) {
        image::RgbImage::from_fn(96, 96, noise(seed))
            .save_with_format(path, image::ImageFormat::Png)
            .unwrap();
    }
    let out = folder.path().join("out");
    let mut calibrate = shutterbug();
    calibrate.args(["calibrate", "noise"]).args(&frames).arg("--out").arg(&out);
    assert_done(&calibrate.output().unwrap());
    let camera = out.join("camera.toml");
    let mut convert = shutterbug();
    assert_done(&convert.args(["camera", "convert", "--to", "ros"]).arg(camera).output().unwrap());
}

/// K1: what the command line itself asks for wrongly is 2, whatever the files hold; all else is 1.
#[test]
fn exit_codes_are_of_one_table() {
    let capture = Capture::new();
    let out = capture.beside("out");
    assert_refused(&capture.simulate(&out, &["--preset", "fone"]), 2, &["--preset", "phone"]);
    let run = |arguments: &[&str]| {
        let mut command = shutterbug();
        command.args(arguments).arg("--out").arg(&out).output().unwrap()
    };
    let camera = capture.root().join("camera.toml");
    let camera = camera.to_str().unwrap();
    assert_refused(
        &run(&["camera", "convert", "--from", "sdf", "--to", "toml", camera]),
        2,
        &["SDF is written only"],
    );
    assert_refused(&run(&["withhold", "--count", "2", "--only", "99"]), 2, &["--only", "case 99"]);
    for too_many in ["1000000000", "18446744073709551615"] {
        assert_eq!(run(&["withhold", "--frames", too_many]).status.code(), Some(2), "--frames {too_many}");
    }
    assert_refused(&run(&["camera", "convert", "--to", "toml", "/no/such/file"]), 1, &["/no/such/file"]);
    assert!(!out.exists());
}

/// K1: an option that would be ignored without another one, or beside it, is the command line's fault.
#[test]
fn options_that_would_be_ignored_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let mut cases: Vec<(Vec<&str>, &str)> = vec![
        (vec!["withhold", "--out", out, "--points", "3"], "--curve"),
        (vec!["withhold", "--out", out, "--repeats", "9"], "--curve"),
        (vec!["camera", "convert", "/no/such/file", "--overwrite"], "--out"),
        (vec!["board", "/no/such", "--out", out, "--marker-share", "0.7"], "--marker-share has no meaning"),
        (
            vec!["board", "/no/such", "--out", out, "--dictionary", "DICT_4X4_50"],
            "--dictionary has no meaning",
        ),
        (
            vec!["board", "/no/such", "--out", out, "--pattern", "charuco", "--tag-spacing", "0.2"],
            "no meaning",
        ),
    ];
    for option in
        ["--camera-info", "--poses", "--imu", "--body", "--camera-frame", "--name", "--times", "--topic"]
    {
        cases.push((vec!["import", "/no/such/file", option, "x"], "--out"));
    }
    for option in [&["--every", "2"][..], &["--capture"], &["--resume"], &["--overwrite"]] {
        cases.push(([&["import", "/no/such/file"], option].concat(), "--out"));
    }
    for more in [&["--scene", "exact"][..], &["--poses", "exact"], &["--camera", "c.toml"]] {
        let unpaired = ["diagnose", "--sim", "/a", "--real", "/b", "--unpaired", "--out", out];
        cases.push(([&unpaired[..], more].concat(), more[0]));
        cases.push(([&["diagnose", "--real", "/b", "--out", out][..], more].concat(), "--sim"));
    }
    cases.push((vec!["diagnose", "--sim", "/a", "--real", "/b", "--out", out, "--device", "x"], "--device"));
    for (arguments, says) in cases {
        assert_refused(&shutterbug().args(&arguments).output().unwrap(), 2, &[says]);
    }
    // Control: none of these is refused for its options.
    for arguments in [
        &[
            "board",
            "/no/such",
            "--out",
            out,
            "--pattern",
            "charuco",
            "--size",
            "4x3",
            "--marker-share",
            "0.7",
        ][..],
        &["import", "/no/such/file", "--out", out, "--poses", "x", "--overwrite"],
        &["diagnose", "--sim", "/a", "--real", "/b", "--out", out, "--scene", "exact", "--camera", "c.toml"],
        &["diagnose", "/a", "--out", out, "--scene", "exact", "--camera", "c.toml", "--device", "x"],
    ] {
        assert_eq!(shutterbug().args(arguments).output().unwrap().status.code(), Some(1), "{arguments:?}");
    }
    assert!(!Path::new(out).exists());
}

/// U4, U5: files of other kinds are called by their name.
#[test]
fn other_formats_are_called_by_their_name() {
    let folder = tempfile::tempdir().unwrap();
    let convert = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        shutterbug().args(["camera", "convert", "--to", "toml"]).arg(path).output().unwrap()
    };
    assert_refused(&convert("a.sdf", "<?xml version='1.0'?>\n<sdf/>\n"), 1, &["SDF is written only"]);
    let misspelt = convert("b.yaml", "image_width: 64\ncamera_matrx:\n  data: [1, 2]\n");
    assert_refused(&misspelt, 1, &["no known format", "camera_matrx"]);
    let gif = folder.path().join("c.png");
    fs::write(&gif, "GIF89a").unwrap();
    let mut calibrate = shutterbug();
    calibrate.args(["calibrate", "noise"]).args([&gif, &gif]).arg("--out").arg(folder.path().join("out"));
    assert_refused(&calibrate.output().unwrap(), 1, &["c.png", "PNG or JPEG"]);
}

/// K2: no colours in a file.
#[test]
fn warnings_in_a_file_have_no_colours() {
    let capture = Capture::new();
    capture.write("scene.obj", format!("mtllib gone.mtl\n{SCENE}"));
    capture.write("trajectory.tum", "nothing\n");
    let output = capture.simulate(&capture.beside("out"), &[]);
    assert!(said(&output).contains("gone.mtl") && !said(&output).contains('\u{1b}'), "{:?}", said(&output));
}

/// U6: what is missing or cannot be read is named, with file, line and reason.
#[test]
fn what_is_missing_is_named_with_file_and_reason() {
    let capture = Capture::new();
    let ros = capture.beside("ros.yaml");
    fs::write(
        &ros,
        "image_width: 64\nimage_height: 48\ncamera_matrix:\n  data: [50, 0, 31.5, 0, 50, 23.5, 0, 0, 1]\n\
         distortion_model: plumb_bob\ndistortion_coefficients:\n  data: [0, 0, 0, 0, 0]\n",
    )
    .unwrap();
    let convert = |more: &[&str]| {
        let mut command = shutterbug();
        command.args(["camera", "convert", "--to", "toml"]).arg(&ros).args(more).output().unwrap()
    };
    assert_refused(&convert(&[]), 1, &["ros.yaml", "no frame rate", "--rate-hz"]);
    assert_done(&convert(&["--rate-hz", "25"]));
    let poses = capture.beside("poses.txt");
    fs::write(&poses, b"1 0 0 0 0 1 0 0 0 0 1 0\n\xff\xfe\n").unwrap();
    let import = shutterbug().arg("import").arg(&poses).output().unwrap();
    assert_refused(&import, 1, &["poses.txt:2", "not UTF-8"]);
    let camera = capture.root().join("camera.toml");
    fs::remove_file(&camera).unwrap();
    std::os::unix::fs::symlink("camera.toml", &camera).unwrap();
    assert_refused(&capture.simulate(&capture.beside("out"), &[]), 1, &["camera.toml", "symbolic links"]);
}
