//! What is written for other tools, and what is said to be missing in it.

use proptest::prelude::*;

use super::*;
use crate::formats::{CameraModel, write_camera};
use shutterbug::camera::{Distortion, Intrinsics};
use shutterbug::capture::CameraFile;
use shutterbug::chain::Value;
use shutterbug::effects::{MotionBlur, PaperNoise, RollingShutter};

const K: Intrinsics = Intrinsics { width: 640, height: 480, fx: 580.5, fy: 576.75, cx: 315.75, cy: 248.0 };

fn camera() -> CameraModel {
    let mut camera = CameraModel::new("head \"cam\" <1>", K);
    camera.distortion = Distortion::BrownConrady { k: [-0.25, 0.08, 0.0], p: [0.002, -0.001] };
    camera.rate_hz = Some(30.0);
    camera.set_line_delay_s(6.5e-5).expect("in range");
    camera.settings.set(&MotionBlur, "exposure_time_s", Value::Number(0.01)).expect("in range");
    camera.settings.set(&PaperNoise, "color_variance_g", Value::Number(3e-4)).expect("in range");
    camera.settings.set(&PaperNoise, "edge_variance_g", Value::Number(1e-2)).expect("in range");
    camera
}

fn written(camera: &CameraModel, format: Format) -> (String, Vec<String>) {
    write_camera(camera, format, Path::new("out"), None).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn each_target_says_what_it_cannot_hold() {
    for (format, missing) in [
        (Format::Ros, &["rolling_shutter", "motion_blur", "paper_noise", "frame rate"][..]),
        (Format::Kalibr, &["motion_blur", "paper_noise", "frame rate"]),
        (Format::Euroc, &["rolling_shutter", "motion_blur", "paper_noise", "T_BS"]),
        (
            Format::Sdf,
            &["rolling_shutter", "motion_blur", "paper_noise (edge parts", "displayed value", "Classic"],
        ),
    ] {
        let (text, notes) = written(&camera(), format);
        for word in missing {
            assert_eq!(notes.iter().filter(|n| n.contains(word)).count(), 1, "{format:?} {word}: {notes:#?}");
        }
        assert_eq!(notes.len(), missing.len(), "{format:?}: {notes:#?}");
        // The same stands in the file.
        for note in &notes {
            assert!(text.contains(note.as_str()), "{note} in {text}");
        }
    }
    // Control: a camera that a target holds wholly has nothing to say.
    let plain = CameraModel::new("c", K);
    for format in [Format::Ros, Format::Kalibr] {
        assert!(written(&plain, format).1.is_empty(), "{format:?}");
    }
}

#[test]
fn scan_orders_that_kalibr_cannot_hold_are_said() {
    let mut camera = camera();
    camera.settings.set(&RollingShutter, "scan_order", Value::Choice("left_to_right")).expect("an option");
    let (text, notes) = written(&camera, Format::Kalibr);
    assert!(!text.contains("line_delay:") && notes.iter().any(|n| n.contains("left_to_right")), "{notes:?}");
}

#[test]
fn the_third_radial_coefficient_is_said_where_there_are_two() {
    let mut camera = camera();
    camera.distortion = Distortion::BrownConrady { k: [-0.25, 0.08, 0.01], p: [0.0; 2] };
    for (format, said) in [(Format::Kalibr, 1), (Format::Euroc, 1), (Format::Ros, 0), (Format::Sdf, 0)] {
        let notes = written(&camera, format).1;
        assert_eq!(notes.iter().filter(|n| n.contains("k3 = 0.01")).count(), said, "{format:?}");
    }
}

#[test]
fn sdf_is_well_formed_and_gazebos() {
    let mut camera = camera();
    camera.name = "a--b & <c> \"d\"".to_owned();
    let (text, _) = written(&camera, Format::Sdf);
    assert_eq!(open_tags(&text), Ok(Vec::new()), "{text}");
    // 2 atan(320 / 580.5)
    let fov: f64 = between(&text, "<horizontal_fov>").parse().expect("a number");
    assert!((fov - 1.007_603_1).abs() < 1e-6, "{fov}");
    for (tag, want) in
        [("<k1>", "-0.25"), ("<p1>", "0.002"), ("<p2>", "-0.001"), ("<cx>", "315.75"), ("<fy>", "576.75")]
    {
        assert_eq!(between(&text, tag), want);
    }
    assert_eq!((between(&text, "<width>"), between(&text, "<update_rate>")), ("640", "30.0"));
    assert!(text.contains("name=\"a--b &amp; &lt;c&gt; &quot;d&quot;\""), "{text}");
    // sqrt(3e-4 / 3) = 0.01 linear, times the slope 1.1240 of sRGB at 0.2.
    let stddev: f64 = between(&text, "<stddev>").parse().expect("a number");
    assert!((stddev - 0.011_24).abs() < 2e-5, "{stddev}");
    // Control: the checker does find a tag left open.
    assert_ne!(open_tags(&text.replace("</clip>", "")), Ok(Vec::new()));
    let quiet = CameraModel::new("c", K);
    let (text, _) = written(&quiet, Format::Sdf);
    assert!(!text.contains("<noise>") && !text.contains("<distortion>") && !text.contains("<update_rate>"));
}

fn between<'a>(text: &'a str, tag: &str) -> &'a str {
    let start = text.find(tag).unwrap_or_else(|| panic!("no {tag} in {text}")) + tag.len();
    &text[start..start + text[start..].find('<').expect("closed")]
}

