//! What `camera.toml` cannot say.

use std::path::Path;

use shutterbug::capture::CameraFile;

use super::{CAMERA, Fixture};

#[test]
fn names_that_camera_toml_does_not_know() {
    for (from, to, error) in [
        ("width", "widht", "camera.toml:1: unknown key `widht`; did you mean `width`?"),
        ("shading", "colour", "camera.toml:10: unknown key `colour`"),
        (
            "[rolling_shutter]",
            "[rolling_shuter]",
            "camera.toml:12: unknown effect `rolling_shuter`; did you mean `rolling_shutter`?",
        ),
        ("[rolling_shutter]", "[ghosting]", "camera.toml:12: unknown effect `ghosting`"),
        (
            "readout_time_s",
            "readout_s",
            "camera.toml:13: unknown parameter `readout_s`; did you mean `readout_time_s`?",
        ),
        (
            "static = false",
            "exposure_time_s = 0.01",
            "camera.toml:9: unknown key `exposure_time_s`; did you mean `motion_blur.exposure_time_s`?",
        ),
        (
            "exposure_time_s = 0.01",
            "static = true",
            "camera.toml:17: found `static` in the table [motion_blur]; expected it above the first table: it \
             belongs to the camera",
        ),
    ] {
        Fixture::spoilt("camera.toml", from, to, error);
    }
}

#[test]
fn values_that_camera_toml_cannot_hold() {
    // The line, what stands there rightly, what it is replaced by, what was expected.
    let side = "a whole number of px, 1 to 16384";
    let focal = "a finite number of px, 0.001 to 10000000";
    let centre = "a finite number of px, -1000000 to 1000000";
    let period = "a finite number of s above 0 (at most 86400)";
    for (line, key, right, wrong, expected) in [
        (1, "width", "320", &["\"320\"", "320.5", "320.0", "0", "16385", "4294967616"][..], side),
        (2, "height", "240", &["0", "-240", "16385", "99999999999999999999", "true"], side),
        (3, "fx", "280.0", &["0", "-280.0", "nan", "inf", "\"280\"", "1e8"], focal),
        (4, "fy", "280.0", &["0.0", "-280", "-nan", "-inf", "1e-4"], focal),
        (5, "cx", "160.0", &["-inf", "1e400", "nan", "1e7"], centre),
        (6, "cy", "120.0", &["-1e7", "false"], centre),
        (7, "frame_period_s", "0.04", &["0", "-0.04", "nan", "true", "86401"], period),
        (8, "background", "\"ignore\"", &["\"white\"", "true"], "\"black\" or \"ignore\""),
        (9, "static", "false", &["1", "\"yes\""], "true or false"),
        (10, "shading", "\"lit\"", &["\"Lit\"", "0"], "\"unlit\" or \"lit\""),
    ] {
        for wrong in wrong {
            let error = format!("camera.toml:{line}: found {key} = {wrong}; expected {expected}");
            let [from, to] = [right, wrong].map(|value| format!("{key} = {value}\n"));
            Fixture::spoilt("camera.toml", &from, &to, &error);
        }
    }
    for (to, found) in
        [("[120.0]", "a list of 1"), ("{ a = 1 }", "a table"), ("1979-05-27", "the date 1979-05-27")]
    {
        let error = format!("camera.toml:6: found cy = {found}; expected {centre}");
        Fixture::spoilt("camera.toml", "120.0", to, &error);
    }
}

#[test]
fn keys_that_camera_toml_lacks() {
    let centre = "a finite number of px, -1000000 to 1000000";
    for (line, key, expected) in [
        ("width = 320\n", "width", "a whole number of px, 1 to 16384"),
        ("height = 240\n", "height", "a whole number of px, 1 to 16384"),
        ("fx = 280.0\n", "fx", "a finite number of px, 0.001 to 10000000"),
        ("fy = 280.0\n", "fy", "a finite number of px, 0.001 to 10000000"),
        ("cx = 160.0\n", "cx", centre),
        ("cy = 120.0\n", "cy", centre),
        ("frame_period_s = 0.04\n", "frame_period_s", "a finite number of s above 0 (at most 86400)"),
    ] {
        let error = format!("camera.toml: found no `{key}`; expected `{key} = ` {expected}");
        Fixture::spoilt("camera.toml", line, "", &error);
    }
}

