//! The fifth blind set: pictures beside simulated ones that are not what they pass for. Nothing is named, or said to be
//! alike, that such pictures cannot show.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::time::Instant;

use image::{GrayImage, Luma};
use serde_json::Value;

use super::{assert_done, shutterbug};
use crate::long_support::{left_out, long};

const SIZE: [u32; 2] = [160, 120];
const FRAMES: u32 = 10;

/// Smooth and sharp things that pass by at 2 px a frame, 40 to 215 DN.
fn content(x: f64, y: f64, seed: u32) -> f64 {
    let cell = |i: i64, j: i64| {
        let hash = (i as u32).wrapping_mul(0x9E37_79B1) ^ (j as u32).wrapping_mul(0x85EB_CA77) ^ seed;
        f64::from(hash.wrapping_mul(hash ^ (hash >> 15)) >> 16) / 65535.0
    };
    let (u, v) = ((x / 13.0), (y / 13.0));
    let soft = |f: f64| f * f * (3.0 - 2.0 * f);
    let (i, j, fx, fy) = (u.floor(), v.floor(), soft(u - u.floor()), soft(v - v.floor()));
    let at = |di: f64, dj: f64| cell((i + di) as i64, (j + dj) as i64);
    let row = |dj: f64| at(0.0, dj) * (1.0 - fx) + at(1.0, dj) * fx;
    let smooth = row(0.0) * (1.0 - fy) + row(1.0) * fy;
    let boxed = cell((x / 41.0).floor() as i64 + 77, (y / 37.0).floor() as i64);
    40.0 + 175.0 * if boxed > 0.55 { boxed } else { smooth }
}

fn frame(k: u32, seed: u32) -> GrayImage {
    GrayImage::from_fn(SIZE[0], SIZE[1], |x, y| {
        Luma([content(f64::from(x) + 2.0 * f64::from(k), f64::from(y), seed) as u8])
    })
}

/// A folder of simulated frames, and one of "real" ones by name.
struct Folders(tempfile::TempDir);

