//! What is read of other tools' cameras, what is said about the rest, and what is refused.

use glam::DVec3;
use proptest::prelude::*;

use super::*;
use shutterbug::camera::{Distortion, Lens};
use shutterbug::effects::RollingShutter;

#[test]
fn pixel_centres_move_by_half_a_pixel() {
    let camera = read(ROS).camera;
    // A point that OpenCV's formula puts on the centre of its pixel (400, 300) must fall on the centre of that pixel
    // here too, which is at (400.5, 300.5).
    let (x, y) = ((400.0 - 315.25) / 580.5, (300.0 - 247.5) / 576.75);
    let px = camera.intrinsics.project(DVec3::new(2.0 * x, 2.0 * y, 2.0)).expect("in front");
    assert!((px.x - 400.5).abs() < 1e-9 && (px.y - 300.5).abs() < 1e-9, "{px}");
    for (text, cx, cy) in [(ROS, 315.75, 248.0), (KALIBR, 363.1, 246.5), (EUROC, 367.715, 248.875)] {
        let k = read(text).camera.intrinsics;
        assert!((k.cx - cx).abs() < 1e-9 && (k.cy - cy).abs() < 1e-9, "{k:?}");
    }
}

#[test]
fn a_ros_file_is_read() {
    let Imported { camera, notes } = read(ROS);
    assert_eq!((camera.name.as_str(), camera.intrinsics.width, camera.intrinsics.height), ("head", 640, 480));
    assert_eq!((camera.intrinsics.fx, camera.intrinsics.fy), (580.5, 576.75));
    let lens = Distortion::BrownConrady { k: [-0.25, 0.08, 0.01], p: [0.002, -0.001] };
    assert_eq!(camera.distortion, lens);
    assert_eq!((camera.rate_hz, camera.line_delay_s()), (None, None));
    assert!(notes.is_empty(), "{notes:?}");
}

#[test]
fn a_ros_message_is_the_same_camera() {
    let message = "header:\n  seq: 1\n  stamp: {secs: 1, nsecs: 2}\n  frame_id: head\nheight: 480\nwidth: 640\n\
        distortion_model: \"plumb_bob\"\nD: [-0.25, 0.08, 0.002, -0.001, 0.01]\n\
        K: [580.5, 0.0, 315.25, 0.0, 576.75, 247.5, 0.0, 0.0, 1.0]\nR: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n\
        P: [580.5, 0.0, 315.25, 0.0, 0.0, 576.75, 247.5, 0.0, 0.0, 0.0, 1.0, 0.0]\nbinning_x: 0\nbinning_y: 0\n\
        roi: \n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: False\n---\n";
    for text in [
        message.to_owned(),
        message.replace("D:", "d:").replace("K:", "k:").replace("R:", "r:").replace("P:", "p:"),
    ] {
        let Imported { camera, notes } = read(&text);
        let file = read(ROS).camera;
        assert_eq!((camera.intrinsics, camera.distortion), (file.intrinsics, file.distortion));
        assert!(notes.iter().all(|n| n.contains("further YAML")), "{notes:?}");
    }
}

#[test]
fn what_ros_says_and_has_no_place_is_said() {
    let text = ROS.replace("[580.5, 0., 315.25, 0., 576.75", "[580.5, 0.5, 315.25, 0., 576.75")
        + "binning_x: 2\nbinning_y: 1\nroi: {x_offset: 8, y_offset: 0, width: 320, height: 240}\nlens_maker: Acme\n";
    let text = text.replace("[1., 0., 0., 0., 1., 0., 0., 0., 1.]", "[1., 0., 0.01, 0., 1., 0., 0., 0., 1.]");
    let notes = read(&text).notes;
    for said in [
        "skew 0.5 px",
        "rectification_matrix",
        "projection_matrix",
        "binning_x = 2",
        "320x240 at (8, 0)",
        "`lens_maker`",
    ] {
        assert!(notes.iter().any(|n| n.contains(said)), "{said}: {notes:#?}");
    }
    assert_eq!(notes.len(), 6, "{notes:#?}");
}

