//! The lens against frames of an independent path tracer: alone (d03), and with a rolling shutter (d09).
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use crate::gpu_support::device;
use crate::gpu_support::frames::paper;
use crate::oracle_support::{Answered, cycles};
use crate::requests::answered;
use shutterbug::chain::{Settings, Value};
use shutterbug::effects::LensDistortion;
use shutterbug::engine::{Engine, EngineOptions, ExactOptions, FastOptions, FrameRequest, Method};
use shutterbug::plane::metrics::mean_absolute_difference;

fn request(c: &Answered, frame: usize) -> FrameRequest {
    let mut settings = Settings::default();
    for (name, value) in [("k1", c.lens[0]), ("k2", c.lens[1])] {
        settings.set(&LensDistortion, name, Value::Number(value)).unwrap();
    }
    FrameRequest { settings, ..answered(c, frame) }
}

/// Mean and worst mean absolute difference over every `step`th frame, 8-bit levels.
fn report(name: &str, what: &str, c: &Answered, method: &Method, step: usize) -> Option<(f64, f64)> {
    let watched = device(name)?;
    let options = EngineOptions { method: method.clone(), ..EngineOptions::default() };
    let requests: Vec<_> = (0..c.frames.len()).step_by(step).map(|f| request(c, f)).collect();
    let (scene, path) = (Arc::new(c.scene.clone()), Arc::new(c.trajectory.clone()));
    let mut engine = Engine::new(&watched.0, scene, path, c.intrinsics, options, &requests).unwrap();
    let (mut sum, mut worst, mut ms) = (0.0, 0.0f64, 0.0);
    for request in &requests {
        let frame = engine.render(request).unwrap();
        let levels = mean_absolute_difference(&frame.picture, &c.real(request.index as usize));
        (sum, worst, ms) = (sum + levels, worst.max(levels), ms + frame.host_ms);
    }
    let count = requests.len() as f64;
    eprintln!(
        "{name} {what}: mean {:.3}, worst {worst:.3} levels, {:.0} ms a frame",
        sum / count,
        ms / count
    );
    Some((sum / count, worst))
}

/// The bound for captures whose effects the engine has.
const WORST: f64 = 0.8;

fn within(name: &str, test: &str, step: usize) {
    let Some(mut c) = cycles(name, test) else { return };
    let exact = Method::Exact(ExactOptions::default());
    let accumulation = EngineOptions::default().method;
    let Some((mean, worst)) = report(name, "exact", &c, &exact, step) else { return };
    assert!(worst <= WORST, "exact: {worst}");
    assert!(report(name, "accumulation", &c, &accumulation, 2 * step).unwrap().1 <= WORST);
    // As good as without a lens (see engine_cycles).
    assert!(report(name, "fast", &c, &Method::Fast(FastOptions::default()), 2 * step).unwrap().1 <= WORST);
    report(name, "paper", &c, &paper(2), 2 * step).unwrap();
    let lens = c.lens;
    for (what, wrong) in [
        ("k1 10 % short", [0.9 * lens[0], lens[1]]),
        ("the other way round", [-lens[0], -lens[1]]),
        ("no lens", [0.0; 2]),
    ] {
        c.lens = wrong;
        assert!(report(name, what, &c, &exact, 3 * step).unwrap().0 > 2.0 * mean, "control: {what}");
    }
}

#[test]
fn d03_lens() {
    within("d03", "d03_lens", 4);
}

#[test]
fn d09_lens_and_rolling_shutter() {
    within("d09", "d09_lens_and_rolling_shutter", 4);
}
