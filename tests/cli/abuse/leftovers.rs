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
