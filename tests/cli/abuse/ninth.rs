//! What a ninth set of bad inputs brought up (docs/robustness.md).

use image::{GrayImage, Luma, Rgb, RgbImage};
use shutterbug::plane::{read_rgb8, write_png_atomic};

use super::*;
use crate::dice_support::Dice;

#[test]
fn a_frame_of_another_exposure_among_the_others_is_named() {
    if !device_is_there("a_frame_of_another_exposure_among_the_others_is_named") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("capture");
    copy(Path::new(DEMO), &capture);
    let made = folder.path().join("made");
    let mut simulate = shutterbug();
    assert_done(&simulate.arg("simulate").arg(&capture).arg("--out").arg(&made).output().unwrap());
    fs::create_dir_all(capture.join("real")).unwrap();
    for i in 0..6 {
        fs::copy(made.join(format!("{i:06}.png")), capture.join(format!("real/{i:06}.png"))).unwrap();
    }
    // What is asked is what one frame of another exposure might be taken for.
    let others = all_but(&["exposure_gain", "flicker", "gamma"]);
    let diagnosed = |more: &[&str]| {
        let out = folder.path().join("out");
        let mut command = shutterbug();
        command.arg("diagnose").arg(&capture).arg("--out").arg(&out).arg("--overwrite");
        command.args(["--without", &others]).args(more);
        assert_done(&command.output().unwrap());
        let report = fs::read(out.join("report.json")).unwrap();
        serde_json::from_slice::<serde_json::Value>(&report).unwrap()
    };
    let no_limit = ["--time-limit-s", "18446744073709551615"];
    let control = diagnosed(&[&["--scene", "exact", "--poses", "exact"], &no_limit[..]].concat());
    assert_eq!(control["verdict"], "no_gap", "{}", control["sentence"]);
    for wrong in ["unlike the others", "set-up"] {
        assert!(!control["sentence"].as_str().unwrap().contains(wrong));
    }
    // A frame that no figure of the report is of.
    let held: Vec<u64> = serde_json::from_value(control["input"]["held_out_frames"].clone()).unwrap();
    let other = (0..6).find(|i| !held.contains(i)).unwrap();
    let path = capture.join(format!("real/{other:06}.png"));
    let mut dark = read_rgb8(&path).unwrap();
    dark.data.iter_mut().for_each(|v| *v /= 2);
    write_png_atomic(&path, &dark).unwrap();
    let report = diagnosed(&[]);
    let sentence = report["sentence"].as_str().unwrap();
    assert!(sentence.contains(&format!("real frame {other} is unlike the others")), "{sentence}");
    assert_ne!(report["verdict"], "no_gap", "{sentence}");
}

