//! `shutterbug presets`, `camera convert` and `import` as a user calls them.

use std::fs;
use std::path::Path;
use std::process::Command;

const KALIBR: &str = "cam0:\n  camera_model: pinhole\n  intrinsics: [461.6, 460.1, 362.6, 246.0]\n  \
                      distortion_model: none\n  distortion_coeffs: []\n  resolution: [752, 480]\n  \
                      line_delay: 2.5e-05\n  timeshift_cam_imu: 0.01\n";

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
    assert!(error.contains("<NAME>: unknown preset `fone`; did you mean `phone`?"), "{error}");
}

/// A table of two cameras, of which the second sees 90 degrees, and a profile of Gyroflow that names its shutter.
fn profiles(folder: &Path) -> String {
    let table = "brand,model,lens,setting,width_px,height_px,fps,readout_ms,distortion_model,\
                 fx_px,fy_px,cx_px,cy_px,d1,d2,d3,d4,rms_px,images,source_path\n\
                 Acme,Dash 1,Wide,\"4:3, flat\",128,96,30,-12.5,opencv_fisheye,96,96,63.5,47.5,\
                 0.03,-0.01,0,0,0.4,15,a.json\n\
                 Acme,Dash 2,Round,,128,96,30,12.5,opencv_fisheye,40,40,63.5,47.5,0,0,0,0,0.4,15,b.json\n\
                 Acme,Dash 3,Round,,128,96,30,12.5,opencv_fisheye,-40,40,63.5,47.5,0,0,0,0,0.4,15,c.json\n";
    fs::create_dir_all(folder.join("more")).expect("a folder");
    fs::write(folder.join("table.csv"), table).expect("written");
    fs::write(folder.join("LICENSE"), "CC0 1.0 Universal\n\nmore\n").expect("written");
    let profile = r#"{ "camera_brand": "Acme", "camera_model": "Drone", "fps": 24.0, "frame_readout_time": 20.0,
        "calib_dimension": { "w": 128, "h": 96 }, "distortion_model": "opencv_standard", "num_images": 9,
        "fisheye_params": { "RMS_error": 0.25, "camera_matrix": [[100, 0, 64], [0, 100, 48], [0, 0, 1]],
        "distortion_coeffs": [0.1, 0.01, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0] } }"#;
    fs::write(folder.join("more/drone.json"), profile).expect("written");
    folder.to_string_lossy().into_owned()
}

#[test]
fn lens_profiles_are_searched_shown_and_used() {
    let folder = tempfile::tempdir().expect("a folder");
    let dir = profiles(folder.path());
    let (code, found, said) = shutterbug(&["presets", "search", "ACME", "4:3", "--profiles", &dir]);
    assert_eq!(code, 0);
    assert!(found.starts_with("acme-dash-1-wide-4-3-flat-128x96-30fps\n"), "{found}");
    assert!(
        found.contains("rolling shutter 12.5 ms, calibrated to 0.4 px rms with 15 pictures\n"),
        "{found}"
    );
    assert!(!found.contains("dash-2") && !found.contains("drone"), "control: other words: {found}");
    assert!(
        said.contains("1 entry") && said.contains("table.csv:4") && said.contains("fx_px = -40"),
        "{said}"
    );

    let name = "acme-dash-1-wide-4-3-flat-128x96-30fps";
    let show = |name: &str| shutterbug(&["presets", "show", name, "--profiles", &dir]);
    let (code, toml, _) = show(name);
    assert_eq!(code, 0);
    for line in [
        "# Source: table.csv line 2, from a.json.",
        "# Licence: CC0 1.0 Universal.",
        "cx = 64.0",
        "model = \"equidistant\"",
        "readout_time_s = 0.0125",
        "scan_order = \"bottom_to_top\"",
    ] {
        assert!(toml.lines().any(|l| l == line), "{line}: {toml}");
    }
    // What no source states is absent.
    for effect in ["shot_noise", "read_noise", "motion_blur", "full_well_e ="] {
        assert!(!toml.contains(&format!("[{effect}]")), "{toml}");
    }
    let (code, toml, _) = show("acme-drone-128x96-24fps");
    assert!(code == 0 && toml.contains("model = \"rational\"") && toml.contains("k4 = 0.2"), "{toml}");

    let (_, found, _) = shutterbug(&["presets", "search", "dash", "2", "round", "--profiles", &dir]);
    assert!(found.contains("sees 90 degrees or folds: not usable"), "{found}");
    let (code, _, error) = show("acme-dash-2-round-128x96-30fps");
    assert!(code == 1 && error.contains("90 degrees"), "{error}");
    let (code, _, error) = show("acme-dron-128x96-24fps");
    assert!(code == 2 && error.contains("did you mean `acme-drone-128x96-24fps`?"), "{error}");

    // The environment names the folder as well.
    let with = Command::new(env!("CARGO_BIN_EXE_shutterbug"))
        .args(["presets", name])
        .env("SHUTTERBUG_PROFILES", &dir)
        .output()
        .expect("runs");
    assert!(with.status.success());
    assert_ne!(shutterbug(&["presets", name]).0, 0, "control: without a folder there is no such preset");
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
        ("gyroflow", "\"frame_readout_time\": 12.0"),
        ("sdf", "<sensor name="),
        ("toml", "[rolling_shutter]"),
    ] {
        let (code, out, error) = shutterbug(&["camera", "convert", &toml, "--to", to]);
        assert!(code == 0 && out.contains(mark), "{to}: {out} {error}");
        // What a target cannot hold is said; Kalibr, Gyroflow and camera.toml hold the shutter.
        assert_eq!(error.contains("rolling_shutter"), ["ros", "euroc", "sdf"].contains(&to), "{to}: {error}");
    }
    let (code, _, error) = shutterbug(&["camera", "convert", &toml, "--out", &path(folder.path(), "x.yaml")]);
    assert!(code == 1 && error.contains("--to toml, ros, kalibr, euroc, gyroflow, sdf"), "{error}");
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
    assert!(code == 0 && error.contains("1 frame and 2 poses"), "{error}");
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
