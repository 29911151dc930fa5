//! The sixth blind set, charts and boards: pictures that are not what the measurement takes them for are refused, or
//! what they cannot tell is said.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use image::{GrayImage, Luma};
use serde_json::Value;

use super::{assert_done, assert_refused, shutterbug};
use crate::dice_support::Dice;

/// Pictures of one measurement, and where its results go.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn save(&self, name: &str, size: [u32; 2], light: &dyn Fn(u32, u32) -> f64) -> PathBuf {
        let path = self.path(&format!("{name}.png"));
        GrayImage::from_fn(size[0], size[1], |x, y| Luma([encoded(light(x, y))])).save(&path).unwrap();
        path
    }

    fn calibrate(&self, what: &str, pictures: &[PathBuf], more: &[&str]) -> Output {
        let mut command = shutterbug();
        command.args(["calibrate", what]).args(pictures).arg("--out").arg(self.path("out")).args(more);
        command.arg("--overwrite").output().unwrap()
    }

    fn report(&self) -> Value {
        report(&self.path("out"))
    }
}

fn report(out: &Path) -> Value {
    serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap()
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// sRGB.
fn encoded(light: f64) -> u8 {
    let v = light.clamp(0.0, 1.0);
    let v = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (255.0 * v).round() as u8
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
