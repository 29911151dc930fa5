//! The eighth blind set: charts, boards and tables that are not of what they are taken for.

use std::f64::consts::TAU;
use std::fs;
use std::path::PathBuf;

use image::{Rgb, RgbImage};

use super::sixth_charts::{FLAT, Folder, boards, encoded, flat_field, share_left_of, told};
use super::{assert_done, assert_refused, said, shutterbug};
use crate::dice_support::Dice;

/// A picture of light along its rows, with a little noise.
fn lines(folder: &Folder, name: &str, light: &dyn Fn(f64, f64) -> f64) -> PathBuf {
    let mut dice = Dice(9);
    let size = [160, 200];
    let noise: Vec<f64> = (0..size[0] * size[1]).map(|_| 0.004 * dice.normal()).collect();
    folder.save(name, size, &|x, y| {
        light(f64::from(x), f64::from(y)) * (1.0 + noise[(y * size[0] + x) as usize])
    })
}

#[test]
fn light_that_changes_slowly_is_no_stripes() {
    let folder = Folder::new();
    let readout = |photo: PathBuf| folder.calibrate("readout", &[photo], &["--led-hz", "500"]);
    let spot = |x: f64, y: f64| 0.8 / (1.0 + ((x - 48.0).powi(2) + (y - 60.0).powi(2)) / 3600.0);
    for (name, light) in [
        ("ramp", &(|_, y| 0.1 + 0.8 * y / 200.0) as &dyn Fn(f64, f64) -> f64),
        ("mild", &|_, y| 0.2 + 0.6 * y / 200.0),
        ("spot", &spot),
    ] {
        let output = readout(lines(&folder, name, light));
        assert_done(&output);
        let camera = fs::read_to_string(folder.path("out/camera.toml")).unwrap_or_default();
        assert!(!camera.contains("[rolling_shutter]"), "{name}: {}", told(&output));
        assert!(told(&output).contains("no stripes"), "{name}: {}", told(&output));
    }
    // Stripes are told all the same, few or many, and their interval holds the readout: periods over 500 Hz.
    for periods in [3.2, 10.0] {
        let photo = lines(&folder, "stripes", &|_, y| 0.4 * (1.0 + 0.5 * (TAU * y * periods / 200.0).sin()));
        assert_done(&readout(photo));
        let found = folder.report()["stripes"]["readout"].clone();
        let [low, high] = [0, 1].map(|i| found["ci95_s"][i].as_f64().unwrap());
        let truth = periods / 500.0;
        assert!(low < truth && truth < high && high - low < 0.01 * truth, "{periods}: {found}");
    }
}

#[test]
fn corners_of_other_pictures_are_refused() {
    let folder = Folder::new();
    let photos = boards(&folder, "photos", &|_| 1.0);
    let board = |more: &[&str]| {
        let mut command = shutterbug();
        command.arg("board").arg(&photos).arg("--out").arg(folder.path("board")).args(more);
        command.args(["--size", "7x4", "--square-m", "0.03", "--overwrite"]).output().unwrap()
    };
    assert_done(&board(&[]));
    let right = fs::read_to_string(folder.path("board/corners.csv")).unwrap();
    let table = folder.path("corners.csv");
    let given = |change: &dyn Fn(&[&str]) -> Vec<String>| {
        let mut lines = right.lines();
        let mut text = format!("{}\n", lines.next().unwrap());
        for line in lines {
            text += &format!("{}\n", change(&line.split(',').collect::<Vec<_>>()).join(","));
        }
        fs::write(&table, text).unwrap();
        board(&["--corners", table.to_str().unwrap()])
    };
    let own = |fields: &[&str]| -> Vec<String> { fields.iter().map(|f| (*f).to_owned()).collect() };
    // Control: its own corners.
    assert_done(&given(&own));
    let number = |text: &str| -> f64 { text.parse().unwrap() };
    let halved = |fields: &[&str]| {
        let mut out = own(fields);
        let last = out.len();
        (last - 2..last).for_each(|i| out[i] = format!("{:.3}", 0.5 * number(fields[i])));
        out
    };
    let swapped = |fields: &[&str]| {
        let mut out = own(fields);
        let last = out.len();
        out.swap(last - 2, last - 1);
        out
    };
    for change in [&halved as &dyn Fn(&[&str]) -> Vec<String>, &swapped] {
        assert_refused(&given(change), 1, &["corners.csv: found corners that are not where squares meet"]);
    }
}

