//! The presets that ship.

use std::collections::HashMap;

use super::*;
use crate::formats::{PRESETS, apply_preset, preset};
use shutterbug::capture::CameraFile;
use shutterbug::chain::Value;
use shutterbug::effects::{self, MotionBlur, RollingShutter};

/// Parameters of docs/reference/camera.md for the effects that presets use.
fn contract() -> HashMap<&'static str, Vec<&'static str>> {
    HashMap::from([
        ("lens_distortion", vec!["k1", "k2", "p1", "p2", "k3"]),
        ("rolling_shutter", vec!["readout_time_s", "scan_order"]),
        ("motion_blur", vec!["exposure_time_s"]),
        ("defocus", vec!["sigma_px"]),
        ("vignetting", vec!["a1", "a2"]),
        ("bayer_mosaic", vec!["pattern", "demosaic"]),
        ("shot_noise", vec!["full_well_e"]),
        ("fixed_pattern_noise", vec!["dsnu", "prnu"]),
        ("row_noise", vec!["sigma"]),
        ("read_noise", vec!["sigma"]),
        ("sharpening", vec!["amount", "radius_px"]),
        ("chroma_subsampling", vec!["scheme"]),
        ("jpeg", vec!["quality"]),
    ])
}

#[test]
fn presets_use_only_names_of_the_contract() {
    let contract = contract();
    assert!(contract.keys().all(|name| effects::by_id(name).is_some()));
    for preset in PRESETS {
        let table: toml::Table = preset.toml.parse().unwrap_or_else(|e| panic!("{}: {e}", preset.name));
        for (name, value) in &table {
            let Some(parameters) = value.as_table() else { continue };
            let known = contract.get(name.as_str()).unwrap_or_else(|| panic!("{}: [{name}]", preset.name));
            for parameter in parameters.keys() {
                assert!(known.contains(&parameter.as_str()), "{}: {name}.{parameter}", preset.name);
            }
        }
    }
}

#[test]
fn presets_are_cameras_and_nothing_of_them_is_lost_silently() {
    for preset in PRESETS {
        let camera = preset.camera().unwrap_or_else(|e| panic!("{e}"));
        let table: toml::Table = preset.toml.parse().expect("TOML");
        for name in table.iter().filter(|(_, v)| v.is_table()).map(|(name, _)| name.as_str()) {
            assert!(camera.settings.has(name), "{}: {name}", preset.name);
        }
        assert!(camera.warnings.is_empty(), "{}: {:?}", preset.name, camera.warnings);
        assert!(!preset.about().is_empty());
    }
}

#[test]
fn every_table_and_number_has_its_source_above_it() {
    for preset in PRESETS {
        let lines: Vec<&str> = preset.toml.lines().collect();
        for (i, line) in lines.iter().enumerate().filter(|(_, l)| l.starts_with('[')) {
            // A table may share the comment of the one before it.
            let before = lines[..i].iter().rev().find(|l| l.starts_with('#') || l.starts_with('['));
            let named = line.trim_matches(['[', ']']).replace('_', " ");
            let shared = lines.iter().any(|l| l.starts_with('#') && l.to_lowercase().contains(&named));
            let own = before.is_some_and(|l| l.starts_with('#'));
            assert!(own || shared || *line == "[jpeg]", "{}: {line} has no source", preset.name);
        }
        // An estimate is called one; what is not an estimate names a document or a choice.
        let words = [
            "stimated",
            "datasheet",
            "documentation",
            "manual",
            "ISETCam",
            "ame page",
            "Same file",
            "Same manual",
            "chosen",
            "setting",
            "Huai",
            "cited",
        ];
        for block in preset.toml.split("\n\n").filter(|b| b.contains(" = ")) {
            assert!(
                words.iter().any(|w| block.contains(w)) || block.contains("[jpeg]"),
                "{}: {block}",
                preset.name
            );
        }
    }
}

#[test]
fn derived_numbers_follow_from_their_sources() {
    let value = |name: &str, effect: &str, parameter: &str| {
        let table: toml::Table = preset(name, None, "").expect("known").toml.parse().expect("TOML");
        table[effect][parameter].as_float().expect("a float")
    };
    let near = |got: f64, want: f64| assert!((got / want - 1.0).abs() < 2e-3, "{got} {want}");
    near(value("humanoid-2008", "rolling_shutter", "readout_time_s"), 480.0 * 784.0 * 2.0 / 24e6);
    near(value("humanoid-2008", "read_noise", "sigma"), 10f64.powf(-52.0 / 20.0));
    near(value("phone", "rolling_shutter", "readout_time_s"), 28.72e-6 * 720.0);
    near(value("phone", "shot_noise", "full_well_e"), 6000.0 * 55.0 / 270.0);
    near(value("machine-vision", "shot_noise", "full_well_e"), 10f64.powf(4.51));
    near(value("machine-vision", "read_noise", "sigma"), 10f64.powf(-73.0 / 20.0));
    let fov = preset("humanoid-2008", None, "").expect("known").camera().expect("valid").intrinsics;
    near((320.0 / fov.fx).atan().to_degrees(), 47.8 / 2.0);
}

const OWN: &str =
    "width = 320\nheight = 240\nfx = 300\nfy = 300\ncx = 160\ncy = 120\nframe_period_s = 0.02\n";

#[test]
fn a_preset_adds_effects_and_the_cameras_own_win() {
    let parse = |text: &str| CameraFile::parse(Path::new("camera.toml"), text).expect("valid");
    let mut camera = parse(&format!("{OWN}[motion_blur]\nexposure_time_s = 0.001\n"));
    let notes =
        apply_preset(&preset("humanoid-2008", None, "").expect("known"), &mut camera).expect("applies");
    assert_eq!(MotionBlur::exposure_time_s(&camera.settings), 0.001);
    assert_eq!(RollingShutter::readout_time_s(&camera.settings), 0.031_372_549);
    // Size, pinhole and frame period stay the capture's.
    assert_eq!((camera.intrinsics, camera.frame_period_s), (parse(OWN).intrinsics, 0.02));
    assert!(notes.iter().any(|n| n.starts_with("motion_blur is the camera's own")), "{notes:#?}");
    // A readout of 31 ms does not fit in 20 ms, and that is said.
    assert!(notes.iter().any(|n| n.contains("longer than frame_period_s = 0.02")), "{notes:#?}");
    // Control: without a table of its own the camera takes the preset's.
    let mut plain = parse(OWN);
    apply_preset(&preset("humanoid-2008", None, "").expect("known"), &mut plain).expect("applies");
    assert_eq!(plain.settings.get("motion_blur", "exposure_time_s"), Some(Value::Number(0.01)));
}

#[test]
fn an_unknown_preset_names_the_nearest() {
    let error = preset("usb_webcam", None, "--preset").expect_err("unknown").to_string();
    assert_eq!(error, "--preset: unknown preset `usb_webcam`; did you mean `usb-webcam`?");
    assert!(!preset("banana", None, "").expect_err("unknown").to_string().contains("did you mean"));
}
