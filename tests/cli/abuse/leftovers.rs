//! What the seventh blind set had found and was left over: gaps in poses and frames in which nothing is seen.

use super::*;

/// Poses every 0.04 s from -0.08 s to `last`, but for those of some steps.
fn poses(lost: std::ops::Range<i32>) -> String {
    (-2..40)
        .filter(|i| !lost.contains(i))
        .map(|i| format!("{} 0 {} 0 0.5 -0.5 0.5 -0.5\n", 10.0 + 0.04 * f64::from(i), 0.02 * f64::from(i)))
        .collect()
}

#[test]
fn a_gap_in_the_poses_is_said_with_line_seconds_and_frames() {
    if !device_is_there("a_gap_in_the_poses_is_said_with_line_seconds_and_frames") {
        return;
    }
    let capture = Capture::new();
    capture.write("frames.csv", frames_csv(16));
    capture.write("trajectory.tum", poses(3..9));
    let made = capture.simulate(&capture.beside("made"), &[]);
    assert_done(&made);
    // Five poses stand before the gap, which frames 3 to 8 start in or at its end; frame 2 ends where it begins.
    for word in ["trajectory.tum:6: no pose for 0.280 s", "every 0.040 s", "(000003.png to 000008.png)"] {
        assert!(said(&made).contains(word), "{word}: {}", said(&made));
    }
    fs::rename(capture.beside("made"), capture.root().join("real")).unwrap();
    let diagnosed = diagnose(&capture, "gap");
    let warnings = diagnosed["warnings"].to_string();
    // A frame's shutter is sought up to its period: frame 2 may reach into the gap.
    assert!(warnings.contains("trajectory.tum:6: no pose for 0.280 s"), "{warnings}");
    assert!(warnings.contains("frames 2 to 8"), "{warnings}");

    capture.write("trajectory.tum", poses(0..0));
    let whole = capture.simulate(&capture.beside("whole"), &[]);
    assert_done(&whole);
    assert!(!said(&whole).contains("no pose"), "control: {}", said(&whole));
    // Nobody was photographed meanwhile.
    capture.write("trajectory.tum", poses(20..30));
    let beside = capture.simulate(&capture.beside("beside"), &[]);
    assert!(!said(&beside).contains("no pose"), "no frame falls into it: {}", said(&beside));
}

/// The report of a diagnosis that ends at once: what was read stands in it.
fn diagnose(capture: &Capture, out: &str) -> serde_json::Value {
    let out = capture.beside(out);
    let mut command = shutterbug();
    command.arg("diagnose").arg(capture.root()).arg("--out").arg(&out).args(["--time-limit-s", "1"]);
    assert_done(&command.output().unwrap());
    serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap()
}

/// Noise is no scene: a frame is named by what the sensor delivers in the dark.
#[test]
fn frames_in_which_nothing_is_seen_are_named() {
    if !device_is_there("frames_in_which_nothing_is_seen_are_named") {
        return;
    }
    let capture = Capture::new();
    let camera = format!("{CAMERA}[read_noise]\nsigma = 0.01\n");
    capture.write("camera.toml", &camera);
    // From frame 2 on the camera looks along -x, away from the wall.
    let turned: String = (-2..12)
        .map(|i| {
            let looks = if i < 2 { "0.5 -0.5 0.5 -0.5" } else { "0.5 0.5 -0.5 -0.5" };
            format!("{} 0 0 0 {looks}\n", 10.0 + 0.04 * f64::from(i))
        })
        .collect();
    capture.write("trajectory.tum", &turned);
    let made = capture.simulate(&capture.beside("made"), &[]);
    assert_done(&made);
    let words = ["nothing of the scene is seen in 2 of 4 frames", "frame 2 (000002), frame 3 (000003)"];
    words.iter().for_each(|word| assert!(said(&made).contains(word), "{word}: {}", said(&made)));
    // Control: a camera that sees the wall in all frames.
    let seeing = turned.replace("0.5 0.5 -0.5 -0.5", "0.5 -0.5 0.5 -0.5");
    capture.write("trajectory.tum", seeing);
    let seen = capture.simulate(&capture.beside("seen"), &[]);
    assert_done(&seen);
    assert!(!said(&seen).contains("nothing of the scene"), "{}", said(&seen));
}

