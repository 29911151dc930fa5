//! The engine on the device against frames of an independent path tracer, with the answer's effect switched on.
#![allow(clippy::unwrap_used)]

mod gpu_support;
mod oracle_support;

use std::sync::Arc;

use gpu_support::device;
use oracle_support::{Answered, cycles};
use shutterbug::chain::Settings;
use shutterbug::engine::{Engine, EngineOptions, ExactOptions, FrameRequest, Method};
use shutterbug::plane::metrics::mean_absolute_difference;

fn request(c: &Answered, frame: usize) -> FrameRequest {
    FrameRequest {
        index: frame as u32,
        shutter: c.timing(frame),
        frame_interval_s: c.frames[1].0 - c.frames[0].0,
        seed: 0,
        settings: Settings::default(),
        static_camera: false,
        planes: false,
        statistics: false,
    }
}

/// Mean and worst mean absolute difference over every `step`th frame, 8-bit levels.
fn report(name: &str, what: &str, c: &Answered, method: &Method, step: usize) -> Option<(f64, f64)> {
    let context = device(name)?;
    let options = EngineOptions { method: method.clone(), ..EngineOptions::default() };
    let requests: Vec<_> = (0..c.frames.len()).step_by(step).map(|f| request(c, f)).collect();
    let (scene, path) = (Arc::new(c.scene.clone()), Arc::new(c.trajectory.clone()));
    let mut engine = Engine::new(&context.0, scene, path, c.intrinsics, options, &requests).unwrap();
    let (mut sum, mut worst) = (0.0, 0.0f64);
    for request in &requests {
        let frame = engine.render(request).unwrap();
        let levels = mean_absolute_difference(&frame.picture, &c.real(request.index as usize));
        eprintln!(
            "{name} {what} frame {}: {levels:.3} levels, {:.0} ms {:?}",
            request.index, frame.host_ms, frame.times
        );
        sum += levels;
        worst = worst.max(levels);
    }
    let mean = sum / requests.len() as f64;
    eprintln!("{name} {what}: mean {mean:.3}, worst {worst:.3} levels");
    Some((mean, worst))
}

fn accumulation() -> Method {
    EngineOptions::default().method
}

#[test]
fn d00_no_effect() {
    let Some(mut c) = cycles("d00", "d00_no_effect") else { return };
    let Some((mean, worst)) = report("d00", "as answered", &c, &accumulation(), 3) else { return };
    assert!(worst <= 0.6);
    c.intrinsics.cx += 0.5;
    assert!(report("d00", "half a pixel off", &c, &accumulation(), 9).unwrap().0 > 5.0 * mean, "control");
}

/// Bound of the issue for `exact`: 0.8 levels on captures whose effects the engine has.
fn exact_within(name: &str, test: &str, step: usize) {
    let Some(c) = cycles(name, test) else { return };
    let exact = Method::Exact(ExactOptions::default());
    let Some((mean, worst)) = report(name, "exact", &c, &exact, step) else { return };
    assert!(mean <= 0.4 && worst <= 0.8, "{mean} {worst}");
}

#[test]
fn d00_exact() {
    exact_within("d00", "d00_exact", 3);
}

#[test]
fn d01_exact() {
    exact_within("d01", "d01_exact", 3);
}

#[test]
fn d02_exact() {
    exact_within("d02", "d02_exact", 3);
}

#[test]
fn d08_exact() {
    exact_within("d08", "d08_exact", 3);
}
