//! The seventh blind set, pairs of pictures: what lies in a few places is no small gap, and frames that show no one
//! place are not said to be alike.

use std::fs;
use std::path::{Path, PathBuf};

use image::{Rgb, RgbImage};
use serde_json::Value;

use super::{assert_done, shutterbug};
use crate::dice_support::Dice;

const SIZE: [u32; 2] = [96, 72];
const FRAMES: u32 = 8;

/// A wall of smooth spots, some px further to the left in each frame, with a little noise.
fn wall(frame: u32) -> RgbImage {
    let mut dice = Dice(u64::from(frame) + 5);
    let mut noise = move || 1.5 * dice.normal();
    RgbImage::from_fn(SIZE[0], SIZE[1], |x, y| {
        let (x, y) = (f64::from(x) + 1.7 * f64::from(frame), f64::from(y));
        let value = |a: f64, b: f64, c: f64| {
            let slope = 60.0 + 0.9 * y + 0.3 * x;
            slope + 25.0 * ((x / a).sin() + (y / b).cos()) + 12.0 * ((x + y) / c).sin()
        };
        Rgb([value(9.0, 7.0, 23.0), value(11.0, 8.0, 31.0), value(13.0, 6.0, 17.0)]
            .map(|v| (v + noise()) as u8))
    })
}

/// The verdict on a folder of walls beside the same ones, changed.
fn told(change: &dyn Fn(RgbImage) -> RgbImage) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let save = |name: &str, i: u32, picture: &RgbImage| {
        fs::create_dir_all(path(name)).unwrap();
        picture.save(path(name).join(format!("{i:06}.png"))).unwrap();
    };
    for i in 0..FRAMES {
        save("sim", i, &wall(i));
        save("real", i, &change(wall(i)));
    }
    report(&path("sim"), &path("real"), &path("out"))
}

fn report(sim: &Path, real: &Path, out: &PathBuf) -> Value {
    let mut command = shutterbug();
    command.arg("diagnose").arg("--sim").arg(sim).arg("--real").arg(real).arg("--out").arg(out);
    // What takes longest and none of these pictures has.
    command.args([
        "--without",
        "lens_distortion,rolling_shutter,motion_blur,time_offset,pose_offset,jpeg,flicker",
    ]);
    assert_done(&command.output().unwrap());
    serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap()
}

#[test]
fn a_box_in_every_frame_is_a_gap() {
    let boxed = told(&|mut picture| {
        for (x, y) in (60..80).flat_map(|x| (10..18).map(move |y| (x, y))) {
            picture.put_pixel(x, y, Rgb([255; 3]));
        }
        picture
    });
    assert_eq!(boxed["verdict"], "unknown_effect", "{}", boxed["sentence"]);
    let same = told(&|picture| picture);
    assert_eq!(same["verdict"], "no_gap", "control: {}", same["sentence"]);
}

#[test]
fn pairs_of_no_one_place_are_not_alike() {
    let turned = told(&|picture| image::imageops::flip_vertical(&picture));
    let sentence = turned["sentence"].as_str().unwrap();
    assert_eq!(turned["verdict"], "undetermined", "{sentence}");
    assert!(
        sentence.contains("do not show the same place") && sentence.contains("upside down"),
        "{sentence}"
    );
    let warnings = turned["warnings"].to_string();
    assert!(warnings.contains("--unpaired"), "{warnings}");
}

/// What blurs the real frames takes their grain, and noise of rows is not what they lack.
#[test]
#[ignore = "long: a quarter of a minute"]
fn what_makes_other_traces_differ_is_not_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for name in ["sim", "real"] {
        fs::create_dir_all(path(name)).unwrap();
    }
    for i in 0..FRAMES {
        let (sim, mut dice) = (wall(i), Dice(u64::from(i) + 99));
        // Single pixels that stand out, of one kind in the simulation and of another in the real frames.
        let grain =
            |x: u32, y: u32, strong: f64| if (x * 7 + y * 13 + i).is_multiple_of(31) { strong } else { 0.0 };
        let noisy = RgbImage::from_fn(SIZE[0], SIZE[1], |x, y| {
            let more = 4.0 * dice.normal() + grain(x, y, 3.0);
            Rgb(sim.get_pixel(x, y).0.map(|v| (f64::from(v) + more).clamp(0.0, 255.0) as u8))
        });
        noisy.save(path("sim").join(format!("{i:06}.png"))).unwrap();
        image::imageops::blur(&noisy, 3.0).save(path("real").join(format!("{i:06}.png"))).unwrap();
    }
    let mut command = shutterbug();
    command.args(["diagnose", "--unpaired", "--sim"]).arg(path("sim")).arg("--real").arg(path("real"));
    command.args(["--without", "bayer_mosaic,sharpening,chromatic_aberration,chroma_subsampling,jpeg"]);
    assert_done(&command.arg("--out").arg(path("out")).output().unwrap());
    let report: Value = serde_json::from_slice(&fs::read(path("out").join("report.json")).unwrap()).unwrap();
    let named: Vec<_> =
        report["effects"].as_array().unwrap().iter().map(|e| e["name"].as_str().unwrap()).collect();
    let noises = ["row_noise", "shot_noise", "read_noise", "fixed_pattern_noise", "hot_pixels"];
    assert!(!named.iter().any(|n| noises.contains(n)), "{named:?}: {}", report["sentence"]);
    assert_eq!(report["verdict"], "unknown_effect", "{}", report["sentence"]);
}
