//! Photographs of a board by a camera at rest, one pose each, lit a little differently, with things around the board
//! that the scene does not have: as boards are photographed to calibrate cameras.
#![allow(clippy::unwrap_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::diagnose_support::{frames_of, names, parameter, reference, run};
use crate::dice_support::Dice;
use crate::gpu_support::device;
use glam::{DQuat, DVec3};
use shutterbug::capture::Capture;
use shutterbug::plane::{Plane, write_png_atomic};
use shutterbug_diagnose::diagnose::Verdict;

const CAMERA: &str = "width = 160\nheight = 120\nfx = 135.0\nfy = 135.0\ncx = 81.0\ncy = 59.0\nframe_period_s = 1.0\n\
                      background = \"ignore\"\nstatic = true\n";
/// Of the lens.
const K1: f64 = -0.27;
const K2: f64 = 0.06;
/// Squared distance of the board's border from the axis, of a focal length of 1.
const R2: f64 = 0.12;
/// Light of each photograph.
const LIGHT: [f64; 8] = [1.0, 0.8, 1.15, 0.9, 1.05, 0.7, 1.1, 0.95];

/// 7x5 squares of 3 cm, as large as the picture nearly, each held at another angle.
fn write_board(folder: &Path) {
    let (mut obj, mut squares) = (String::from("mtllib scene.mtl\n"), String::new());
    for (n, (i, j)) in (0..7).flat_map(|i| (0..5).map(move |j| (i, j))).enumerate() {
        for (a, b) in [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)] {
            writeln!(obj, "v {:.3} {:.3} 0", 0.03 * f64::from(a), 0.03 * f64::from(b)).unwrap();
        }
        let v = 4 * n;
        let kind = if (i + j) % 2 == 0 { "black" } else { "white" };
        writeln!(squares, "usemtl {kind}\nf {} {} {} {}", v + 1, v + 2, v + 3, v + 4).unwrap();
    }
    fs::write(folder.join("scene.obj"), obj + &squares).unwrap();
    fs::write(folder.join("scene.mtl"), "newmtl black\nKd 0.02 0.02 0.02\nnewmtl white\nKd 0.6 0.6 0.6\n")
        .unwrap();
}

fn write_poses(folder: &Path) {
    let mut dice = Dice(5);
    let (mut path, mut frames) = (String::new(), String::from("#timestamp [ns],filename\n"));
    for f in 0..LIGHT.len() {
        let mut angle = || 0.7 * (dice.roll() - 0.5);
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, angle(), angle(), angle());
        // The board's middle lies before the camera, a little to the side.
        let middle = DVec3::new(0.105, 0.075, 0.0);
        let before = DVec3::new(0.06 * (dice.roll() - 0.5), 0.04 * (dice.roll() - 0.5), 0.2);
        let at = middle - turn * before;
        writeln!(path, "{f} {} {} {} {} {} {} {}", at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w).unwrap();
        writeln!(frames, "{},{f:06}.png", 1_000_000_000 * f).unwrap();
    }
    fs::write(folder.join("trajectory.tum"), path).unwrap();
    fs::write(folder.join("frames.csv"), frames).unwrap();
}

/// The photograph `f`: through the lens, in its light, with other things around the board.
fn photograph(context: &std::sync::Arc<shutterbug::gpu::Context>, folder: &Path, f: usize) -> Plane<u8> {
    let hidden = format!(
        "{CAMERA}[lens_distortion]\nk1 = {K1}\nk2 = {K2}\n[exposure_gain]\ngain = {}\n[read_noise]\nsigma = 0.006\n",
        LIGHT[f]
    );
    fs::write(folder.join("camera.toml"), hidden).unwrap();
    let capture = Capture::read(folder, None).unwrap();
    let mut picture = frames_of(context, &capture, reference()).swap_remove(f);
    for (i, pixel) in picture.data.chunks_exact_mut(3).enumerate() {
        // Noise lifts black by less than this; the board's black is brighter.
        if pixel.iter().all(|v| *v < 24) {
            pixel.fill(if (i % 160 / 9 + i / 160 / 7) % 3 == 0 { 150 } else { 80 });
        }
    }
    picture
}

#[test]
#[ignore = "long: a minute and a half"]
fn the_lens_is_found_in_photographs_of_a_board() {
    let Some(watched) = device("photographs") else { return };
    let context = &watched.0;
    let folder = tempfile::tempdir().unwrap();
    write_board(folder.path());
    write_poses(folder.path());
    fs::create_dir_all(folder.path().join("real")).unwrap();
    for f in 0..LIGHT.len() {
        let picture = photograph(context, folder.path(), f);
        write_png_atomic(&folder.path().join(format!("real/{f:06}.png")), &picture).unwrap();
    }
    fs::write(folder.path().join("camera.toml"), CAMERA).unwrap();
    let capture = Capture::read(folder.path(), None).unwrap();
    // What takes long and is not asked here.
    let slow = ["bayer_mosaic", "sharpening", "chroma_subsampling", "jpeg", "flicker", "defocus", "gamma"];
    let report = run(context, &capture, &slow).report;
    assert!(matches!(report.verdict, Verdict::Explained | Verdict::PartlyExplained), "{}", report.sentence);
    assert_eq!(report.effects[0].name, "lens_distortion", "{:?}", names(&report));
    // Coefficients trade against each other; what they do at the board's border does not.
    let of = |name: &str| parameter(&report, "lens_distortion", name).0;
    let (found, truth) = (of("k1") + of("k2") * R2, K1 + K2 * R2);
    assert!((found / truth - 1.0).abs() < 0.05, "{found} for {truth}, k1 {}", of("k1"));
    assert!(
        report.input.left_out.is_empty(),
        "the first and the last photograph count: {:?}",
        report.input.left_out
    );
    assert!(report.warnings.iter().any(|w| w.contains("light differs")), "{:?}", report.warnings);

    // Without the lens among the candidates nothing puts the squares in their places.
    let without: Vec<&str> = slow.into_iter().chain(["lens_distortion"]).collect();
    let report = run(context, &capture, &without).report;
    assert!(report.verdict == Verdict::UnknownEffect, "control: {}", report.sentence);
}
