//! `diagnose --unpaired --distance`: a distance of the user's own, before and after. The one here is the difference
//! of the mean sizes of the files: noise does not compress.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use crate::dice_support::Dice;
use crate::long_support::{left_out, long};
use serde_json::Value;
use shutterbug::plane::{srgb_decode, srgb8};

/// Pictures of patches, each evenly coloured, with white noise on linear light.
fn pictures(folder: &Path, seed: u64, noise: f64) {
    fs::create_dir_all(folder).unwrap();
    let mut dice = Dice(seed);
    for i in 0..8 {
        let patches: Vec<[f64; 3]> = (0..35)
            .map(|_| {
                let grey = 60.0 + 150.0 * dice.roll();
                [0; 3].map(|_| (grey + 20.0 * dice.roll()).round())
            })
            .collect();
        let picture = image::RgbImage::from_fn(192, 144, |x, y| {
            let patch = patches[(y / 30 * 7 + x / 30) as usize % 35];
            image::Rgb(patch.map(|v| {
                let linear = f64::from(srgb_decode(v as f32 / 255.0)) + noise * dice.normal();
                srgb8(linear as f32)
            }))
        });
        picture.save(folder.join(format!("{i:03}.png"))).unwrap();
    }
}

fn diagnose(sim: &Path, real: &Path, out: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
    command.args(["diagnose", "--unpaired", "--sim"]).arg(sim).arg("--real").arg(real);
    command.arg("--out").arg(out).args(more).output().unwrap()
}

fn report(out: &Path) -> Value {
    serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap()
}

/// Candidates that are not looked for: they take long.
const FEW: &str = "defocus,chromatic_aberration,bayer_mosaic,jpeg,noise_reduction,sharpening,quantization,\
    chroma_subsampling";

/// Mean size of the files of a folder apart from that of another, bytes.
const SIZES: &str = "mean() { echo $(( $(cat \"$1\"/* | wc -c) / $(ls \"$1\" | wc -l) )); }\n\
                     a=$(mean \"$1\"); b=$(mean \"$2\")\necho \"comparing\"\n\
                     echo \"distance: $(( a > b ? a - b : b - a ))\"\n";

#[test]
fn a_distance_of_the_users_own_is_told_before_and_after() {
    let folder = tempfile::tempdir().unwrap();
    let (sim, real) = (folder.path().join("sim frames"), folder.path().join("real frames"));
    pictures(&sim, 1, 0.0);
    pictures(&real, 2, 0.01);
    let script = folder.path().join("sizes.sh");
    fs::write(&script, SIZES).unwrap();
    let distance = format!("sh {} {{a}} {{b}}", script.display());
    let out = folder.path().join("out");
    let done = diagnose(&sim, &real, &out, &["--distance", &distance, "--without", FEW]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let found = report(&out);
    let measure = |r: &Value| r["measures"][0].clone();
    let (before, after) =
        (measure(&found)["before"].as_f64().unwrap(), measure(&found)["after"].as_f64().unwrap());
    eprintln!("{before} {after}: {}", found["sentence"]);
    assert_eq!(measure(&found)["name"], "distance by sh");
    assert!(before > 3_000.0 && after < 0.5 * before, "{found}");
    let sentence = found["sentence"].as_str().unwrap();
    assert!(
        sentence.contains("By sh, the distance of 4 real frames that no fit has seen from"),
        "{sentence}"
    );
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("distance by sh"));
    // Control: without the effects that are there it stays.
    if !long() {
        return left_out("a_distance_of_the_users_own", "the same without the effects that are there");
    }
    let names: Vec<&str> =
        found["effects"].as_array().unwrap().iter().map(|e| e["name"].as_str().unwrap()).collect();
    let out = folder.path().join("without");
    assert!(names.contains(&"read_noise"), "{names:?}");
    let all =
        format!("{FEW},{},shot_noise,read_noise,row_noise,fixed_pattern_noise,hot_pixels", names.join(","));
    let done = diagnose(&sim, &real, &out, &["--distance", &distance, "--without", &all]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let without = measure(&report(&out));
    assert!(without["after"].as_f64().unwrap() > 0.7 * before, "{without}");
}

#[test]
fn a_command_that_does_not_measure_ends_it_before_the_search() {
    let folder = tempfile::tempdir().unwrap();
    let (sim, real, out) = (folder.path().join("sim"), folder.path().join("real"), folder.path().join("out"));
    pictures(&sim, 1, 0.0);
    pictures(&real, 2, 0.01);
    let said = |more: &[&str]| {
        let done = diagnose(&sim, &real, &out, more);
        let text = String::from_utf8_lossy(&done.stderr).into_owned();
        // What is missing in the command is usage; the rest is not.
        assert_eq!(done.status.code(), Some(if more[1].contains("{b}") { 1 } else { 2 }), "{text}");
        assert_eq!(text.lines().filter(|l| l.contains("error: ")).count(), 1, "{text}");
        assert!(!out.exists(), "nothing is left");
        text
    };
    assert!(said(&["--distance", "fid {a}"]).contains("without {b}"));
    assert!(said(&["--distance", "/no/such/program {a} {b}"]).contains("/no/such/program"));
    assert!(
        said(&["--distance", "sh -c 'echo bad weights >&2; exit 2' {a} {b}"])
            .contains("exit code 2: bad weights")
    );
    assert!(said(&["--distance", "echo {a} {b}"]).contains("a line with one number"));
    let begun = Instant::now();
    let late = said(&["--distance", "sh -c 'sleep 60; echo 1' {a} {b}", "--time-limit-s", "2"]);
    assert!(late.contains("the time limit") && begun.elapsed() < Duration::from_secs(20), "{late}");
    // It belongs to folders that are not paired.
    let paired = Command::new(env!("CARGO_BIN_EXE_shutterbug"))
        .args(["diagnose", "--distance", "x {a} {b}", "--out", "o", "--real"])
        .arg(&real)
        .arg("--sim")
        .arg(&sim)
        .output()
        .unwrap();
    assert_eq!(paired.status.code(), Some(2));
}
