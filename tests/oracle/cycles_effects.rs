//! Frames of an independent path tracer whose camera has effects on pixels and in its set-up, against the device with
//! the same effects on: the library's own way from a capture to a frame, by accumulation.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::sync::Arc;

use crate::effects_support::answered;
use crate::gpu_support::device;
use crate::requests::captured;
use shutterbug::capture::Capture;
use shutterbug::chain::Settings;
use shutterbug::engine::{Engine, EngineOptions, FrameRequest};
use shutterbug::plane::metrics::mean_absolute_difference;
use shutterbug::plane::{Plane, read_rgb8};

/// Every `step`th frame, simulated and real.
fn frames(test: &str, capture: &Capture, root: &Path, step: usize) -> Option<Vec<(Plane<u8>, Plane<u8>)>> {
    let context = device(test)?;
    let requests: Vec<_> = (0..capture.frames.len()).step_by(step).map(|f| captured(capture, f)).collect();
    let (scene, path) = (Arc::new(capture.scene.clone()), Arc::new(capture.true_trajectory()));
    let options = EngineOptions::default();
    let mut engine =
        Engine::new(&context.0, scene, path, capture.true_intrinsics(), options, &requests).unwrap();
    let pair = |r: &FrameRequest| {
        let real = root.join("real").join(&capture.frames[r.index as usize].filename);
        (engine.render(r).unwrap().picture, read_rgb8(&real).unwrap())
    };
    Some(requests.iter().map(pair).collect())
}

/// Mean absolute difference over the frames, 8-bit levels.
fn levels(test: &str, what: &str, frames: &[(Plane<u8>, Plane<u8>)]) -> f64 {
    let sum: f64 = frames.iter().map(|(a, b)| mean_absolute_difference(a, b)).sum();
    let mean = sum / frames.len() as f64;
    eprintln!("{test} {what}: {mean:.3} levels over {} frames", frames.len());
    mean
}

#[test]
fn d05_vignetting_and_gamma() {
    let Some((mut capture, root)) = answered("d05", "d05") else { return };
    let Some(with) = frames("d05", &capture, &root, 4) else { return };
    let with = levels("d05", "as answered", &with);
    assert!(with <= 0.8);
    for off in ["vignetting", "gamma"] {
        let mut settings = capture.camera.settings.clone();
        settings.disable(off);
        std::mem::swap(&mut settings, &mut capture.camera.settings);
        let without = levels("d05", &format!("without {off}"), &frames("d05", &capture, &root, 12).unwrap());
        std::mem::swap(&mut settings, &mut capture.camera.settings);
        assert!(without > 5.0 * with, "control");
    }
}

#[test]
fn d06_time_offset() {
    let Some((mut capture, root)) = answered("d06", "d06") else { return };
    let Some(with) = frames("d06", &capture, &root, 3) else { return };
    let with = levels("d06", "as answered", &with);
    assert!(with <= 0.8);
    capture.camera.settings.disable("time_offset");
    let without = levels("d06", "without", &frames("d06", &capture, &root, 3).unwrap());
    assert!(without > 2.0 * with, "control");
}

/// Squared differences to the noise-free picture in flat places, by its value in bins of 32 levels: (sum, sum of
/// squares, count).
fn residuals(noisy: &Plane<u8>, clean: &Plane<u8>, bins: &mut [(f64, f64, f64); 8]) {
    let at = |p: &Plane<u8>, x: usize, y: usize, c: usize| f64::from(p.pixel(x, y)[c]);
    for (x, y) in (2..clean.height - 2).flat_map(|y| (2..clean.width - 2).map(move |x| (x, y))) {
        for c in 0..3 {
            let own = at(clean, x, y, c);
            let around = (0..25).map(|i| at(clean, x + i % 5 - 2, y + i / 5 - 2, c));
            if around.map(|v| (v - own).abs()).fold(0.0, f64::max) <= 3.0 {
                let bin = &mut bins[own as usize / 32];
                let d = at(noisy, x, y, c) - own;
                *bin = (bin.0 + d, bin.1 + d * d, bin.2 + 1.0);
            }
        }
    }
}

#[test]
fn d04_noise_has_the_mean_and_the_variance() {
    let Some((mut capture, root)) = answered("d04", "d04") else { return };
    let Some(noisy) = frames("d04", &capture, &root, 2) else { return };
    let noises = ["shot_noise", "read_noise"];
    let all = capture.camera.settings.clone();
    noises.iter().for_each(|n| capture.camera.settings.disable(n));
    let clean = frames("d04", &capture, &root, 2).unwrap();
    capture.camera.settings = Settings::clone(&all);
    capture.camera.settings.disable("shot_noise");
    let only_read = frames("d04", &capture, &root, 2).unwrap();
    let (mut real, mut ours, mut less) = ([(0.0, 0.0, 0.0); 8], [(0.0, 0.0, 0.0); 8], [(0.0, 0.0, 0.0); 8]);
    for (((simulated, truth), (clean, _)), (read, _)) in noisy.iter().zip(&clean).zip(&only_read) {
        residuals(truth, clean, &mut real);
        residuals(simulated, clean, &mut ours);
        residuals(read, clean, &mut less);
    }
    let (mut seen, mut control) = (0, 0);
    for bin in 0..8 {
        let of = |b: &[(f64, f64, f64); 8]| {
            (b[bin].0 / b[bin].2, b[bin].1 / b[bin].2 - (b[bin].0 / b[bin].2).powi(2))
        };
        let ((real_mean, real_variance), (mean, variance), (_, read)) = (of(&real), of(&ours), of(&less));
        let count = real[bin].2;
        if count < 3000.0 {
            continue;
        }
        eprintln!(
            "d04 value {}..{}: {count} values, mean {mean:.3} (real {real_mean:.3}), variance {variance:.3} (real \
             {real_variance:.3}, read noise alone {read:.3})",
            32 * bin,
            32 * bin + 32
        );
        // The renderer's own sampling noise adds 0.1 or so to the variance of the real frames.
        assert!((mean - real_mean).abs() < 0.3, "bin {bin}");
        assert!((variance / real_variance - 1.0).abs() < 0.1, "bin {bin}");
        seen += 1;
        control += usize::from((read / real_variance - 1.0).abs() > 0.1);
    }
    assert!(seen >= 4, "{seen} bins");
    assert!(2 * control >= seen, "control: without shot noise {control} of {seen} bins differ");
}
