//! Frames of any simulator beside real ones, without a scene: pairs with planes, pairs that are only roughly aligned,
//! folders of different moments. Skipped by name where `../shared/data/pairs-dev` is not there.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::long_support::{left_out, long, some_of};
use serde_json::Value;

fn shared() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/pairs-dev");
    if !folder.is_dir() {
        eprintln!("SKIPPED: {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

fn diagnose(sim: &Path, real: &Path, out: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
    command.arg("diagnose").args(["--sim".as_ref(), sim.as_os_str(), "--real".as_ref(), real.as_os_str()]);
    command.arg("--out").arg(out).args(more).output().unwrap()
}

fn report(sim: &Path, real: &Path, more: &[&str]) -> Value {
    let out = tempfile::tempdir().unwrap();
    let done = diagnose(sim, real, out.path(), more);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert!(out.path().join("report.html").is_file() && out.path().join("camera.toml").is_file());
    serde_json::from_slice(&std::fs::read(out.path().join("report.json")).unwrap()).unwrap()
}

/// Options that leave candidates out; none with `SHUTTERBUG_LONG=1`, for then all are tried.
fn few(without: &str) -> Vec<&str> {
    if long() { Vec::new() } else { vec!["--without", without] }
}

/// The camera's effects, sorted.
fn names(report: &Value) -> Vec<&str> {
    let all = report["effects"].as_array().unwrap();
    let mut names: Vec<&str> =
        all.iter().filter(|e| e["camera"] != false).map(|e| e["name"].as_str().unwrap()).collect();
    names.sort_unstable();
    names
}

fn parameter(report: &Value, name: &str, parameter: &str) -> f64 {
    let all = report["effects"].as_array().unwrap();
    let effect = all.iter().find(|e| e["name"] == name).unwrap_or_else(|| panic!("{name} is not found"));
    effect["parameters"][parameter]["value"].as_f64().unwrap()
}

fn near(found: f64, truth: f64) {
    assert!((found / truth - 1.0).abs() < 0.05, "{found} for {truth}");
}

#[test]
#[ignore = "long: two minutes"]
fn depth_and_motion_are_enough_for_a_shutter_in_a_room_lit_otherwise() {
    let Some(data) = shared() else { return };
    // With all candidates it takes two minutes of processor time. Those that are left move, blur, light or scatter
    // values too.
    let without = "lens_distortion,chromatic_aberration,bayer_mosaic,jpeg,noise_reduction,sharpening,flicker,glare,\
                   hot_pixels,fixed_pattern_noise,row_noise,chroma_subsampling,quantization,saturation,tone_curve,\
                   vignetting,focal_length_error,defocus";
    let found = report(&data.join("p00/sim"), &data.join("p00/real"), &few(without));
    assert_eq!(names(&found), ["read_noise", "rolling_shutter"]);
    near(parameter(&found, "rolling_shutter", "readout_time_s"), 0.017051);
    near(parameter(&found, "read_noise", "sigma"), 0.00878);
    assert_eq!(found["verdict"], "explained");
    assert_eq!(found["input"]["alignment"]["kind"], "exact");
}

/// The same without depth and motion: optical flow between the simulated frames stands for it, and says so.
#[test]
#[ignore = "long: two minutes"]
fn pictures_alone_tell_a_shutter_where_flow_is_good_enough() {
    let Some(data) = shared() else { return };
    let sim = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(data.join("p00/sim")).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            std::fs::copy(&path, sim.path().join(path.file_name().unwrap())).unwrap();
        }
    }
    let few =
        "lens_distortion,chromatic_aberration,bayer_mosaic,jpeg,noise_reduction,sharpening,flicker,glare";
    let found = report(sim.path(), &data.join("p00/real"), &["--without", few]);
    near(parameter(&found, "rolling_shutter", "readout_time_s"), 0.017051);
    near(parameter(&found, "read_noise", "sigma"), 0.00878);
    assert!(
        found["warnings"].to_string().contains("motion was estimated by optical flow"),
        "{}",
        found["warnings"]
    );
    assert!(found["candidates"].to_string().contains("motion_blur"));
    // Control: simulated frames whose order is lost do not flow, and nothing is said of time.
    let mixed = tempfile::tempdir().unwrap();
    let order = [0, 4, 1, 6, 2, 7, 3, 5];
    for (k, from) in order.into_iter().enumerate() {
        let name = |i: usize| format!("{i:06}.png");
        std::fs::copy(sim.path().join(name(from)), mixed.path().join(name(k))).unwrap();
    }
    let real = tempfile::tempdir().unwrap();
    for (k, from) in order.into_iter().enumerate() {
        let name = |i: usize| format!("{i:06}.png");
        std::fs::copy(data.join("p00/real").join(name(from)), real.path().join(name(k))).unwrap();
    }
    let lost = report(mixed.path(), real.path(), &["--without", few]);
    assert!(!names(&lost).contains(&"rolling_shutter"), "{:?}", names(&lost));
    assert!(!lost["warnings"].to_string().contains("motion was estimated"), "{}", lost["warnings"]);
}

