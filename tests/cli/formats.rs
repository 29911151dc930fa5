//! `shutterbug presets`, `camera convert` and `import` as a user calls them.

use std::fs;
use std::path::Path;
use std::process::Command;

const KALIBR: &str = "cam0:\n  camera_model: pinhole\n  intrinsics: [461.6, 460.1, 362.6, 246.0]\n  \
    distortion_model: none\n  distortion_coeffs: []\n  resolution: [752, 480]\n  line_delay: 2.5e-05\n  \
    timeshift_cam_imu: 0.01\n";

fn shutterbug(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_shutterbug")).args(arguments).output().expect("runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_string_lossy().into_owned()
}

#[test]
fn presets_are_listed_and_printed() {
    let (code, list, _) = shutterbug(&["presets"]);
    assert_eq!(code, 0);
    for name in ["humanoid-2008", "phone", "usb-webcam", "machine-vision"] {
        assert!(list.contains(name), "{list}");
        let (code, toml, _) = shutterbug(&["presets", name]);
        assert!(code == 0 && toml.starts_with("# ") && toml.contains("\n[motion_blur]\n"), "{toml}");
    }
    assert!(
        list.contains("640x480, 30 frames a second, 48 degrees across, rolling shutter 31.4 ms"),
        "{list}"
    );
    assert!(list.contains("global shutter"));
    let (code, out, error) = shutterbug(&["presets", "fone"]);
    assert_eq!((code, out.as_str()), (2, ""));
    assert!(error.contains("unknown preset `fone`; did you mean `phone`?"), "{error}");
}

#[test]
fn a_lens_that_folds_inside_the_picture_is_not_converted() {
    let folder = tempfile::tempdir().expect("a folder");
    let toml = path(folder.path(), "camera.toml");
    let with = |k1: &str| {
        let text = "width = 64\nheight = 48\nfx = 60\nfy = 60\ncx = 32\ncy = 24\nframe_period_s = 0.03\n";
        fs::write(&toml, format!("{text}\n[lens_distortion]\nk1 = {k1}\n")).expect("written");
        shutterbug(&["camera", "convert", &toml, "--to", "ros"])
    };
    let (code, out, error) = with("-1.5");
    assert_eq!((code, out.as_str()), (1, ""));
    assert!(error.contains("not invertible inside the picture: no ray reaches pixel ("), "{error}");
    assert_eq!(with("-0.15").0, 0, "control: one that does not fold");
}

#[test]
fn a_camera_goes_from_kalibr_to_toml_and_on_to_every_format() {
    let folder = tempfile::tempdir().expect("a folder");
    let (chain, toml) = (path(folder.path(), "chain.yaml"), path(folder.path(), "camera.toml"));
    fs::write(&chain, KALIBR).expect("written");
    let (code, _, error) = shutterbug(&["camera", "convert", &chain, "--out", &toml]);
    assert_eq!(code, 1);
    assert!(error.contains("no frame rate") && error.contains("--rate-hz"), "{error}");
    assert!(!Path::new(&toml).exists());
    let (code, _, error) = shutterbug(&["camera", "convert", &chain, "--out", &toml, "--rate-hz", "20"]);
    assert_eq!(code, 0, "{error}");
    assert!(error.contains("timeshift_cam_imu = 0.01 s"), "{error}");
    let text = fs::read_to_string(&toml).expect("written");
    assert!(text.contains("frame_period_s = 0.05") && text.contains("readout_time_s = 0.012"), "{text}");
    assert!(text.contains("cx = 363.1"), "{text}");
    for (to, mark) in [
        ("ros", "camera_matrix:"),
        ("kalibr", "line_delay:"),
        ("euroc", "sensor_type: camera"),
        ("sdf", "<sensor name="),
        ("toml", "[rolling_shutter]"),
    ] {
        let (code, out, error) = shutterbug(&["camera", "convert", &toml, "--to", to]);
        assert!(code == 0 && out.contains(mark), "{to}: {out} {error}");
        // What a target cannot hold is said; Kalibr and camera.toml hold the shutter.
        assert_eq!(error.contains("rolling_shutter"), ["ros", "euroc", "sdf"].contains(&to), "{to}: {error}");
    }
    let (code, _, error) = shutterbug(&["camera", "convert", &toml, "--out", &path(folder.path(), "x.yaml")]);
    assert!(code == 1 && error.contains("--to toml, ros, kalibr, euroc, sdf"), "{error}");
    let (code, _, _) = shutterbug(&["camera", "convert", &toml, "--to", "orb"]);
    assert_eq!(code, 2);
}

#[test]
fn an_import_replaces_nothing_unasked() {
    let folder = tempfile::tempdir().expect("a folder");
    let (poses, out) = (path(folder.path(), "poses.txt"), path(folder.path(), "capture"));
    fs::write(&poses, "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n").expect("written");
    fs::write(folder.path().join("times.txt"), "0\n0.1\n").expect("written");
    let (code, _, error) = shutterbug(&["import", &poses, "--out", &out]);
    assert!(code == 0 && error.contains("1 frames and 2 poses"), "{error}");
    let frames = fs::read_to_string(Path::new(&out).join("frames.csv")).expect("written");
    assert_eq!(frames, "#timestamp [ns],filename\n0,000000.png\n");
    let (code, _, error) = shutterbug(&["import", &poses, "--out", &out]);
    assert!(code == 1 && error.contains("--overwrite"), "{error}");
    let (code, ..) = shutterbug(&["import", &poses, "--out", &out, "--overwrite"]);
    assert_eq!(code, 0);
}

#[test]
fn simulate_refuses_an_unknown_preset_before_it_does_anything() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = path(folder.path(), "out");
    let (code, _, error) = shutterbug(&["simulate", "nowhere", "--out", &out, "--preset", "phon"]);
    assert!(code == 2 && error.contains("did you mean `phone`?"), "{error}");
    assert!(!Path::new(&out).exists());
}
