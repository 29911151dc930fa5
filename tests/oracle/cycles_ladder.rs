//! Every method on every capture of an independent path tracer whose effects the engine has: the table of
//! `docs/methods.md`, and the bounds that `exact` and `fast` were given.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::sync::Arc;

use crate::effects_support::answered;
use crate::gpu_support::{Watched, device};
use crate::requests::captured;
use shutterbug::capture::Capture;
use shutterbug::engine::{
    AccumulationOptions, Engine, EngineOptions, ExactOptions, FastOptions, Method, PaperOptions,
};
use shutterbug::plane::metrics::mean_absolute_difference;
use shutterbug::plane::{Plane, read_rgb8};

/// Mean absolute differences that no frame may exceed, 8-bit levels.
const EXACT: f64 = 0.8;
const FAST: f64 = 1.2;
/// Every so many-th frame.
const STEP: usize = 5;

fn methods() -> [(&'static str, Method); 4] {
    [
        ("exact", Method::Exact(ExactOptions::default())),
        ("fast", Method::Fast(FastOptions::default())),
        ("accumulation", Method::Accumulation(AccumulationOptions::default())),
        ("paper", Method::Paper(PaperOptions::default())),
    ]
}

fn pictures(watched: &Watched, capture: &Capture, method: &Method) -> Vec<(usize, Plane<u8>)> {
    let requests: Vec<_> = (0..capture.frames.len()).step_by(STEP).map(|f| captured(capture, f)).collect();
    let (scene, path) = (Arc::new(capture.scene.clone()), Arc::new(capture.true_trajectory()));
    let options = EngineOptions { method: method.clone(), ..EngineOptions::default() };
    let mut engine =
        Engine::new(&watched.0, scene, path, capture.true_intrinsics(), options, &requests).unwrap();
    requests.iter().map(|r| (r.index as usize, engine.render(r).unwrap().picture)).collect()
}

/// Mean and worst difference over the frames.
fn levels(got: &[(usize, Plane<u8>)], want: &dyn Fn(usize) -> Plane<u8>) -> (f64, f64) {
    let each: Vec<f64> =
        got.iter().map(|(i, picture)| mean_absolute_difference(picture, &want(*i))).collect();
    (each.iter().sum::<f64>() / each.len() as f64, each.iter().copied().fold(0.0, f64::max))
}

fn real(root: &Path, capture: &Capture, frame: usize) -> Plane<u8> {
    read_rgb8(&root.join("real").join(&capture.frames[frame].filename)).unwrap()
}

#[test]
#[ignore = "long: a minute"]
fn every_capture_is_met() {
    let Some(watched) = device("every_capture_is_met") else { return };
    eprintln!("| capture | exact | fast | accumulation | paper |\n|---|---|---|---|---|");
    for name in ["d00", "d01", "d02", "d03", "d04", "d05", "d06", "d08", "d09"] {
        let Some((mut capture, root)) = answered(name, "every_capture_is_met") else { continue };
        // Random noise aside: the frames of a noisy capture are those of accumulation, which the noise was measured
        // against (tests/oracle/cycles_effects.rs).
        let noises = ["shot_noise", "read_noise"];
        let noisy = noises.iter().any(|n| capture.camera.settings.has(n));
        noises.iter().for_each(|n| capture.camera.settings.disable(n));
        let truth = noisy.then(|| pictures(&watched, &capture, &methods()[2].1));
        let want = |frame: usize| match &truth {
            Some(frames) => frames.iter().find(|f| f.0 == frame).unwrap().1.clone(),
            None => real(&root, &capture, frame),
        };
        let found = methods().map(|(_, method)| levels(&pictures(&watched, &capture, &method), &want));
        let cells = found.map(|(mean, worst)| format!("{mean:.2} ({worst:.2})")).join(" | ");
        eprintln!("| {name}{} | {cells} |", if noisy { ", noise aside" } else { "" });
        assert!(found[0].1 <= EXACT, "{name}: exact {:?}", found[0]);
        assert!(found[1].1 <= FAST, "{name}: fast {:?}", found[1]);
    }
}

/// Control: frames that are a third of a frame late are outside of every bound.
#[test]
fn another_time_is_not_met() {
    let Some(watched) = device("another_time_is_not_met") else { return };
    for name in ["d01", "d02", "d04"] {
        let Some((mut capture, root)) = answered(name, "another_time_is_not_met") else { continue };
        let late_s = capture.camera.frame_period_s / 3.0;
        capture.frames.iter_mut().for_each(|f| f.start_s += late_s);
        capture.frames.truncate(6);
        let (mean, _) = levels(&pictures(&watched, &capture, &methods()[0].1), &|f| real(&root, &capture, f));
        assert!(mean > 2.0 * FAST, "{name}: {mean}");
    }
}