/// Tags left open, or what is wrong with the text.
fn open_tags(xml: &str) -> Result<Vec<String>, String> {
    let (mut open, mut rest) = (Vec::new(), xml);
    while let Some(start) = rest.find('<') {
        rest = &rest[start..];
        if let Some(comment) = rest.strip_prefix("<!--") {
            let end = comment.find("--").ok_or("a comment without end")?;
            rest = comment[end..].strip_prefix("-->").ok_or("a double hyphen in a comment")?;
            continue;
        }
        let end = rest.find('>').ok_or("a tag without end")?;
        let tag = &rest[1..end];
        match tag.strip_prefix('/') {
            Some(name) if open.last().map(String::as_str) == Some(name) => {
                open.pop();
            }
            Some(name) => return Err(format!("</{name}> closes {open:?}")),
            None => open.push(tag.split(' ').next().unwrap_or_default().to_owned()),
        }
        rest = &rest[end + 1..];
    }
    Ok(open)
}

#[test]
fn camera_toml_needs_a_frame_rate() {
    let mut camera = camera();
    camera.rate_hz = None;
    let error =
        write_camera(&camera, Format::Toml, Path::new("o.toml"), None).expect_err("no rate").to_string();
    assert!(error.starts_with("o.toml: found no frame rate") && error.contains("--rate-hz"), "{error}");
    let (text, _) = write_camera(&camera, Format::Toml, Path::new("o.toml"), Some(25.0)).expect("a rate");
    let back = CameraFile::parse(Path::new("o.toml"), &text).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((back.frame_period_s, back.intrinsics), (0.04, K));
    let again = CameraModel::from_camera_file(&back);
    assert_eq!(again.settings, camera.settings);
    // The lens is there, or it is said that it is not.
    let lens_there = again.distortion == camera.distortion;
    assert!(lens_there || text.contains("# the lens (k1 = -0.25"), "{text}");
}