#[test]
fn a_picture_that_is_partly_another_is_no_second_exposure() {
    let folder = Folder::new();
    let even = |_: f64, _: f64, _: u32| 0.4;
    let pictures = flat_field(&folder, "flat", &even);
    assert_done(&folder.calibrate("flat", &pictures, &[]));
    let read = |path: &PathBuf| image::open(path).unwrap().to_luma8();
    let (first, second) = (read(&pictures[0]), read(&pictures[1]));
    let mut half = second.clone();
    for (x, y, p) in half.enumerate_pixels_mut().filter(|(_, y, _)| *y < FLAT[1] / 2) {
        *p = *first.get_pixel(x, y);
    }
    let mut brighter = first;
    brighter.pixels_mut().for_each(|p| p.0[0] += 1);
    for (name, picture) in [("half", half), ("brighter", brighter)] {
        let path = folder.path(&format!("{name}.png"));
        picture.save(&path).unwrap();
        for what in ["flat", "noise"] {
            let refused = folder.calibrate(what, &[pictures[0].clone(), path.clone()], &[]);
            assert_refused(&refused, 1, &["png: found", "rows that are those of", "flat0.png again"]);
        }
    }
}

#[test]
fn corners_that_are_brighter_are_no_vignetting() {
    let folder = Folder::new();
    let middle = |x: f64, y: f64| ((x - 128.0).powi(2) + (y - 96.0).powi(2)) / 25_600.0;
    let camera = |light: &dyn Fn(f64, f64, u32) -> f64| {
        let output = folder.calibrate("flat", &flat_field(&folder, "light", light), &[]);
        assert_done(&output);
        (fs::read_to_string(folder.path("out/camera.toml")).unwrap(), said(&output))
    };
    let (brighter, why) = camera(&|x, y, _| 0.25 * (1.0 + 0.5 * middle(x, y)));
    assert!(!brighter.contains("[vignetting]") && why.contains("no lens brightens them"), "{why}");
    let (darker, _) = camera(&|x, y, _| 0.4 * (1.0 - 0.3 * middle(x, y)));
    assert!(darker.contains("[vignetting]"), "control: {darker}");
}

#[test]
fn colours_that_lie_apart_are_no_defocus() {
    let folder = Folder::new();
    let mut dice = Dice(4);
    let [w, h] = [160u32, 128];
    let mut sigma = |apart_px: f64| {
        let picture = RgbImage::from_fn(w, h, |x, y| {
            let mut value = |c: u32| {
                let off = f64::from(x) - 78.3 - 0.1 * f64::from(y) + apart_px * (f64::from(c) - 1.0);
                encoded(0.1 + 0.6 * share_left_of(off) + 0.003 * dice.normal())
            };
            Rgb([value(0), value(1), value(2)])
        });
        let path = folder.path("edge.png");
        picture.save(&path).unwrap();
        let output = folder.calibrate("edge", &[path], &[]);
        assert_done(&output);
        let found = folder.report()["edge"]["defocus_sigma_px"]["value"].as_f64().unwrap();
        (found, said(&output).contains("lateral colour"))
    };
    let (together, is_named) = sigma(0.0);
    assert!((together - 1.0).abs() < 0.1 && !is_named, "control: {together}");
    let (apart, is_named) = sigma(2.0);
    assert!((apart - 1.0).abs() < 0.1 && is_named, "{apart}");
}

#[test]
fn options_that_a_camera_answers_itself_are_refused() {
    let folder = Folder::new();
    let camera = folder.path("camera.toml");
    let text = "width = 64\nheight = 48\nfx = 50.0\nfy = 50.0\ncx = 32.0\ncy = 24.0\nframe_period_s = 0.04\n";
    fs::write(&camera, text).unwrap();
    let convert = |more: &[&str]| {
        let mut command = shutterbug();
        command.args(["camera", "convert"]).arg(&camera).arg("--out").arg(folder.path("out.yaml"));
        command.args(["--to", "ros", "--overwrite"]).args(more).output().unwrap()
    };
    assert_done(&convert(&[]));
    assert_refused(&convert(&["--name", "cam1"]), 1, &["a request for `cam1`"]);
    assert_refused(&convert(&["--rate-hz", "5"]), 2, &["--rate-hz: found 5 Hz", "states 25"]);
    let empty = folder.path("empty");
    fs::create_dir(&empty).unwrap();
    let mut command = shutterbug();
    let search = command.args(["presets", "search", "gopro", "--profiles"]).arg(&empty).output().unwrap();
    assert_refused(&search, 1, &["found no lens profile"]);
}
