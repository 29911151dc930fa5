//! `--method fast` against frames of an independent path tracer, with the answer's effect switched on.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use crate::gpu_support::device;
use crate::oracle_support::{Answered, cycles};
use crate::requests::answered;
use shutterbug::camera::ScanOrder;
use shutterbug::engine::{Engine, EngineOptions, FastOptions, Method};
use shutterbug::gpu::Context;
use shutterbug::plane::metrics::mean_absolute_difference;

/// Mean over every fourth frame of the mean absolute difference, 8-bit levels; no pixel may lack a source.
fn levels(context: &Arc<Context>, name: &str, what: &str, c: &Answered) -> f64 {
    let options = EngineOptions { method: Method::Fast(FastOptions::default()), ..EngineOptions::default() };
    let requests: Vec<_> = (0..c.frames.len()).step_by(4).map(|f| answered(c, f)).collect();
    let (scene, path) = (Arc::new(c.scene.clone()), Arc::new(c.trajectory.clone()));
    let mut engine = Engine::new(context, scene, path, c.intrinsics, options, &requests).unwrap();
    let mut sum = 0.0;
    for request in &requests {
        let frame = engine.render(request).unwrap();
        assert_eq!(frame.statistics.unwrap().invalid_share, 0.0, "{name} frame {}", request.index);
        sum += mean_absolute_difference(&frame.picture, &c.real(request.index as usize));
    }
    let mean = sum / requests.len() as f64;
    eprintln!("{name} {what}: {mean:.3} levels over {} frames", requests.len());
    mean
}

/// The bound that the issue sets for this method, and a control: the same with another effect is far outside.
fn check(name: &str, test: &str, wrong: impl Fn(&mut Answered)) {
    let Some(mut c) = cycles(name, test) else { return };
    let Some(context) = device(test) else { return };
    let right = levels(&context.0, name, "as answered", &c);
    assert!(right <= 1.2, "{name}: {right} levels");
    wrong(&mut c);
    let control = levels(&context.0, name, "control", &c);
    assert!(control > 1.5 * right && control > 1.2, "control of {name}: {control} levels");
}

#[test]
fn d00_no_effect() {
    check("d00", "d00_no_effect", |c| c.readout_time_s = 0.02);
}

#[test]
fn d01_rolling_shutter() {
    check("d01", "d01_rolling_shutter", |c| c.scan_order = ScanOrder::BottomToTop);
}

#[test]
fn d02_motion_blur() {
    check("d02", "d02_motion_blur", |c| c.exposure_time_s = 0.0);
}

#[test]
fn d08_no_effect_either() {
    check("d08", "d08_no_effect_either", |c| c.exposure_time_s = 0.02);
}