#[test]
fn a_rational_lens_is_read_as_it_is_and_a_thin_prism_is_fitted() {
    // k4 = 0.3 with k1 = 0.2: the quotient is a barrel of some -0.1, the first coefficient alone a pincushion.
    let text = ROS.replace("plumb_bob", "rational_polynomial").replace("cols: 5", "cols: 8");
    let text =
        text.replace("[-0.25, 0.08, 0.002, -0.001, 0.01]", "[0.2, 0.01, 0.0, 0.0, 0.0, 0.3, 0.02, 0.0]");
    let Imported { camera, notes } = read(&text);
    assert!(notes.is_empty(), "{notes:?}");
    assert_eq!(camera.distortion, Distortion::Rational { k: [0.2, 0.01, 0.0, 0.3, 0.02, 0.0], p: [0.0; 2] });

    // s1 to s4 are zero but one, which is almost that.
    let prism = text
        .replace("0.3, 0.02, 0.0]", "0.3, 0.02, 0.0, 1e-9, 0.0, 0.0, 0.0]")
        .replace("cols: 8", "cols: 12");
    let Imported { camera, notes } = read(&prism);
    assert!(notes.len() == 1 && notes[0].contains("thin prism") && notes[0].contains("px off"), "{notes:?}");
    let error_px = |lens: Distortion, x: f64, y: f64| {
        let s: f64 = x * x + y * y;
        let quotient = (1.0 + 0.2 * s + 0.01 * s * s) / (1.0 + 0.3 * s + 0.02 * s * s);
        let got = lens.distort(glam::DVec2::new(x, y));
        580.5 * (got.x - x * quotient).hypot(got.y - y * quotient)
    };
    let cut = Distortion::BrownConrady { k: [0.2, 0.01, 0.0], p: [0.0; 2] };
    for (x, y) in [(0.3, 0.1), (-0.5, 0.4), (0.55, -0.42)] {
        assert!(error_px(camera.distortion, x, y) < 0.05, "{}", error_px(camera.distortion, x, y));
        // Control: what dropping k4 to k6 silently would have done.
        assert!(error_px(cut, x, y) > 1.0, "{}", error_px(cut, x, y));
    }
    let zeros = text.replace("0.3, 0.02, 0.0]", "0.0, 0.0, 0.0]");
    assert!(read(&zeros).notes.is_empty());
}

#[test]
fn kalibr_cameras_are_read_by_name() {
    let Imported { camera, notes } = read(KALIBR);
    assert_eq!(camera.name, "cam0");
    assert_eq!(camera.distortion, Distortion::BrownConrady { k: [-0.27, 0.066, 0.0], p: [0.0008, 0.0001] });
    // The readout is N times the delay of a row.
    assert!((RollingShutter::readout_time_s(&camera.settings) - 480.0 * 2.5e-5).abs() < 1e-15);
    assert_eq!(RollingShutter::scan_order(&camera.settings).name(), "top_to_bottom");
    // T_cam_imu takes IMU to camera: its inverse takes the camera's origin to where it sits on the IMU.
    let body = camera.body_from_camera.expect("given");
    let origin = body.transform(DVec3::ZERO);
    assert!((origin - DVec3::new(-0.02, -0.07, -0.004)).length() < 1e-12, "{origin}");
    for said in ["`cam1`", "timeshift_cam_imu = -0.000081 s"] {
        assert!(notes.iter().any(|n| n.contains(said)), "{said}: {notes:#?}");
    }
    assert_eq!(notes.len(), 2, "{notes:#?}");
    let turned = read(&KALIBR.replace("[752, 480]", "[480, 752]")).notes;
    assert!(turned.iter().any(|n| n.contains("exchanged")), "{turned:#?}");
    let Imported { camera, notes } = kalibr(KALIBR, "cam1");
    assert_eq!(camera.distortion, Distortion::Equidistant { k: [-0.01, 0.02, -0.01, 0.002] });
    assert_eq!(camera.line_delay_s(), None);
    assert!(notes.iter().any(|n| n.contains("T_cn_cnm1")), "{notes:#?}");
}

#[test]
fn a_euroc_sensor_is_read() {
    let Imported { camera, notes } = read(EUROC);
    assert_eq!((camera.rate_hz, camera.intrinsics.width), (Some(20.0), 752));
    assert_eq!(camera.distortion, Distortion::BrownConrady { k: [-0.28, 0.074, 0.0], p: [0.00019, 1.76e-5] });
    let ahead = camera.body_from_camera.expect("given").transform(DVec3::new(1.0, 0.0, 0.0));
    assert!((ahead - DVec3::new(-0.02, 0.94, 0.01)).length() < 1e-12, "{ahead}");
    assert!(notes.is_empty(), "{notes:?}");
}