#[test]
fn an_effect_that_is_no_table() {
    let text = CAMERA
        .replace("static = false", "motion_blur = 0.01")
        .replace("[motion_blur]\nexposure_time_s = 0.01\n", "");
    let error = CameraFile::parse(Path::new("camera.toml"), &text).expect_err("no table").to_string();
    let expected = "a table: `[motion_blur]` and its parameters";
    assert_eq!(error, format!("camera.toml:9: found motion_blur = 0.01; expected {expected}"));
}

#[test]
fn parameters_outside_their_range_name_the_unit_that_may_be_meant() {
    let exposure = "camera.toml:17: motion_blur.exposure_time_s";
    let range = "is outside 0 to 1 s";
    for (to, error) in [
        ("20", format!("{exposure} = 20 s {range}; is it in ms?")),
        ("1000", format!("{exposure} = 1000 s {range}; is it in ms?")),
        ("1001", format!("{exposure} = 1001 s {range}; is it in us?")),
        ("20000", format!("{exposure} = 20000 s {range}; is it in us?")),
        ("2e7", format!("{exposure} = 20000000 s {range}; is it in ns?")),
        ("-0.01", format!("{exposure} = -0.01 s {range}")),
        ("nan", "camera.toml:17: found motion_blur.exposure_time_s = nan; expected a finite number of unit s, 0 to \
            1".to_owned()),
        ("\"10 ms\"", "camera.toml:17: found motion_blur.exposure_time_s = \"10 ms\"; expected a finite number of \
            unit s, 0 to 1".to_owned()),
    ] {
        Fixture::spoilt("camera.toml", "0.01", to, &error);
    }
    let orders = "\"top_to_bottom\" or \"bottom_to_top\" or \"left_to_right\" or \"right_to_left\"";
    let error = format!("camera.toml:14: found rolling_shutter.scan_order = \"upwards\"; expected {orders}");
    Fixture::spoilt("camera.toml", "\"top_to_bottom\"", "\"upwards\"", &error);
}

#[test]
fn text_that_is_not_toml() {
    for (from, to, start) in [
        ("fx = 280.0", "fx 280.0", "camera.toml:3: found text that is not TOML ("),
        ("height = 240", "width = 240", "camera.toml:2: found text that is not TOML (duplicate key"),
        ("[motion_blur]", "[motion_blur", "camera.toml:16: found text that is not TOML ("),
    ] {
        let fixture = Fixture::new();
        fixture.write("camera.toml", CAMERA.replacen(from, to, 1));
        let error = fixture.read().expect_err("no TOML");
        assert!(
            error.starts_with(start) && error.ends_with("expected `key = value` lines and `[effect]` tables"),
            "{error}"
        );
    }
    let fixture = Fixture::new();
    fixture.write("camera.toml", b"width = 320\n# caf\xe9\n");
    assert_eq!(
        fixture.read().expect_err("Latin-1"),
        "camera.toml:2: found bytes that are not UTF-8; expected text in UTF-8"
    );
    for utf16 in [&b"\xff\xfew\0i\0d\0"[..], &b"\xfe\xff\0w\0i\0d"[..]] {
        fixture.write("camera.toml", utf16);
        let said = fixture.read().expect_err("UTF-16");
        assert_eq!(said, "camera.toml: found text in UTF-16; expected text in UTF-8: save it so");
    }
}

#[test]
fn cameras_that_are_odd_but_possible_are_read_with_a_warning() {
    let fixture = Fixture::new();
    fixture.write("camera.toml", CAMERA.replace("0.04", "0.015"));
    let warnings = fixture.read().expect("allowed").camera.warnings;
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0]
            .starts_with("rolling_shutter.readout_time_s = 0.02 s is longer than frame_period_s = 0.015 s")
    );
    let exposed = CAMERA.replace("exposure_time_s = 0.01", "exposure_time_s = 0.05");
    let long = "motion_blur.exposure_time_s = 0.05 s is longer than frame_period_s = 0.04 s: exposures overlap in time";
    for (text, said) in [
        (exposed.clone(), long.to_owned()),
        (
            exposed.replace("readout_time_s = 0.02", "readout_time_s = 0.0"),
            format!("{long}, which no sensor with a global shutter can do"),
        ),
    ] {
        let camera = CameraFile::parse(Path::new("camera.toml"), &text).expect("allowed");
        assert_eq!(camera.warnings, [said]);
    }
    // Control: an exposure of the whole period is said nothing about.
    let whole = exposed.replace("exposure_time_s = 0.05", "exposure_time_s = 0.04");
    let camera = CameraFile::parse(Path::new("camera.toml"), &whole).expect("allowed");
    assert!(camera.warnings.is_empty(), "{:?}", camera.warnings);
    fixture.write("camera.toml", CAMERA.replace("0.04", "40"));
    let warnings = fixture.read().expect("allowed").camera.warnings;
    assert_eq!(warnings, ["frames are as near as 0.04 s, but frame_period_s = 40 s; is the period in ms?"]);
    let third = CAMERA.replace("0.04", "0.0133").replace("readout_time_s = 0.02", "readout_time_s = 0.01");
    fixture.write("camera.toml", third);
    let stamps = |count: u64| {
        (0..count)
            .map(|i| format!("{},{i:06}.png\n", 1_700_000_000_000_000_000 + i * 40_000_000))
            .collect::<String>()
    };
    let warnings = |count: u64| {
        fixture.write("frames.csv", format!("#timestamp [ns],filename\n{}", stamps(count)));
        fixture.read().expect("allowed").camera.warnings
    };
    assert!(
        warnings(3)[0].starts_with("no frame follows another in less than 0.0400 s"),
        "{:?}",
        warnings(3)
    );
    assert!(warnings(2).is_empty(), "control: one frame may have been left out");
}

