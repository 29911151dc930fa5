//! The sixth blind set, charts and boards: pictures that are not what the measurement takes them for are refused, or
//! what they cannot tell is said.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use image::{GrayImage, Luma};
use serde_json::Value;

use super::{assert_done, assert_refused, shutterbug};
use crate::board_support::Oracle;
use crate::dice_support::Dice;

/// Pictures of one measurement, and where its results go.
pub(super) struct Folder(tempfile::TempDir);

impl Folder {
    pub(super) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(super) fn save(&self, name: &str, size: [u32; 2], light: &dyn Fn(u32, u32) -> f64) -> PathBuf {
        let path = self.path(&format!("{name}.png"));
        GrayImage::from_fn(size[0], size[1], |x, y| Luma([encoded(light(x, y))])).save(&path).unwrap();
        path
    }

    pub(super) fn calibrate(&self, what: &str, pictures: &[PathBuf], more: &[&str]) -> Output {
        let mut command = shutterbug();
        command.args(["calibrate", what]).args(pictures).arg("--out").arg(self.path("out")).args(more);
        command.arg("--overwrite").output().unwrap()
    }

    pub(super) fn report(&self) -> Value {
        report(&self.path("out"))
    }
}

fn report(out: &Path) -> Value {
    serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap()
}

pub(super) fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// sRGB.
pub(super) fn encoded(light: f64) -> u8 {
    let v = light.clamp(0.0, 1.0);
    let v = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (255.0 * v).round() as u8
}

/// The normal distribution within a hundredth (Page, Applied Statistics 26, 1977).
pub(super) fn share_left_of(x: f64) -> f64 {
    0.5 * (1.0 + (0.797_885 * (x + 0.044_715 * x.powi(3))).tanh())
}

/// A ramp of boxes, or the same turned upside down, with the noise of a sensor.
fn noisy_scene(folder: &Folder, name: &str, turned: bool, seed: u64) -> PathBuf {
    let mut dice = Dice(seed);
    let size = [160u32, 120];
    let noise: Vec<f64> = (0..size[0] * size[1]).map(|_| dice.normal()).collect();
    folder.save(name, size, &|x, y| {
        let (u, v) = if turned { (size[0] - 1 - x, size[1] - 1 - y) } else { (x, y) };
        let level = 0.02 + 0.9 * f64::from(u) / f64::from(size[0]);
        let light = if (u / 20 + v / 20) % 2 == 0 { 0.5 * level } else { level };
        light + (light / 2000.0 + 9e-6).sqrt() * noise[(y * size[0] + x) as usize]
    })
}

#[test]
fn noise_of_four_frames_is_compared() {
    let folder = Folder::new();
    let frames: Vec<_> = (0..4).map(|k| noisy_scene(&folder, &k.to_string(), false, 1 + k)).collect();
    let output = folder.calibrate("noise", &frames, &[]);
    assert_done(&output);
    assert!(!told(&output).contains("not compared"), "{}", told(&output));
    let compared = &folder.report()["comparison"];
    for c in 0..3 {
        assert!(compared["variance_ratio"][c].as_array().unwrap().len() > 5, "{compared}");
        let off = compared["mean_deviation"][c].as_f64().unwrap();
        assert!(off > 0.0 && off < 0.2, "{compared}");
    }
}

#[test]
fn another_scene_among_the_frames_is_named() {
    let folder = Folder::new();
    let [a, b, c] = [1, 2, 3].map(|k| noisy_scene(&folder, &format!("a{k}"), false, k));
    let [p, q] = [4, 5].map(|k| noisy_scene(&folder, &format!("b{k}"), true, k));
    let refused = |frames: &[&PathBuf], words: &[&str]| {
        let frames: Vec<PathBuf> = frames.iter().map(|f| (*f).clone()).collect();
        assert_refused(&folder.calibrate("noise", &frames, &[]), 1, words);
    };
    refused(&[&a, &b, &p], &["b4.png: found", "expected the static scene of", "a1.png"]);
    refused(&[&a, &b, &p, &q], &["b4.png: found", "(and so with", "b5.png"]);
    refused(&[&p, &a, &b, &c], &["b4.png: found", "--pairs"]);
    // Control.
    assert_done(&folder.calibrate("noise", &[a.clone(), b.clone(), c], &[]));
    assert_done(&folder.calibrate("noise", &[a, b, p, q], &["--pairs"]));
}