impl Folders {
    fn new(real: &BTreeMap<&str, &dyn Fn(u32) -> GrayImage>) -> Self {
        let folders = Self(tempfile::tempdir().unwrap());
        let put = |name: &str, of: &dyn Fn(u32) -> GrayImage| {
            fs::create_dir(folders.path(name)).unwrap();
            (0..FRAMES).for_each(|k| of(k).save(folders.path(name).join(format!("{k:06}.png"))).unwrap());
        };
        put("sim", &|k| frame(k, 1));
        real.iter().for_each(|(name, of)| put(name, of));
        folders
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn diagnose(&self, real: &str, more: &[&str]) -> Value {
        let out = self.path(&format!("out-{real}{}", more.len()));
        let output: Output = self.command(real, &out, more).output().unwrap();
        assert_done(&output);
        serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap()
    }

    fn command(&self, real: &str, out: &Path, more: &[&str]) -> std::process::Command {
        let mut command = shutterbug();
        command.arg("diagnose").arg("--sim").arg(self.path("sim")).arg("--real").arg(self.path(real));
        command.arg("--out").arg(out).args(more);
        command
    }
}

fn names(report: &Value) -> Vec<&str> {
    report["effects"].as_array().unwrap().iter().map(|e| e["name"].as_str().unwrap()).collect()
}

/// A text in the corner, white.
fn with_text(k: u32) -> GrayImage {
    let mut picture = frame(k, 1);
    for (x, y) in (0..60).flat_map(|x| (0..9).map(move |y| (x, y))) {
        // Stems, bars and dots of one px.
        if x % 6 == 1 || (x % 6 < 5 && y % 4 == 0) || (x % 6 == 3 && y == 6) {
            picture.put_pixel(5 + x, 5 + y, Luma([255]));
        }
    }
    picture
}

#[test]
#[ignore = "long: half a minute"]
fn a_text_on_the_frames_is_no_stuck_pixels() {
    let folders = Folders::new(&[("text", &with_text as &dyn Fn(u32) -> GrayImage)].into());
    for more in [&[][..], &["--unpaired"]] {
        let report = folders.diagnose("text", more);
        assert!(!names(&report).contains(&"hot_pixels"), "{more:?}: {}", report["sentence"]);
        assert!(report["verdict"] != "explained", "{more:?}: {}", report["sentence"]);
    }
}

#[test]
fn what_was_not_compared_is_not_said_to_be_alike() {
    let beside = |k: u32| {
        let moved = |x: u32, y: u32| content(f64::from(x + 2 * k), f64::from(y) + 2.0, 1) as u8;
        GrayImage::from_fn(SIZE[0], SIZE[1], |x, y| Luma([moved(x, y)]))
    };
    let one = |_: u32| frame(5, 1);
    let real: [(&str, &dyn Fn(u32) -> GrayImage); 2] = [("beside", &beside), ("one", &one)];
    let folders = Folders::new(&real.into());
    let report = folders.diagnose("beside", &[]);
    let sentence = report["sentence"].as_str().unwrap();
    assert!(sentence.contains("Where things lie was not judged: the real frames lie 2.0 px"), "{sentence}");
    assert!(names(&report).is_empty(), "{sentence}");
    if !long() {
        return left_out("what_was_not_compared", "one picture many times");
    }
    let report = folders.diagnose("one", &[]);
    let sentence = report["sentence"].as_str().unwrap();
    assert!(names(&report).is_empty() && report["verdict"] == "undetermined", "{sentence}");
}

#[test]
#[ignore = "long: a minute or two"]
fn folders_that_are_coded_or_mixed_otherwise_have_no_noise() {
    let limited = |k: u32| {
        let squeezed = |v: u8| (16.0 + f64::from(v) * 219.0 / 255.0).round() as u8;
        GrayImage::from_fn(SIZE[0], SIZE[1], |x, y| Luma([squeezed(frame(k, 1).get_pixel(x, y).0[0])]))
    };
    let interlaced = |k: u32| {
        let (even, odd) = (frame(k, 1), frame(k + 1, 1));
        GrayImage::from_fn(SIZE[0], SIZE[1], |x, y| *if y % 2 == 0 { &even } else { &odd }.get_pixel(x, y))
    };
    let real: [(&str, &dyn Fn(u32) -> GrayImage); 2] = [("limited", &limited), ("interlaced", &interlaced)];
    let folders = Folders::new(&real.into());
    for name in ["limited", "interlaced"] {
        // What is tried beside noise takes minutes.
        let others = "bayer_mosaic,hot_pixels,noise_reduction,defocus,sharpening,chromatic_aberration";
        let report = folders.diagnose(name, &["--unpaired", "--without", others]);
        let noise = names(&report).into_iter().find(|n| n.contains("noise"));
        assert_eq!(noise, None, "{name}: {}", report["sentence"]);
        let gap = |key: &str| report["gap"][key].as_f64().unwrap();
        assert!(gap("after") <= gap("before"), "{name}: {}", report["gap"]);
    }
}

/// Pairs that do not show the same place are compared as with `--unpaired`, and can be interrupted as these.
#[cfg(unix)]
#[test]
fn pairs_that_fall_back_can_be_interrupted() {
    let other = |k: u32| frame(3 * k, 99);
    let folders = Folders::new(&[("other", &other as &dyn Fn(u32) -> GrayImage)].into());
    let out = folders.path("out");
    let mut child = folders.command("other", &out, &[]).stderr(Stdio::piped()).spawn().unwrap();
    let said = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut lines = std::io::BufRead::lines(said).map_while(Result::ok);
    assert!(lines.any(|l| l.contains("effects that leave marks")), "it ended before it could be interrupted");
    let begun = Instant::now();
    assert!(std::process::Command::new("kill").arg(child.id().to_string()).status().unwrap().success());
    let rest: Vec<String> = lines.collect();
    let status = child.wait().unwrap();
    assert_eq!(status.code(), Some(1), "after {:?}: {rest:?}", begun.elapsed());
    assert!(rest.iter().any(|l| l.contains("interrupted at")), "{rest:?}");
    assert!(!out.join("report.json").exists());
}
