//! The seventh blind set, charts and boards: numbers that hold for the pictures, but not for what they are taken for.

use std::fs;
use std::path::PathBuf;

use image::Luma;

use super::sixth_charts::{FLAT, Folder, boards, flat_field, share_left_of, told};
use super::{assert_done, assert_refused, shutterbug};
use crate::dice_support::Dice;

const SIZE: [u32; 2] = [160, 128];

/// A step of light where `off` (px, by place) is 0, through a Gaussian of 1 px and square pixels.
fn edge(folder: &Folder, name: &str, off: &dyn Fn(f64, f64) -> f64) -> PathBuf {
    let mut dice = Dice(3);
    let noise: Vec<f64> = (0..SIZE[0] * SIZE[1]).map(|_| 0.003 * dice.normal()).collect();
    folder.save(name, SIZE, &|x, y| {
        let inside = |i: u32| {
            let part = |k: u32| (f64::from(k) + 0.5) / 4.0;
            let d = off(f64::from(x) + part(i % 4), f64::from(y) + part(i / 4));
            share_left_of(d)
        };
        let share = (0..16).map(inside).sum::<f64>() / 16.0;
        0.1 + 0.6 * share + noise[(y * SIZE[0] + x) as usize]
    })
}

fn sigma(folder: &Folder, photo: PathBuf) -> [f64; 2] {
    assert_done(&folder.calibrate("edge", &[photo], &[]));
    let found = folder.report()["edge"]["defocus_sigma_px"].clone();
    ["value", "half"].map(|k| found[k].as_f64().unwrap())
}

#[test]
fn an_edge_runs_straight_through_its_part_of_the_picture() {
    let folder = Folder::new();
    let tilted = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        move |x: f64, y: f64| (x - 80.0) * cos + (y - 64.0) * sin
    };
    for degrees in [42.0, 45.0, 48.0] {
        let photo = edge(&folder, &format!("steep{degrees}"), &tilted(degrees));
        assert_refused(&folder.calibrate("edge", &[photo], &[]), 1, &["slanted by 1 to 35 degrees"]);
    }
    let photo = edge(&folder, "steep", &tilted(45.0));
    for region in ["16,64,32,32", "16,70,32,32", "16,76,32,32"] {
        let output = folder.calibrate("edge", std::slice::from_ref(&photo), &["--region", region]);
        assert_refused(&output, 1, &["expected one", "slanted by 1 to 35 degrees"]);
    }
    let arc = edge(&folder, "arc", &|x, y| (x - 80.0).hypot(y - 64.0) - 40.0);
    assert_refused(&folder.calibrate("edge", &[arc], &[]), 1, &["expected", "straight"]);
    let wavy = edge(&folder, "wavy", &|x, y| x - 80.0 - 0.09 * (y - 64.0) + 2.0 * (y / 6.0).sin());
    assert_refused(&folder.calibrate("edge", &[wavy], &[]), 1, &["expected", "straight"]);
    // Controls: straight ones, upright and level.
    for degrees in [5.0, 30.0, 60.0, 86.0] {
        let [value, half] = sigma(&folder, edge(&folder, &format!("good{degrees}"), &tilted(degrees)));
        assert!((value - 1.0).abs() < 0.03 + half && half < 0.1, "{degrees}: {value} +- {half}");
    }
}

/// Stripes of a lamp or of a blind, in front of letters of `contrast` that lie `by` px further.
fn striped(folder: &Folder, name: &str, stripes: &dyn Fn(f64) -> f64, contrast: f64, by: u32) -> PathBuf {
    let mut dice = Dice(name.bytes().map(u64::from).sum::<u64>() + 17);
    let noise: Vec<f64> = (0..SIZE[0] * SIZE[1]).map(|_| 0.004 * dice.normal()).collect();
    folder.save(name, SIZE, &|x, y| {
        let cell = u64::from((x + 40) / 3 + 100 * ((y + 40 - by) / 3));
        let ink = Dice(7919 * cell).roll() < 0.5;
        let thing = if ink { 1.0 - contrast } else { 1.0 };
        stripes(f64::from(y)) * thing + noise[(y * SIZE[0] + x) as usize]
    })
}