pub(super) const FLAT: [u32; 2] = [256, 192];

/// Pictures of a flat field with a pattern of 0.6 %, of which `light` is what shines on a pixel of the k-th.
pub(super) fn flat_field(folder: &Folder, name: &str, light: &dyn Fn(f64, f64, u32) -> f64) -> Vec<PathBuf> {
    let mut dice = Dice(5);
    let count = (FLAT[0] * FLAT[1]) as usize;
    let gains: Vec<f64> = (0..count).map(|_| 1.0 + 0.006 * dice.normal()).collect();
    let one = |k: u32| {
        let mut dice = Dice(100 + u64::from(k));
        let noise: Vec<f64> = (0..count).map(|_| 0.018 * dice.normal()).collect();
        folder.save(&format!("{name}{k}"), FLAT, &|x, y| {
            let i = (y * FLAT[0] + x) as usize;
            light(f64::from(x), f64::from(y), k) * (gains[i] + noise[i])
        })
    };
    (0..4).map(one).collect()
}

#[test]
fn a_texture_is_no_pattern_of_a_sensor() {
    use std::f64::consts::TAU;
    let folder = Folder::new();
    let refused = |name: &str, light: &dyn Fn(f64, f64, u32) -> f64| {
        let pictures = flat_field(&folder, name, light);
        assert_refused(&folder.calibrate("flat", &pictures, &[]), 1, &["a pattern that is no pixel's own"]);
    };
    refused("wallpaper", &|x, y, _| 0.4 + 0.15 * (TAU * x / 16.0).sin() * (TAU * y / 16.0).sin());
    refused("blinds", &|x, y, _| 0.4 + 0.15 * (TAU * (x + y) / 16.0).sin());
    refused("waves", &|x, y, _| 0.2 + 0.5 * ((x / 5.0).sin() * (y / 7.0).cos()).abs());
    // Letters of 5x7 cells of a px or two, in lines of 14 px, no two lines alike.
    let ink = |x: f64, y: f64| {
        let (column, row) = ((x / 6.0) as u32, (y / 14.0) as u32);
        let (i, j) = (x as u32 % 6, y as u32 % 14 / 2);
        let letter = Dice(u64::from(97 * column + 7919 * row)).roll();
        let cell = Dice((letter * 26.0) as u64 * 64 + u64::from(i + 8 * j)).roll();
        i < 5 && j < 5 && cell < 0.45
    };
    refused("text", &|x, y, _| if ink(x, y) { 0.2 } else { 0.6 });
    // Control; and what pictures at rest cannot tell is said.
    let output = folder.calibrate("flat", &flat_field(&folder, "even", &|_, _, _| 0.4), &[]);
    assert_done(&output);
    assert!(told(&output).contains("only a camera that is shifted"), "{}", told(&output));
}

#[test]
fn bands_of_a_lamp_that_flickers_are_no_noise_of_pixels() {
    let folder = Folder::new();
    let measured = |name: &str, depth: f64| {
        let light = |_: f64, y: f64, k: u32| 0.4 * (1.0 + depth * (y / 12.0 + 1.3 * f64::from(k)).sin());
        let output = folder.calibrate("flat", &flat_field(&folder, name, &light), &[]);
        assert_done(&output);
        (folder.report()["flat"].clone(), told(&output))
    };
    let (still, said) = measured("still", 0.0);
    assert!(still["bands"].is_null() && !said.contains("lamp"), "{said}");
    for depth in [0.05, 0.3] {
        let (flat, said) = measured(&format!("flicker{depth}-"), depth);
        let prnu = flat["prnu"]["value"].as_f64().unwrap();
        assert!((prnu / 0.006 - 1.0).abs() < 0.1, "{depth}: {prnu}");
        let noise = flat["temporal"].as_f64().unwrap() / still["temporal"].as_f64().unwrap();
        assert!((noise - 1.0).abs() < 0.05, "{depth}: {noise} times the noise");
        assert!(flat["bands"]["rows"].as_bool().unwrap(), "{flat}");
        assert!(said.contains("rows differ by") && said.contains("whole periods of the lamp"), "{said}");
    }
}