#[test]
#[ignore = "long: a minute"]
fn pictures_that_lie_roughly_on_each_other_tell_values_and_sharpness_and_no_geometry() {
    let Some(data) = shared() else { return };
    let found = report(&data.join("p01/sim"), &data.join("p01/real"), &[]);
    assert_eq!(names(&found), ["defocus", "gamma"]);
    near(parameter(&found, "defocus", "sigma_px"), 1.018);
    near(parameter(&found, "gamma", "exponent"), 1.2867);
    assert_eq!(found["input"]["alignment"]["kind"], "rough");
    let state = |name: &str| {
        let all = found["candidates"].as_array().unwrap();
        all.iter().find(|c| c["name"] == name).unwrap()["state"].clone()
    };
    assert_eq!(state("rolling_shutter"), "undetermined");
    assert_eq!(state("lens_distortion"), "undetermined");
}

#[test]
#[ignore = "long: a minute"]
fn folders_of_different_moments_tell_noise_and_shared_colour() {
    let Some(data) = shared() else { return };
    let few = few("sharpening,chromatic_aberration,hot_pixels,bayer_mosaic");
    let more = [&["--unpaired"][..], few.as_slice()].concat();
    let found = report(&data.join("p02/sim"), &data.join("p02/real"), &more);
    assert_eq!(names(&found), ["chroma_subsampling", "shot_noise"]);
    near(parameter(&found, "shot_noise", "full_well_e"), 1465.0);
    assert_eq!(found["verdict"], "explained");
}

/// Real frames that are the simulated ones: nothing is found, paired or not, and a gap is not invented.
#[test]
#[ignore = "long: a minute"]
fn a_folder_beside_itself_has_no_gap() {
    let Some(data) = shared() else { return };
    let sim = data.join("p01/sim");
    for more in [&[][..], &["--unpaired"]] {
        let found = report(&sim, &sim, more);
        assert_eq!((names(&found).len(), &found["verdict"]), (0, &Value::from("no_gap")), "{more:?}");
    }
}

/// Two stills: too few to judge some by others, but each can be judged in parts. What a sensor keeps is not told of.
#[test]
fn two_stills_are_judged_in_parts() {
    let (sim, real) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    for k in 0..2u32 {
        let value = |x: u32, y: u32, c: u32| {
            let tile = (x / 11 + 3 * k) * 7 + (y / 9) * 13 + 5 * c;
            30 + (tile * tile % 190) as u8
        };
        let shown = image::RgbImage::from_fn(192, 144, |x, y| image::Rgb([0, 1, 2].map(|c| value(x, y, c))));
        let bent = |v: u8| (255.0 * (f64::from(v) / 255.0).powf(1.3)).round() as u8;
        let seen = image::RgbImage::from_fn(192, 144, |x, y| image::Rgb(shown.get_pixel(x, y).0.map(bent)));
        shown.save(sim.path().join(format!("{k}.png"))).unwrap();
        seen.save(real.path().join(format!("{k}.png"))).unwrap();
    }
    let found = report(sim.path(), real.path(), &[]);
    assert_eq!(names(&found), ["gamma"]);
    near(parameter(&found, "gamma", "exponent"), 1.3);
    let all = found["candidates"].as_array().unwrap();
    assert_eq!(all.iter().find(|c| c["name"] == "hot_pixels").unwrap()["state"], "undetermined");
    // Control: the same stills beside themselves.
    if !long() {
        return left_out("two_stills", "the same stills beside themselves");
    }
    let none = report(sim.path(), sim.path(), &[]);
    assert_eq!((names(&none).len(), &none["verdict"]), (0, &Value::from("no_gap")));
}