#[test]
fn stripes_of_a_scene_that_moves_are_no_lamp() {
    let folder = Folder::new();
    let at = |phase: f64| move |y: f64| if ((y - phase) / 12.0).rem_euclid(1.0) < 0.5 { 0.5 } else { 0.2 };
    let first = striped(&folder, "first", &at(0.0), 0.5, 0);
    let moved = striped(&folder, "moved", &at(4.0), 0.5, 4);
    let hz = ["--led-hz", "500"];
    let output = folder.calibrate("readout", &[first.clone(), moved], &hz);
    assert_refused(&output, 1, &["moved.png: found the scene of", "first.png moved by 0, 4 px", "at rest"]);
    // Control: the lamp alone is another.
    let lamp = striped(&folder, "lamp", &at(4.0), 0.5, 0);
    let output = folder.calibrate("readout", &[first, lamp], &hz);
    assert_done(&output);
    assert!(told(&output).contains("21.3") && !told(&output).contains("WARNING"), "{}", told(&output));
    // Without anything but stripes nothing tells.
    let bare = [("a", 0), ("b", 4)].map(|(name, by)| striped(&folder, name, &at(f64::from(by)), 0.0, by));
    let output = folder.calibrate("readout", &bare, &hz);
    assert_done(&output);
    assert!(told(&output).contains("WARNING: besides the stripes, nothing"), "{}", told(&output));
}

