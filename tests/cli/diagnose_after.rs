//! `simulate` with the camera that was found gives the gap that was reported: scored here from the frames of many
//! seeds, by another estimator than the one of `diagnose`. And the camera goes to other simulators' formats.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use crate::diagnose_support::{PERIOD_S, make, names, run};
use crate::gpu_support::device;
use shutterbug::capture::Capture;
use shutterbug::engine::{Engine, EngineOptions, ExactOptions, FrameRequest, Method};
use shutterbug::gpu::Context;
use shutterbug::plane::{Plane, read_rgb8};

/// Seeds of the ensemble.
const SEEDS: usize = 14;

/// Frames by place in `frames`, of each seed.
fn ensemble(context: &Arc<Context>, capture: &Capture, frames: &[usize]) -> Vec<Vec<Plane<u8>>> {
    let request = |f: usize, seed: usize| FrameRequest {
        index: f as u32,
        shutter: capture.shutter(f),
        frame_interval_s: PERIOD_S,
        seed: 1000 + seed as u64,
        settings: capture.camera.settings.clone(),
        static_camera: false,
        planes: false,
        statistics: false,
    };
    let (scene, path) = (Arc::new(capture.scene.clone()), Arc::new(capture.true_trajectory()));
    let options = EngineOptions {
        method: Method::Exact(ExactOptions::default()),
        samples: 16,
        ..EngineOptions::default()
    };
    let mut engine = Engine::new(context, scene, path, capture.true_intrinsics(), options, &[]).unwrap();
    let mut one = |f: usize, seed: usize| engine.render(&request(f, seed)).unwrap().picture;
    frames.iter().map(|&f| (0..SEEDS).map(|seed| one(f, seed)).collect()).collect()
}

/// The fixed bank of linear statistics of one frame, by family: pixels, three bands, row means, column means.
fn statistics(p: &Plane<f64>) -> Vec<Vec<f64>> {
    let (w, h) = (p.width, p.height);
    let mut families = vec![p.data.clone()];
    let (mut level, mut lw, mut lh) = (p.data.clone(), w, h);
    for _ in 0..3 {
        let half = |v: &[f64], w: usize, h: usize| -> Vec<f64> {
            let at = |x: usize, y: usize, c: usize| v[(y * w + x) * 3 + c];
            let mut out = Vec::new();
            for y in 0..h / 2 {
                for x in 0..w / 2 {
                    for c in 0..3 {
                        let (x, y) = (2 * x, 2 * y);
                        out.push(
                            0.25 * (at(x, y, c) + at(x + 1, y, c) + at(x, y + 1, c) + at(x + 1, y + 1, c)),
                        );
                    }
                }
            }
            out
        };
        let fine = half(&level, lw, lh);
        (lw, lh) = (lw / 2, lh / 2);
        let coarse = half(&fine, lw, lh);
        let mut band = Vec::new();
        for y in 0..lh / 2 * 2 {
            for x in 0..lw / 2 * 2 {
                for c in 0..3 {
                    band.push(fine[(y * lw + x) * 3 + c] - coarse[((y / 2) * (lw / 2) + x / 2) * 3 + c]);
                }
            }
        }
        families.push(band);
        level = fine;
    }
    let mean = |n: usize, of: &dyn Fn(usize) -> f64| (0..n).map(of).sum::<f64>() / n as f64;
    families.push((0..h * 3).map(|i| mean(w, &|x| p.data[(i / 3 * w + x) * 3 + i % 3])).collect());
    families.push((0..w * 3).map(|i| mean(h, &|y| p.data[(y * w + i / 3) * 3 + i % 3])).collect());
    families
}

/// CRPS of a value under an ensemble (fair: unbiased for any number of members).
fn crps(real: f64, members: &[f64]) -> f64 {
    let n = members.len() as f64;
    let to_real: f64 = members.iter().map(|m| (m - real).abs()).sum::<f64>() / n;
    let mut sorted = members.to_vec();
    sorted.sort_by(f64::total_cmp);
    let spread: f64 = sorted.iter().enumerate().map(|(i, v)| v * (2.0 * i as f64 + 1.0 - n)).sum::<f64>();
    to_real - spread / (n * (n - 1.0))
}

