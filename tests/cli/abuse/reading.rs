//! What is read: regular files of limited size, in time that grows with their size alone.

use super::*;

/// Runs to its end or is killed: a test must not wait for ever for what should not wait at all.
fn under_watch(mut command: Command, name: &str) -> Output {
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    for _ in 0..1200 {
        if child.try_wait().unwrap().is_some() {
            return child.wait_with_output().unwrap();
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    panic!("{name}: still waiting after two minutes");
}

/// H1, H2: pipes and devices in every place of a file.
#[test]
fn what_is_no_regular_file_is_refused_in_every_place() {
    let make = |path: &Path, pipe: bool| {
        let _ = fs::remove_file(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        if pipe {
            assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
        } else {
            std::os::unix::fs::symlink("/dev/zero", path).unwrap();
        }
    };
    for pipe in [true, false] {
        for name in
            ["camera.toml", "scene.obj", "trajectory.tum", "frames.csv", "lights.toml", "objects/wall.tum"]
        {
            let capture = Capture::new();
            capture.write("camera.toml", format!("shading = \"lit\"\n{CAMERA}"));
            capture.write(
                "lights.toml",
                "[[light]]\nposition = [0, 0, 1]\ncolor = [1, 1, 1]\nattenuation = [1, 0, 0]\n",
            );
            make(&capture.root().join(name), pipe);
            let output = under_watch(capture.command(&capture.beside("out"), &[]), name);
            // A link out of the capture is refused before what it leads to is looked at.
            let words: &[&str] =
                if name == "scene.obj" && !pipe { &[name] } else { &[name, "a regular file"] };
            assert_refused(&output, 1, words);
        }
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        make(&at("a.yaml"), pipe);
        let mut convert = shutterbug();
        convert.args(["camera", "convert", "--to", "toml"]).arg(at("a.yaml"));
        assert_refused(&under_watch(convert, "YAML"), 1, &["a.yaml", "a regular file"]);
        let mut calibrate = shutterbug();
        calibrate.args(["calibrate", "noise"]).args([at("a.yaml"), at("a.yaml")]).arg("--out").arg(at("out"));
        assert_refused(&under_watch(calibrate, "a frame"), 1, &["a.yaml", "a regular file"]);
        make(&at("poses.txt"), pipe);
        let mut import = shutterbug();
        import.arg("import").arg(at("poses.txt")).arg("--out").arg(at("out"));
        assert_refused(&under_watch(import, "poses"), 1, &["poses.txt", "a regular file"]);
    }
}

/// H1, for what this program wrote itself and for real frames.
#[test]
fn a_pipe_among_the_real_frames_or_the_results_is_refused() {
    if !device_is_there("a_pipe_among_the_real_frames_or_the_results_is_refused") {
        return;
    }
    let capture = Capture::new();
    let out = capture.beside("out");
    fs::create_dir_all(capture.root().join("real")).unwrap();
    assert!(Command::new("mkfifo").arg(capture.root().join("real/000000.png")).status().unwrap().success());
    let mut diagnose = shutterbug();
    diagnose.arg("diagnose").arg(capture.root()).arg("--out").arg(&out);
    assert_refused(&under_watch(diagnose, "real"), 1, &["000000.png", "a regular file"]);
    let out = capture.beside("frames");
    fs::create_dir_all(&out).unwrap();
    assert!(Command::new("mkfifo").arg(out.join("simulate.json")).status().unwrap().success());
    let resumed = under_watch(capture.command(&out, &["--resume"]), "simulate.json");
    assert_refused(&resumed, 1, &["simulate.json"]);
}

/// H3: twice the lights or keys take about twice the steps. Counted in bytes looked at would need a hook, so these
/// sizes are such that quadratic work would take hours.
#[test]
fn time_grows_with_the_size_of_a_file_and_not_with_its_square() {
    let capture = Capture::new();
    capture.write("camera.toml", format!("shading = \"lit\"\n{CAMERA}"));
    let light = "[[light]]\nposition = [0, 0, 1]\ncolor = [1, 1, 1]\nattenuation = [1, 0, 0]\n";
    capture.write("lights.toml", light.repeat(50_000));
    let output = under_watch(capture.command(&capture.beside("out"), &[]), "lights");
    assert_refused(&output, 1, &["lights.toml:257", "50000 lights", "at most 64"]);

    let yaml = capture.beside("many.yaml");
    let keys: String = (0..300_000).map(|i| format!("k{i}: 1\n")).collect();
    fs::write(&yaml, keys + "k0: 2\n").unwrap();
    let mut convert = shutterbug();
    convert.args(["camera", "convert", "--to", "toml"]).arg(&yaml);
    assert_refused(&under_watch(convert, "keys"), 1, &["many.yaml:300001", "`k0` again"]);
}

/// U7: names that are looked for one by one are limited, and warnings of one kind are counted.
#[test]
fn many_names_are_refused_and_many_warnings_are_counted() {
    let capture = Capture::new();
    capture.write("scene.obj", format!("mtllib {}\n{SCENE}", "a.mtl ".repeat(100_000)));
    let output = under_watch(capture.command(&capture.beside("out"), &[]), "mtllib");
    assert_refused(&output, 1, &["scene.obj:1", "100000 words", "at most 1000"]);
    let uses: String = (0..5000).map(|i| format!("usemtl m{i}\nf 1 2 3\n")).collect();
    capture.write("scene.obj", format!("{SCENE}{uses}"));
    capture.write("trajectory.tum", "nothing\n");
    let output = under_watch(capture.command(&capture.beside("out"), &[]), "usemtl");
    assert_refused(&output, 1, &["trajectory.tum", "4990 more warnings"]);
    assert!(said(&output).lines().count() < 20, "{}", said(&output));
}

/// M1: a small file that unfolds to much is refused by the size it states.
#[test]
fn a_picture_that_unfolds_to_much_is_refused_by_its_header() {
    let capture = Capture::new();
    // The header of a PNG of 16000x16000 px, one bit each, and no data behind it.
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    png.extend([0, 0, 0x3e, 0x80, 0, 0, 0x3e, 0x80, 1, 0, 0, 0, 0]);
    png.extend(crc32(&png[12..]).to_be_bytes());
    png.extend(b"\0\0\0\0IDAT\x35\xaf\x06\x1e\0\0\0\0IEND\xae\x42\x60\x82");
    capture.write("wall.png", png);
    capture.write("colours.mtl", format!("{MATERIALS}map_Kd wall.png\n"));
    let output = capture.simulate(&capture.beside("out"), &[]);
    assert_refused(&output, 1, &["wall.png", "16000x16000 px", "134217728 px"]);
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
    })
}

/// N3: JPEGs that were cut off, as textures and as frames to calibrate from.
#[test]
fn a_jpeg_that_was_cut_off_is_refused_wherever_it_is_read() {
    let capture = Capture::new();
    let picture = image::RgbImage::from_fn(96, 96, |x, y| image::Rgb([x as u8, y as u8, (x * y) as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
    let bytes = bytes.into_inner();
    capture.write("wall.jpg", &bytes[..bytes.len() / 2]);
    capture.write("colours.mtl", format!("{MATERIALS}map_Kd wall.jpg\n"));
    assert_refused(&capture.simulate(&capture.beside("out"), &[]), 1, &["wall.jpg", "cut off"]);
    let frame = capture.root().join("wall.jpg");
    let mut calibrate = shutterbug();
    calibrate.args(["calibrate", "noise"]).args([&frame, &frame]).arg("--out").arg(capture.beside("noise"));
    assert_refused(&calibrate.output().unwrap(), 1, &["wall.jpg", "cut off"]);
}

/// N4: as for trajectories.
#[test]
fn vertices_beyond_what_can_be_drawn_are_refused() {
    let capture = Capture::new();
    for (far, line) in [("1.1e9", 3), ("-3e38", 3)] {
        capture.write("scene.obj", SCENE.replacen("v 3 -4 -4", &format!("v 3 {far} -4"), 1));
        let output = capture.simulate(&capture.beside("out"), &[]);
        assert_refused(&output, 1, &[&format!("scene.obj:{line}"), "at most 1e9"]);
    }
}

/// N6: a camera of another size than the frames.
#[test]
fn noise_of_frames_of_another_size_than_the_camera_is_refused() {
    let capture = Capture::new();
    let frames: Vec<_> = (0..2u8)
        .map(|i| {
            let path = capture.beside(&format!("{i}.png"));
            image::RgbImage::from_fn(96, 96, |x, y| image::Rgb([(x + y) as u8, y as u8, 90 + i]))
                .save(&path)
                .unwrap();
            path
        })
        .collect();
    let mut calibrate = shutterbug();
    calibrate.args(["calibrate", "noise"]).args(&frames).arg("--out").arg(capture.beside("noise"));
    calibrate.arg("--camera").arg(capture.root().join("camera.toml"));
    assert_refused(&calibrate.output().unwrap(), 1, &["0.png", "96x96 px", "32x24 px"]);
}

/// R1, as SECURITY.md has it: a capture's own files may be links that lead out, what these name may not.
#[test]
fn links_that_lead_out_of_a_capture() {
    let linked = |name: &str, text: &str| {
        let capture = Capture::new();
        let elsewhere = capture.beside("elsewhere");
        fs::write(&elsewhere, text).unwrap();
        let _ = fs::remove_file(capture.root().join(name));
        std::os::unix::fs::symlink(&elsewhere, capture.root().join(name)).unwrap();
        capture.simulate(&capture.beside("out"), &["--device", "none of that name"])
    };
    // Read without a word: what is missed is the device.
    assert_refused(&linked("camera.toml", CAMERA), 1, &["no Vulkan device"]);
    assert_refused(&linked("frames.csv", &frames_csv(2)), 1, &["no Vulkan device"]);
    for (name, text) in [("scene.obj", SCENE), ("colours.mtl", MATERIALS)] {
        assert_refused(&linked(name, text), 1, &[name, "expected a file inside"]);
    }
}