#[test]
fn a_lens_profile_keeps_every_model_but_division_to_the_last_bit() {
    let k = Intrinsics { width: 3840, height: 2160, fx: 4540.9, fy: 4543.03, cx: 1930.2, cy: 1053.6 };
    for lens in [
        Distortion::None,
        Distortion::BrownConrady { k: [-0.1, 0.02, 0.001], p: [0.002, -0.001] },
        Distortion::Equidistant { k: [0.0417, 0.0005, 0.008, -0.0078] },
        Distortion::Rational { k: [0.52, -0.03, 0.002, 0.9, 0.1, 0.01], p: [0.001, -0.002] },
        Distortion::Division { k1: -0.2 },
    ] {
        let mut camera = CameraModel::new("camera", k);
        camera.distortion = lens;
        camera.rate_hz = Some(30_000.0 / 1001.0);
        camera.settings.set(&RollingShutter, "readout_time_s", Value::Number(0.0166)).expect("in range");
        camera.settings.set(&RollingShutter, "scan_order", Value::Choice("bottom_to_top")).expect("one");
        let (text, notes) = written(&camera, Format::Gyroflow);
        let back = parse_camera(Path::new("lens.json"), &text, None, None).expect(&text);
        assert!(back.notes.is_empty(), "{:?}", back.notes);
        if let Distortion::Division { .. } = lens {
            assert!(notes.len() == 1 && notes[0].contains("division k1 = -0.2"), "{notes:?}");
            assert!(text.contains(&notes[0]), "said in the file too");
            camera.distortion = Distortion::None;
        } else {
            assert!(notes.is_empty(), "{notes:?}");
        }
        let (readout, readout_s) =
            (camera.settings.clone(), RollingShutter::readout_time_s(&back.camera.settings));
        assert!((readout_s - 0.0166).abs() < 1e-15);
        assert_eq!(RollingShutter::scan_order(&back.camera.settings).name(), "bottom_to_top");
        assert_eq!(CameraModel { settings: readout, ..back.camera }, camera, "{text}");
    }
    // An error that no lens of the model has is said, one of ordinary profiles is not.
    let (text, _) = written(&CameraModel::new("camera", k), Format::Gyroflow);
    let with = |rms: &str| {
        let text = text.replace("\"camera_matrix\"", &format!("\"RMS_error\": {rms}, \"camera_matrix\""));
        parse_camera(Path::new("lens.json"), &text, None, None).expect("a profile").notes
    };
    assert!(with("12.0").iter().any(|n| n.contains("by 12 px")), "{:?}", with("12.0"));
    assert_eq!(with("0.9").len() + 1, with("12.0").len(), "control");
    // Control: another program's model is refused by name, not read as one of these.
    let (text, _) = written(&CameraModel::new("camera", k), Format::Gyroflow);
    let other = text.replace("opencv_standard", "poly5");
    let error = parse_camera(Path::new("lens.json"), &other, None, None).expect_err("unknown").to_string();
    assert!(error.contains("lens.json:") && error.contains("unknown distortion_model `poly5`"), "{error}");
}

fn any_camera() -> impl Strategy<Value = CameraModel> {
    let numbers = (100.0..3000.0f64, 100.0..3000.0f64, 0.0..640.0f64, 0.0..480.0f64);
    let lens = prop_oneof![
        Just(Distortion::None),
        ([-0.05..0.05f64, -0.02..0.02], [-0.002..0.002f64, -0.002..0.002])
            .prop_map(|(k, p)| Distortion::BrownConrady { k: [k[0], k[1], 0.0], p }),
        [-0.05..0.05f64, -0.02..0.02, -0.01..0.01, -0.01..0.01].prop_map(|k| Distortion::Equidistant { k }),
    ];
    (numbers, lens, "\\PC{0,12}", 1e-6..1e-3f64).prop_map(|((fx, fy, cx, cy), distortion, name, delay_s)| {
        let mut camera = CameraModel::new(name, Intrinsics { width: 640, height: 480, fx, fy, cx, cy });
        camera.distortion = distortion;
        camera.rate_hz = Some(30.0);
        camera.set_line_delay_s(delay_s).expect("in range");
        camera
    })
}

proptest! {
    #[test]
    fn what_is_written_reads_back(camera in any_camera()) {
        prop_assume!(camera.check_lens().is_ok());
        for format in [Format::Ros, Format::Kalibr, Format::Euroc, Format::Gyroflow] {
            let (text, _) = written(&camera, format);
            let back = parse_camera(Path::new("c.yaml"), &text, None, None);
            prop_assert!(back.is_ok(), "{format:?}: {:?} in {text}", back.err().map(|e| e.to_string()));
            let back = back.expect("checked").camera;
            let (k, b) = (camera.intrinsics, back.intrinsics);
            prop_assert_eq!((k.fx, k.fy, k.width, k.height), (b.fx, b.fy, b.width, b.height));
            prop_assert!((k.cx - b.cx).abs() < 1e-12 && (k.cy - b.cy).abs() < 1e-12);
            prop_assert_eq!(camera.distortion, back.distortion);
            if format == Format::Kalibr {
                let (had, has) = (camera.line_delay_s(), back.line_delay_s());
                prop_assert!((had.expect("set") - has.expect("read")).abs() < 1e-18);
            }
            if format == Format::Ros {
                prop_assert_eq!(&camera.name, &back.name);
            }
        }
    }
}