/// The gap of frames: the mean over families, pixels half, the rest in equal parts, over frames.
fn gap(folder: &Path, frames: &[usize], simulated: &[Vec<Plane<u8>>]) -> f64 {
    let real_frame = |f: usize| read_rgb8(&folder.join(format!("real/{f:06}.png"))).unwrap();
    let as_f64 = |p: &Plane<u8>| Plane {
        width: p.width,
        height: p.height,
        channels: 3,
        data: p.data.iter().map(|v| f64::from(*v)).collect(),
    };
    let mean = |real: &[f64], all: &[Vec<f64>]| {
        let one = |i: usize| crps(real[i], &all.iter().map(|m| m[i]).collect::<Vec<_>>());
        (0..real.len()).map(one).sum::<f64>() / real.len() as f64
    };
    let mut total = 0.0;
    for (at, &f) in frames.iter().enumerate() {
        let real = statistics(&as_f64(&real_frame(f)));
        let members: Vec<_> = simulated[at].iter().map(|p| statistics(&as_f64(p))).collect();
        let family = |k: usize| mean(&real[k], &members.iter().map(|m| m[k].clone()).collect::<Vec<_>>());
        let (mut sum, mut weight) = (0.5 * family(0), 0.5);
        for k in 1..6 {
            (sum, weight) = (sum + family(k) / 12.0, weight + 1.0 / 12.0);
        }
        if at > 0 && frames[at - 1] + 1 == f {
            let minus = |a: &Plane<u8>, b: &Plane<u8>| -> Vec<f64> {
                a.data.iter().zip(&b.data).map(|(a, b)| f64::from(*a) - f64::from(*b)).collect()
            };
            let all: Vec<_> =
                simulated[at].iter().zip(&simulated[at - 1]).map(|(a, b)| minus(a, b)).collect();
            sum += mean(&minus(&real_frame(f), &real_frame(f - 1)), &all) / 12.0;
            weight += 1.0 / 12.0;
        }
        total += sum / weight;
    }
    total / frames.len() as f64
}

#[test]
fn simulate_with_the_camera_found_gives_the_reported_gap() {
    let Some(context) = device("after") else { return };
    let folder = tempfile::tempdir().unwrap();
    let hidden = "[vignetting]\na1 = -0.4\n[row_noise]\nsigma = 0.012\n[read_noise]\nsigma = 0.02\n";
    let capture = make(&context.0, folder.path(), hidden, "", 1.0, 31);
    let few = "jpeg,flicker,glare,lens_distortion,sharpening,rolling_shutter,motion_blur,defocus,noise_reduction,\
        chromatic_aberration,bayer_mosaic,time_offset,pose_offset,focal_length_error";
    let diagnosis = run(&context.0, &capture, &few.split(',').collect::<Vec<_>>());
    let out = tempfile::tempdir().unwrap();
    let report = diagnosis.write(out.path(), &capture).unwrap();
    assert_eq!(names(&report), ["read_noise", "row_noise", "vignetting"], "{:?}", report.gap);
    let held = &report.input.held_out_frames;
    let camera = out.path().join("camera.toml");
    let found = Capture::read(folder.path(), Some(&camera)).unwrap();
    let after = gap(folder.path(), held, &ensemble(&context.0, &found, held));
    let before = gap(folder.path(), held, &ensemble(&context.0, &capture, held));
    eprintln!("after {after} ({}), before {before} ({})", report.gap.after, report.gap.before);
    // Measured: after 4.094 here and 4.132 in the report (normal distributions stand for clipped and rounded ones
    // there), before 9.378 and 9.051 (without noise the report forgives half a DN of rounding).
    assert!((after / report.gap.after - 1.0).abs() < 0.04, "{after} {:?}", report.gap);
    assert!((before / report.gap.before - 1.0).abs() < 0.08, "{before} {:?}", report.gap);
    // Control: without its noise the camera found does not give that figure.
    let text = std::fs::read_to_string(&camera).unwrap();
    let silent = text.split("[row_noise]").next().unwrap();
    std::fs::write(out.path().join("silent.toml"), silent).unwrap();
    let silent = Capture::read(folder.path(), Some(&out.path().join("silent.toml"))).unwrap();
    let without = gap(folder.path(), held, &ensemble(&context.0, &silent, held));
    assert!(without > 1.1 * after, "{without} {after}");

    // What other simulators can take of it is written in their formats.
    for (to, mark) in [
        ("ros", "camera_matrix:"),
        ("kalibr", "intrinsics:"),
        ("euroc", "sensor_type: camera"),
        ("sdf", "<sensor name="),
    ] {
        let written = out.path().join(format!("camera.{to}"));
        let output = Command::new(env!("CARGO_BIN_EXE_shutterbug"))
            .args(["camera", "convert"])
            .arg(&camera)
            .args(["--to", to, "--out"])
            .arg(&written)
            .output()
            .unwrap();
        assert!(output.status.success(), "{to}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(std::fs::read_to_string(&written).unwrap().contains(mark), "{to}");
    }
}