#[test]
fn copies_of_one_noisy_frame_are_no_evidence_of_a_pattern() {
    let folder = tempfile::tempdir().unwrap();
    let made = |name: &str, seeds: &dyn Fn(u64) -> u64| {
        let path = folder.path().join(name);
        fs::create_dir_all(&path).unwrap();
        for i in 0..8u64 {
            let mut dice = Dice(seeds(i));
            let picture = RgbImage::from_fn(64, 48, |x, y| {
                let v = 60.0 + 2.0 * f64::from(x) + f64::from(y);
                Rgb([0, 1, 2].map(|_| (v + 4.0 * dice.normal()).round() as u8))
            });
            picture.save(path.join(format!("{i:06}.png"))).unwrap();
        }
        path
    };
    let [sim, live, frozen, doubled] = [
        made("sim", &|i| 100 + i),
        made("live", &|i| 200 + i),
        made("frozen", &|_| 200),
        made("doubled", &|i| 200 + i.min(6)),
    ];
    let diagnose = |real: &Path| {
        let mut command = shutterbug();
        command.arg("diagnose").arg("--sim").arg(&sim).arg("--real").arg(real).arg("--unpaired");
        command.args(["--without", "jpeg,noise_reduction,sharpening,defocus"]);
        command.arg("--out").arg(folder.path().join("out")).arg("--overwrite").output().unwrap()
    };
    assert_refused(&diagnose(&frozen), 1, &["1 picture that differs from the others among 8", "at least 6"]);
    assert_done(&diagnose(&live));
    let warnings = || {
        let report = fs::read_to_string(folder.path().join("out/report.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&report).unwrap()["warnings"].to_string()
    };
    assert!(!warnings().contains("copy of another"), "control: {}", warnings());
    assert_done(&diagnose(&doubled));
    assert!(warnings().contains("1 real picture is a copy of another"), "{}", warnings());
}

#[test]
fn a_black_level_is_taken_off_and_a_capped_picture_is_no_flat_field() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let made = |name: &str, seed: u64, light: &dyn Fn(f64) -> f64| {
        let mut dice = Dice(seed);
        let picture = GrayImage::from_fn(160, 160, |x, y| {
            let [dx, dy] = [x, y].map(|v| (f64::from(v) - 79.5) / 113.0);
            let value = 255.0 * light(dx * dx + dy * dy) + 1.5 * dice.normal();
            Luma([value.round().clamp(0.0, 255.0) as u8])
        });
        picture.save(path(name)).unwrap();
        path(name)
    };
    let lit = |q: f64| 0.06 + 0.94 * 0.5 * (1.0 - 0.3 * q);
    let bright: Vec<_> = (0..4).map(|i| made(&format!("b{i}.png"), 10 + i, &lit)).collect();
    let dark: Vec<_> = (0..4).map(|i| made(&format!("d{i}.png"), 20 + i, &|_| 0.06)).collect();
    let flat = |frames: &[PathBuf], dark: &[PathBuf]| {
        let mut command = shutterbug();
        command.args(["calibrate", "flat", "--encoding", "linear", "--overwrite"]).args(frames);
        for path in dark {
            command.arg("--dark").arg(path);
        }
        command.arg("--out").arg(path("out")).output().unwrap()
    };
    let a1 = || {
        let report = fs::read_to_string(path("out/report.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        report["flat"]["a1"]["value"].as_f64().unwrap()
    };
    assert_done(&flat(&bright, &dark));
    assert!((a1() + 0.3).abs() < 0.01, "{}", a1());
    let camera = fs::read_to_string(path("out/camera.toml")).unwrap();
    assert!(camera.contains("[black_level]"), "{camera}");
    assert_done(&flat(&bright, &[]));
    assert!((a1() + 0.3).abs() > 0.02, "control: nothing else tells of it, {}", a1());
    let capped = made("capped.png", 30, &|_| 0.002);
    let mixed = [&bright[..2], &[capped]].concat();
    assert_refused(&flat(&mixed, &[]), 1, &["capped.png", "neither black nor white"]);
}

#[test]
fn noise_that_frames_of_a_video_share_opens_the_intervals() {
    let folder = tempfile::tempdir().unwrap();
    // Each frame is a part of the one before; the first ones are not kept.
    let video = |name: &str, kept: f64, light: &dyn Fn(u32, u32) -> f64| -> Vec<PathBuf> {
        let mut dice = Dice(40);
        let mut noise = vec![0.0; 160 * 160];
        let gains: Vec<f64> = (0..160 * 160).map(|_| 1.0 + 0.01 * dice.normal()).collect();
        (0..14)
            .filter_map(|k| {
                noise.iter_mut().for_each(|v| *v = kept * *v + (1.0 - kept) * 4.0 * dice.normal());
                let picture = GrayImage::from_fn(160, 160, |x, y| {
                    let i = (y * 160 + x) as usize;
                    let value = 255.0 * light(x, y) * gains[i] + noise[i];
                    Luma([value.round().clamp(0.0, 255.0) as u8])
                });
                let path = folder.path().join(format!("{name}{k}.png"));
                picture.save(&path).unwrap();
                (k >= 10).then_some(path)
            })
            .collect()
    };
    let report = |kind: &str, frames: &[PathBuf]| {
        let out = folder.path().join(kind);
        let mut command = shutterbug();
        command.args(["calibrate", kind, "--encoding", "linear", "--overwrite"]).args(frames);
        assert_done(&command.arg("--out").arg(&out).output().unwrap());
        let text = fs::read_to_string(out.join("report.json")).unwrap();
        let camera = fs::read_to_string(out.join("camera.toml")).unwrap();
        (serde_json::from_str::<serde_json::Value>(&text).unwrap(), camera)
    };
    for (kept, shares) in [(0.7, true), (0.0, false)] {
        let (flat, camera) = report("flat", &video("flat", kept, &|_, _| 0.5));
        assert_eq!(flat["flat"]["shared_noise"].is_f64(), shares, "{kept}: {}", flat["flat"]);
        assert_eq!(camera.contains("prnu = 0.0\n") || !camera.contains("prnu"), shares, "{camera}");
        let ramp = |x: u32, y: u32| 0.1 + 0.004 * f64::from(x) + 0.0005 * f64::from(y);
        let (noise, camera) = report("noise", &video("ramp", kept, &ramp));
        assert_eq!(noise["notes"].to_string().contains("share noise"), shares, "{}", noise["notes"]);
        assert_eq!(camera.contains("share noise"), shares, "{camera}");
        let ratio = noise["temporal"]["near_over_far"]["value"].as_f64().unwrap();
        assert!((ratio - if shares { 0.3 / 0.51 } else { 1.0 }).abs() < 0.03, "{kept}: {ratio}");
    }
}

#[test]
fn round_dark_corners_are_no_flat_field() {
    let folder = tempfile::tempdir().unwrap();
    let flat = |lit: f64| {
        let frames = (0..2).map(|k| {
            let mut dice = Dice(60 + k);
            let picture = GrayImage::from_fn(200, 160, |x, y| {
                let [dx, dy] = [f64::from(x) - 99.5, f64::from(y) - 79.5];
                let q = (dx * dx + dy * dy) / 16_400.0;
                let light = if q < lit { 0.5 * (1.0 - 0.2 * q) } else { 0.02 };
                Luma([(255.0 * light + 1.5 * dice.normal()).round() as u8])
            });
            let path = folder.path().join(format!("{k}.png"));
            picture.save(&path).unwrap();
            path
        });
        let mut command = shutterbug();
        command.args(["calibrate", "flat", "--encoding", "linear", "--overwrite"]).args(frames);
        command.arg("--out").arg(folder.path().join("out")).output().unwrap()
    };
    assert_refused(&flat(0.9), 1, &["dark corners that no light reaches", "top left", "bottom right"]);
    assert_done(&flat(2.0));
}