#[test]
fn a_lens_that_folds_inside_the_picture_is_refused_with_the_pixel() {
    let fixture = Fixture::new();
    fixture.write("camera.toml", format!("{CAMERA}\n[lens_distortion]\nk1 = -0.1\n"));
    fixture.read().expect("a lens that can be inverted");
    fixture.write("camera.toml", format!("{CAMERA}\n[lens_distortion]\nk1 = -1.9\n"));
    let refused = fixture.read().expect_err("folds");
    for part in ["camera.toml", "k1 = -1.9", "no ray reaches pixel (", "turns back at"] {
        assert!(refused.contains(part), "{part} in {refused}");
    }
    // The rays are the true camera's: the same lens folds in the wider picture of a shorter focal length.
    let lens = "[lens_distortion]\nk1 = -0.2\n";
    fixture.write("camera.toml", format!("{CAMERA}\n{lens}"));
    fixture.read().expect("a lens that can be inverted");
    fixture.write("camera.toml", format!("{CAMERA}\n[focal_length_error]\nratio = 0.5\n{lens}"));
    assert!(fixture.read().expect_err("folds").contains("no ray reaches pixel ("));
}

/// What was written and counts for nothing is said; cameras as they are common are not spoken of.
#[test]
fn what_changes_nothing_beside_the_rest_is_said() {
    let pinhole = &CAMERA[..CAMERA.find("[rolling_shutter]").unwrap()];
    let said = |more: &str| {
        CameraFile::parse(Path::new("camera.toml"), &format!("{pinhole}{more}")).unwrap().warnings
    };
    for (more, says) in [
        ("[defocus]\nfocus_m = 2", "defocus.focus_m = 2 changes nothing without aperture_m"),
        (
            "[defocus]\nshape = \"gaussian\"",
            "defocus.shape = \"gaussian\" changes nothing without aperture_m",
        ),
        ("[auto_exposure]\nspeed = 0.5", "auto_exposure.speed = 0.5 changes nothing without target"),
        (
            "[rolling_shutter]\nscan_order = \"left_to_right\"",
            "scan_order = \"left_to_right\" changes nothing",
        ),
        ("[fixed_pattern_noise]\nsensor_seed = 7", "sensor_seed = 7 changes nothing without dsnu or prnu"),
        ("[flicker]\nfrequency_hz = 100\ndepth = 0.2\naverage = \"exposure\"", "motion_blur.exposure_time_s"),
        ("[lens_distortion]\nk4 = 0.1", "lens_distortion.k4 = 0.1 changes nothing"),
    ] {
        let all = said(more);
        assert!(all.len() == 1 && all[0].contains(says), "{more}: {all:?}");
    }
    let both = "[defocus]\naperture_m = 0.01\nfocus_m = 2\nshape = \"gaussian\"\n\
        [sharpening]\namount = 1\nradius_px = 1";
    assert_eq!(said(both), [""; 0], "control");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut cameras = vec![root.join("demo/capture/camera.toml"), root.join("scenes/table1/camera.toml")];
    cameras.extend(std::fs::read_dir(root.join("demo/cameras")).unwrap().map(|e| e.unwrap().path()));
    assert!(cameras.len() > 5);
    for path in cameras {
        assert_eq!(CameraFile::read(&path).unwrap().warnings, [""; 0], "{}", path.display());
    }
}