#[test]
fn a_dark_frame_is_no_fall_off() {
    let folder = Folder::new();
    for (name, wide) in [("thin", 1.0), ("wide", 10.0)] {
        let light = |x: f64, _: f64, _: u32| if x < wide || x >= 256.0 - wide { 0.0 } else { 0.4 };
        let output = folder.calibrate("flat", &flat_field(&folder, name, &light), &[]);
        let words =
            [format!("a dark frame that no light reaches: {wide} columns on the left, {wide} columns")];
        assert_refused(&output, 1, &[words[0].as_str(), "cropped to what the lens lights"]);
    }
    // Control: a lens that leaves the corners half.
    let light = |x: f64, y: f64, _: u32| {
        let q = ((x - 128.0).powi(2) + (y - 96.0).powi(2)) / 25_600.0;
        0.5 * (1.0 - 0.5 * q)
    };
    assert_done(&folder.calibrate("flat", &flat_field(&folder, "lens", &light), &[]));
}

/// A card with sharp sides and a soft shadow, which is the wider and clearer of the two.
#[test]
fn the_sharpest_edge_is_the_lens_and_no_shadow() {
    let folder = Folder::new();
    let mut dice = Dice(11);
    let size = [320u32, 240];
    let noise: Vec<f64> = (0..size[0] * size[1]).map(|_| 0.002 * dice.normal()).collect();
    // The part of a step of that sigma, with square pixels.
    let step = |d: f64, sigma: f64| 0.5 * (1.0 + (d / sigma * 0.85).tanh());
    let photo = folder.save("wall", size, &|x, y| {
        let (u, v) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let shadow = step(u - 230.0 - 0.08 * v, 6.0);
        // A small card, turned by five degrees.
        let (du, dv) = (u - 80.0 - 0.0875 * (v - 120.0), v - 120.0 + 0.0875 * (u - 80.0));
        let card = step(30.0 - du.abs(), 0.6) * step(30.0 - dv.abs(), 0.6);
        (0.1 + 0.5 * shadow) * (1.0 - 0.5 * card) + noise[(y * size[0] + x) as usize]
    });
    let output = folder.calibrate("edge", std::slice::from_ref(&photo), &[]);
    assert_done(&output);
    let edge = &folder.report()["edge"];
    let sigma = edge["defocus_sigma_px"]["value"].as_f64().unwrap();
    assert!(sigma < 1.0, "{edge}");
    let softest =
        edge["among_px"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).fold(0.0, f64::max);
    assert!(softest > 3.0, "control: the shadow was measured as well: {edge}");
    assert!(told(&output).contains("the sharpest of "), "{}", told(&output));
}

#[test]
fn stripes_that_may_be_aliased_name_the_other_readouts() {
    let folder = Folder::new();
    // 192 lines in 20 ms under a lamp of 9 kHz.
    let photo = folder.save("striped", [256, 192], &|_, y| {
        let cycles = 9000.0 * 0.02 / 192.0 * f64::from(y);
        0.4 * (0.05 + if cycles.rem_euclid(1.0) < 0.5 { 1.0 } else { 0.0 })
    });
    let output = folder.calibrate("readout", std::slice::from_ref(&photo), &["--led-hz", "9000"]);
    assert_done(&output);
    let others = folder.report()["other_readouts_s"].as_array().unwrap().clone();
    assert!(others.iter().any(|s| (s.as_f64().unwrap() / 0.02 - 1.0).abs() < 0.01), "{others:?}");
    assert!(
        told(&output).contains(" 20.0") && told(&output).contains("A lamp of less than 960 Hz"),
        "{}",
        told(&output)
    );
    // Control: a slow lamp leaves one.
    let photo = folder.save("slow", [256, 192], &|_, y| {
        let cycles = 500.0 * 0.02 / 192.0 * f64::from(y);
        0.4 * (0.05 + if cycles.rem_euclid(1.0) < 0.5 { 1.0 } else { 0.0 })
    });
    assert_done(&folder.calibrate("readout", &[photo], &["--led-hz", "500"]));
    assert_eq!(folder.report()["other_readouts_s"], Value::Array(Vec::new()));
}