/// Times in other units than the files have: named where the poses do not reach and where two of them bridge all.
#[test]
fn times_in_another_unit_are_named() {
    let capture = Capture::new();
    let seconds: String = (0..4).map(|i| format!("{},{i:06}.png\n", 10 + i)).collect();
    capture.write("frames.csv", seconds);
    let short = capture.simulate(&capture.beside("out"), &[]);
    assert_refused(
        &short,
        1,
        &["trajectory.tum", "timestamps of frames.csv (ns) in s, or these times (s) in ns?"],
    );
    assert!(said(&short).contains("are the timestamps in s, not in ns?"), "{}", said(&short));
    // Poses of nanoseconds: the frames of the first seconds lie between the first two.
    let from_zero: String =
        (0..4).map(|i| format!("{},{i:06}.png\n", 1_000_000 + 40_000_000 * u64::from(i as u32))).collect();
    capture.write("frames.csv", from_zero);
    let nanoseconds: String =
        (0..8).map(|i| format!("{} 0 0 0 0.5 -0.5 0.5 -0.5\n", 40_000_000 * u64::from(i as u32))).collect();
    capture.write("trajectory.tum", nanoseconds);
    let bridged = capture.simulate(&capture.beside("out"), &["--device", "no such device"]);
    assert!(said(&bridged).contains("all frames lie between two of its poses"), "{}", said(&bridged));
}

/// What would be ignored is refused: clap does not ask for an option that conflicts with one that is there.
#[test]
fn options_of_another_form_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let form = |words: &[&str]| {
        let output = shutterbug().args(words).arg("--out").arg(&out).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{words:?}: {}", said(&output));
        assert!(!out.exists(), "{words:?}");
    };
    form(&["withhold", "--points", "3"]);
    form(&["withhold", "--points", "3", "--count", "1"]);
    form(&["withhold", "--repeats", "3", "--only", "1"]);
    form(&["diagnose", "capture", "--distance", "fid {a} {b}"]);
    form(&["diagnose", "--sim", "a", "--real", "b", "--match", "c", "--distance", "fid {a} {b}"]);
}

/// Two files of one frame are not two frames.
#[test]
fn a_picture_beside_another_of_its_name_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let made = |name: &str, ending: &str| {
        let path = folder.path().join(name);
        fs::create_dir_all(&path).unwrap();
        for i in 0..6u32 {
            let picture = image::RgbImage::from_fn(48, 40, |x, y| image::Rgb([(x * 3 + y * 5 + i) as u8; 3]));
            picture.save(path.join(format!("{i:06}.{ending}"))).unwrap();
        }
        path
    };
    let (sim, real) = (made("sim", "png"), made("real", "png"));
    made("real", "jpg");
    for form in [&["--unpaired"][..], &[]] {
        let mut command = shutterbug();
        command.arg("diagnose").arg("--sim").arg(&sim).arg("--real").arg(&real).args(form);
        let output = command.arg("--out").arg(folder.path().join("out")).output().unwrap();
        assert_refused(&output, 1, &["real: found 000000.jpg and 000000.png", "one picture a frame"]);
    }
}

/// Pairs have no background: what leaves nothing to compare is named.
#[test]
fn pairs_of_which_nothing_can_be_compared_are_refused_by_their_own_cause() {
    let folder = tempfile::tempdir().unwrap();
    let made = |name: &str, white: bool| {
        let path = folder.path().join(name);
        fs::create_dir_all(&path).unwrap();
        for i in 0..6u32 {
            let value = |x: u32, y: u32| if white { 255 } else { (20 + (x * 3 + y * 5 + i) % 200) as u8 };
            let picture = image::RgbImage::from_fn(48, 40, |x, y| image::Rgb([value(x, y); 3]));
            picture.save(path.join(format!("{i:06}.png"))).unwrap();
        }
        path
    };
    let (sim, real) = (made("sim", true), made("real", false));
    // Depth and poses say that they are of one place.
    let pose = |t: u32| format!("{t} 0 0 0 0 0 0 1\n");
    fs::write(sim.join("trajectory.tum"), pose(0) + &pose(1)).unwrap();
    let depth =
        ::shutterbug::plane::Plane { width: 48, height: 40, channels: 1, data: vec![2.0f32; 48 * 40] };
    fs::create_dir(sim.join("depth")).unwrap();
    for i in 0..6 {
        let path = sim.join(format!("depth/{i:06}.exr"));
        ::shutterbug::plane::write_exr_plane(&path, &depth, &["Z"]).unwrap();
    }
    let mut command = shutterbug();
    command.arg("diagnose").arg("--sim").arg(&sim).arg("--real").arg(&real);
    let output = command.arg("--out").arg(folder.path().join("out")).output().unwrap();
    assert_refused(&output, 1, &["simulated values at white"]);
    assert!(!said(&output).contains("background"), "{}", said(&output));
}