#[test]
fn a_readout_is_no_longer_than_a_frame() {
    let folder = Folder::new();
    // 128 lines in 20 ms under a lamp of 500 Hz.
    let photo = folder.save("striped", SIZE, &|_, y| {
        let cycles = 500.0 * 0.02 / 128.0 * f64::from(y);
        0.4 * (0.05 + if cycles.rem_euclid(1.0) < 0.5 { 1.0 } else { 0.0 })
    });
    let camera = |period_s: f64| {
        let path = folder.path(&format!("{period_s}.toml"));
        let text = format!(
            "width = 160\nheight = 128\nfx = 100.0\nfy = 100.0\ncx = 80.0\ncy = 64.0\nframe_period_s = {period_s}\n"
        );
        fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let run = |hz: &str, period_s: Option<f64>| {
        let mut more = vec!["--led-hz".to_owned(), hz.to_owned()];
        if let Some(period_s) = period_s {
            more.extend(["--camera".to_owned(), camera(period_s)]);
        }
        let more: Vec<&str> = more.iter().map(String::as_str).collect();
        folder.calibrate("readout", std::slice::from_ref(&photo), &more)
    };
    let words = ["striped.png: found stripes that take", "is --led-hz right?"];
    assert_refused(&run("50", Some(0.066)), 1, &[words[0], words[1], "66.000 ms", "0.066.toml"]);
    assert_refused(&run("50", None), 1, &[words[0], words[1], "100.000 ms"]);
    assert!(!folder.path("out").join("camera.toml").exists());
    // Controls.
    assert_done(&run("500", Some(0.066)));
    assert_done(&run("50", Some(0.25)));
}

#[test]
fn pictures_of_two_sensors_are_no_flat_field_of_one() {
    let folder = Folder::new();
    let pictures = flat_field(&folder, "even", &|_, _, _| 0.4);
    let turned = |path: &PathBuf, name: &str| {
        let to = folder.path(&format!("{name}.png"));
        image::imageops::rotate180(&image::open(path).unwrap().to_luma8()).save(&to).unwrap();
        to
    };
    let [a, b] = [0, 1].map(|k| turned(&pictures[k + 2], &format!("turned{k}")));
    let refused = |pictures: &[&PathBuf], words: &[&str]| {
        let pictures: Vec<PathBuf> = pictures.iter().map(|p| (*p).clone()).collect();
        assert_refused(&folder.calibrate("flat", &pictures, &[]), 1, words);
    };
    let p = &pictures;
    refused(&[&p[0], &p[1], &a], &["turned0.png: found a pattern that is not that of", "even0.png"]);
    refused(&[&a, &p[0], &p[1], &p[2]], &["turned0.png: found a pattern", "one sensor"]);
    refused(&[&p[0], &p[1], &a, &b], &["turned0.png: found", "(and so has", "turned1.png)"]);
    // Control: all of them turned are one sensor's again.
    let all: Vec<PathBuf> = (0..4).map(|k| turned(&pictures[k], &format!("all{k}"))).collect();
    assert_done(&folder.calibrate("flat", &all, &[]));
    let value = folder.report()["flat"]["prnu"]["value"].as_f64().unwrap();
    assert!((value / 0.006 - 1.0).abs() < 0.1, "{value}");
}

#[test]
fn offsets_below_black_are_not_known() {
    let folder = Folder::new();
    let bright = flat_field(&folder, "bright", &|_, _, _| 0.4);
    let count = (FLAT[0] * FLAT[1]) as usize;
    let mut dice = Dice(9);
    let offsets: Vec<f64> = (0..count).map(|_| 0.001 * dice.normal()).collect();
    let measured = |name: &str, level: f64| {
        let one = |k: u64| {
            let mut dice = Dice(30 + k);
            let noise: Vec<f64> = (0..count).map(|_| 0.002 * dice.normal()).collect();
            folder.save(&format!("{name}{k}"), FLAT, &|x, y| {
                let i = (y * FLAT[0] + x) as usize;
                level + offsets[i] + noise[i]
            })
        };
        let dark = [0, 1].map(|k| one(k).to_str().unwrap().to_owned());
        let output = folder.calibrate("flat", &bright, &["--dark", &dark[0], "--dark", &dark[1]]);
        assert_done(&output);
        (folder.report()["dark"]["dsnu"].clone(), told(&output))
    };
    for (name, level) in [("cap", -1.0), ("half", 0.0), ("low", 0.002)] {
        let (dsnu, said) = measured(name, level);
        assert!(dsnu.is_null() && said.contains("offsets (DSNU) not known"), "{name}: {dsnu} {said}");
    }
    // Control: above black.
    let (dsnu, said) = measured("above", 0.012);
    assert!((dsnu["value"].as_f64().unwrap() / 0.001 - 1.0).abs() < 0.1, "{dsnu} {said}");
}

/// Frames of a ramp with shot and read noise, in values of 16 bits: `encode` makes them of light.
fn ramps(folder: &Folder, name: &str, encode: &dyn Fn(f64) -> f64) -> Vec<PathBuf> {
    let mut dice = Dice(21);
    let mut one = |k: u32| {
        let path = folder.path(&format!("{name}{k}.png"));
        let picture = image::ImageBuffer::<Luma<u16>, Vec<u16>>::from_fn(SIZE[0], SIZE[1], |x, y| {
            let light = 0.1 + 0.6 * f64::from(x) / f64::from(SIZE[0]) + 0.05 * (f64::from(y) / 7.0).sin();
            let seen = light + (light / 1000.0 + 2.5e-5).sqrt() * dice.normal();
            Luma([(65_535.0 * encode(seen.clamp(0.0, 1.0))).round() as u16])
        });
        picture.save(&path).unwrap();
        path
    };
    (0..2).map(&mut one).collect()
}

#[test]
fn another_encoding_than_the_pictures_have_is_no_camera() {
    let folder = Folder::new();
    let srgb = |v: f64| if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    let [encoded, linear] = [ramps(&folder, "srgb", &srgb), ramps(&folder, "linear", &|v| v)];
    let output = folder.calibrate("noise", &encoded, &["--encoding", "linear"]);
    assert_refused(&output, 1, &["srgb0.png: found noise that is no line over intensity", "--encoding"]);
    assert!(!folder.path("out").join("camera.toml").exists());
    // Controls.
    assert_done(&folder.calibrate("noise", &encoded, &[]));
    assert_done(&folder.calibrate("noise", &linear, &["--encoding", "linear"]));
    let full_well = folder.report()["real"]["fits"][0]["full_well_e"]["value"].as_f64().unwrap();
    assert!((full_well / 1000.0 - 1.0).abs() < 0.1, "{full_well}");
}

#[test]
fn values_that_are_not_scaled_to_white_are_named() {
    let folder = Folder::new();
    let twelve = ramps(&folder, "twelve", &|v| v / 16.0);
    let output = folder.calibrate("noise", &twelve, &["--encoding", "linear"]);
    assert_refused(&output, 1, &["twelve0.png: found", "all values lie in the lowest 1/16", "of 12 bits"]);
    let whole = ramps(&folder, "whole", &|v| v);
    assert_done(&folder.calibrate("noise", &whole, &["--encoding", "linear"]));
}

#[test]
fn a_board_of_metres_is_asked_for_its_unit() {
    let folder = Folder::new();
    let photos = boards(&folder, "photos", &|_| 1.0);
    let said = |side: &str| {
        let mut command = shutterbug();
        command.arg("board").arg(&photos).arg("--out").arg(folder.path("board"));
        let output = command.args(["--size", "7x4", "--square-m", side, "--overwrite"]).output().unwrap();
        assert_done(&output);
        told(&output)
    };
    let mm = said("30");
    assert!(mm.contains("WARNING: a side of 30 m") && mm.contains("is it in mm?"), "{mm}");
    assert!(!said("0.03").contains("WARNING"), "control");
}