#[test]
fn what_is_wrong_is_named_by_its_own_name() {
    let folder = Folder::new();
    let empty = folder.path("empty");
    fs::create_dir(&empty).unwrap();
    let output = folder.calibrate("flat", std::slice::from_ref(&empty), &[]);
    assert_refused(&output, 1, &["no picture; expected pictures as .png or .jpg"]);
    let bright = flat_field(&folder, "bright", &|_, _, _| 0.4);
    let dark = folder.save("small", [256, 190], &|_, _| 0.01);
    let output = folder.calibrate("flat", &bright, &["--dark", dark.to_str().unwrap()]);
    assert_refused(&output, 1, &["small.png: found 256x190 px; expected 256x192 px as in", "bright0.png"]);
    let board = |more: &[&str]| {
        let mut command = shutterbug();
        command.arg("board").args(&bright).arg("--out").arg(folder.path("board")).args(more).output().unwrap()
    };
    let charuco = ["--pattern", "charuco", "--size", "8x6"];
    let output = board(&[&charuco[..], &["--dictionary", "DICT_X"]].concat());
    assert_refused(&output, 2, &["--dictionary: found the dictionary `DICT_X`"]);
}

/// Photographs of a board of 7x4 inner corners, by cameras whose focal length `times` multiplies.
pub(super) fn boards(folder: &Folder, name: &str, times: &dyn Fn(u32) -> f64) -> PathBuf {
    let photos = folder.path(name);
    fs::create_dir(&photos).unwrap();
    for i in 0..7 {
        let a = f64::from(i);
        let mut oracle = Oracle::new();
        oracle.focal_px *= times(i);
        let angles = [0.5 * (1.7 * a).sin(), 0.5 * (2.3 * a + 1.0).sin(), 0.4 * (a * 1.1).sin()];
        let shift = [0.05 * (1.3 * a).cos(), 0.03 * (2.1 * a).sin()];
        let pose = oracle.looking(angles, shift, 0.2 + 0.01 * a);
        let picture = oracle.photograph(|_| pose, 0.0);
        shutterbug::plane::write_png_atomic(&photos.join(format!("{i:02}.png")), &picture).unwrap();
    }
    photos
}

pub(super) fn board(folder: &Folder, photos: &Path, size: &str, more: &[&str]) -> Output {
    let mut command = shutterbug();
    command.arg("board").arg(photos).arg("--out").arg(folder.path("board"));
    command.args(["--size", size, "--square-m", "0.03", "--overwrite"]).args(more).output().unwrap()
}

#[test]
fn a_board_of_another_size_is_named() {
    let folder = Folder::new();
    let photos = boards(&folder, "photos", &|_| 1.0);
    assert_refused(&board(&folder, &photos, "6x4", &[]), 2, &["--size: found grids of 7x4", "expected 7x4"]);
}

#[test]
fn pictures_of_several_cameras_are_named() {
    let folder = Folder::new();
    let photos = boards(&folder, "one", &|_| 1.0);
    let output = board(&folder, &photos, "7x4", &[]);
    assert_done(&output);
    assert!(!told(&output).contains("WARNING"), "{}", told(&output));
    let photos = boards(&folder, "zoomed", &|i| if i % 2 == 0 { 1.0 } else { 0.85 });
    let output = board(&folder, &photos, "7x4", &[]);
    assert_done(&output);
    let said = told(&output);
    assert!(said.contains("ask for a focal length of their own") && said.contains("03.png"), "{said}");
    let report: Value =
        serde_json::from_slice(&fs::read(folder.path("board").join("board.json")).unwrap()).unwrap();
    assert!(!report["one_camera"]["own_focal_length"].as_array().unwrap().is_empty(), "{report}");
}