/// Pictures that are read as something else are named, paired or not; ordinary ones are not.
#[test]
fn grey_pictures_and_those_of_16_bits_are_named() {
    let [plain, deep, grey] = [0; 3].map(|_| tempfile::tempdir().unwrap());
    for k in 0..6u32 {
        let value = |x: u32, y: u32| {
            let tile = (x + 4 * k) / 9 * 7 + y / 7 * 13;
            30 + (tile * tile % 190) as u8
        };
        let name = format!("{k}.png");
        let shown = image::RgbImage::from_fn(96, 72, |x, y| image::Rgb([value(x, y); 3]));
        shown.save(plain.path().join(&name)).unwrap();
        let fine = |x, y| image::Rgb([u16::from(value(x, y)) * 257; 3]);
        let fine = image::ImageBuffer::<image::Rgb<u16>, Vec<u16>>::from_fn(96, 72, fine);
        fine.save(deep.path().join(&name)).unwrap();
        let one = image::GrayImage::from_fn(96, 72, |x, y| image::Luma([value(x, y)]));
        one.save(grey.path().join(&name)).unwrap();
    }
    let quick = "lens_distortion,chromatic_aberration,bayer_mosaic,jpeg,noise_reduction,sharpening,flicker,glare,\
                 defocus";
    let forms = [&["--without", quick][..], &["--without", quick, "--unpaired"]];
    for more in some_of("grey_pictures", 2, forms) {
        let warnings = |real: &Path| report(plain.path(), real, more)["warnings"].to_string();
        assert!(warnings(deep.path()).contains("have 16 bits a channel and are read as 8"), "{more:?}");
        assert!(warnings(grey.path()).contains("are grey"), "{more:?}");
        let none = warnings(plain.path());
        assert!(!none.contains("16 bits") && !none.contains("grey"), "control: {none}");
    }
}

#[test]
fn what_is_wrong_with_two_folders_is_one_clear_line() {
    let (sim, real, out) =
        (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let said = |more: &[&str]| {
        let done = diagnose(sim.path(), real.path(), &out.path().join("o"), more);
        assert_eq!(done.status.code(), Some(1));
        String::from_utf8(done.stderr).unwrap()
    };
    assert!(said(&[]).contains("no picture"));
    let picture = |folder: &Path, name: &str, side: u32| {
        image::RgbImage::from_pixel(side, side, image::Rgb([90, 90, 90])).save(folder.join(name)).unwrap();
    };
    (0..4).for_each(|i| picture(sim.path(), &format!("{i:03}.png"), 64));
    picture(real.path(), "a.png", 64);
    assert!(said(&[]).contains("no name in both"));
    assert!(said(&["--unpaired"]).contains("4 pictures"));
    (0..4).for_each(|i| picture(real.path(), &format!("{i:03}.png"), 32));
    let sizes = said(&[]);
    assert!(sizes.contains("32x32") && sizes.contains("64x64"), "{sizes}");
    std::fs::write(sim.path().join("match.csv"), "sim,real\n000.png,missing.png\n").unwrap();
    assert!(said(&[]).contains("match.csv:2"));
    let usage = Command::new(env!("CARGO_BIN_EXE_shutterbug"))
        .args(["diagnose", "--out", "x", "--sim", "y"])
        .output();
    assert_eq!(usage.unwrap().status.code(), Some(2));
}