/// A text, what of it is replaced by what, and what is then said.
const REFUSED: &[(&str, &str, &str, &str)] = &[
    (
        ROS,
        "image_width: 640",
        "image_width: 0",
        "c.yaml:1: found image_width = 0; expected a whole number of px, 1 to 16384",
    ),
    (ROS, "image_height: 480", "image_hight: 480", "is `image_hight` meant to be it?"),
    (
        ROS,
        "580.5, 0., 315.25, 0., 576.75",
        "0., 0., 315.25, 0., 0.",
        "c.yaml:4: found fx = 0 in camera_matrix",
    ),
    (
        ROS,
        "plumb_bob",
        "plump_bob",
        "c.yaml:8: unknown distortion_model `plump_bob`; did you mean `plumb_bob`?",
    ),
    (
        ROS,
        "-0.25,",
        "-0.25, 0.1, 0.1, 0.1,",
        "found 8 numbers in distortion_coefficients.data; expected 1 rows of 5",
    ),
    (ROS, "0.01]", "nan]", "c.yaml:12: found distortion_coefficients.data = nan"),
    (ROS, "0., 0., 1.]\ndist", "0., 0., 2.]\ndist", "zeros below the diagonal"),
    (ROS, "-0.25, 0.08", "-0.9, 0.08", "c.yaml:9: the lens (k1 = -0.9, k2 = 0.08"),
    (
        KALIBR,
        "camera_model: pinhole",
        "camera_model: omni",
        "c.yaml:3: found cam0.camera_model = omni; expected pinhole",
    ),
    (KALIBR, "distortion_model: radtan", "distortion_model: fov", "radtan, equidistant or none"),
    (KALIBR, "line_delay: 2.5e-05", "line_delay: 25000", "is it in ns?"),
    (
        KALIBR,
        "line_delay: 2.5e-05",
        "line_delay: -1",
        "rolling_shutter.readout_time_s = -480 s is outside 0 to 1 s",
    ),
    (
        KALIBR,
        "[461.6, 460.1, 362.6, 246.0]",
        "[461.6, 460.1, 362.6]",
        "c.yaml:6: found cam0.intrinsics of 3 numbers",
    ),
    (KALIBR, "[752, 480]", "[752.5, 480]", "found cam0.resolution = [752.5, 480.0]"),
    (KALIBR, "[0.0, 1.0, 0.0, 0.07]", "[0.0, 1.1, 0.0, 0.07]", "orthonormal"),
    (KALIBR, "[0.0, 1.0, 0.0, 0.07]", "[0.0, -1.0, 0.0, 0.07]", "mirrors"),
    (
        EUROC,
        "sensor_type: camera",
        "sensor_type: imu",
        "c.yaml:2: found sensor_type = imu; expected `camera`",
    ),
    (
        EUROC,
        "rate_hz: 20",
        "rate_hz: 0",
        "c.yaml:13: found rate_hz = 0; expected a number, 0.00001 to 1000000 Hz",
    ),
    (EUROC, "0.0, 0.0, 0.0, 1.0]", "0.0, 0.0, 0.1, 1.0]", "last row 0 0 0 1"),
];

#[test]
fn what_cannot_be_a_camera_is_refused_with_file_line_and_reason() {
    for (text, from, to, want) in REFUSED {
        let changed = text.replacen(from, to, 1);
        assert_ne!(&changed, text, "{from}");
        let error = refused(&changed);
        assert!(error.contains(want), "{from} -> {to}: {error}");
    }
    assert!(refused("a: 1\n").contains("YAML of no known format (keys: a)"));
    let error =
        parse_camera(Path::new("c.yaml"), KALIBR, None, Some("cam2")).expect_err("two cameras").to_string();
    assert!(error.contains("unknown camera `cam2`; did you mean `cam"), "{error}");
    assert!(parse_camera(Path::new("c.yaml"), ROS, None, Some("cam0")).is_err());
    assert!(parse_camera(Path::new("c.yaml"), ROS, Some(Format::Sdf), None).is_err());
}

#[test]
fn an_imported_lens_is_known_to_be_invertible() {
    for text in [ROS, KALIBR, EUROC] {
        let camera = read(text).camera;
        assert!(Lens::new(camera.intrinsics, camera.distortion).is_ok());
    }
}

/// A text with some bytes changed, cut or doubled.
fn damaged(text: &'static str) -> impl Strategy<Value = String> {
    let edits = proptest::collection::vec((0..text.len(), "[\\PC\n]{0,6}", 0usize..12), 1..4);
    edits.prop_map(move |edits| {
        let mut chars: Vec<char> = text.chars().collect();
        for (at, new, cut) in edits {
            let at = at.min(chars.len());
            let end = (at + cut).min(chars.len());
            chars.splice(at..end, new.chars());
        }
        chars.into_iter().collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn no_damage_makes_a_parser_panic(text in prop_oneof![damaged(ROS), damaged(KALIBR), damaged(EUROC)]) {
        if let Err(error) = parse_camera(Path::new("c.yaml"), &text, None, None) {
            let message = error.to_string();
            prop_assert!(message.starts_with("c.yaml") && !message.contains('\n'), "{}", message);
        }
    }
}
