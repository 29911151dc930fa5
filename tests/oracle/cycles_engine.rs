//! The engine on the device against frames of an independent path tracer, with the answer's effect switched on: the
//! truth for `accumulation`, with controls, and figures for `paper`.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use crate::gpu_support::device;
use crate::gpu_support::frames::paper;
use crate::oracle_support::{Answered, cycles};
use crate::requests::answered;
use shutterbug::camera::{ScanOrder, Trajectory};
use shutterbug::engine::{Engine, EngineOptions, ExactOptions, Method};
use shutterbug::plane::metrics::mean_absolute_difference;

/// Mean and worst mean absolute difference over every `step`th frame, 8-bit levels.
fn report(name: &str, what: &str, c: &Answered, method: &Method, step: usize) -> Option<(f64, f64)> {
    let watched = device(name)?;
    let options = EngineOptions { method: method.clone(), ..EngineOptions::default() };
    let requests: Vec<_> = (0..c.frames.len()).step_by(step).map(|f| answered(c, f)).collect();
    let (scene, path) = (Arc::new(c.scene.clone()), Arc::new(c.trajectory.clone()));
    let mut engine = Engine::new(&watched.0, scene, path, c.intrinsics, options, &requests).unwrap();
    let (mut sum, mut worst, mut ms, mut invalid) = (0.0, 0.0f64, 0.0, 0.0);
    for request in &requests {
        let frame = engine.render(request).unwrap();
        let levels = mean_absolute_difference(&frame.picture, &c.real(request.index as usize));
        sum += levels;
        ms += frame.host_ms;
        worst = worst.max(levels);
        if let Method::Paper(_) = method {
            invalid += frame.statistics.unwrap().invalid_share;
        }
    }
    let count = requests.len() as f64;
    eprintln!(
        "{name} {what}: mean {:.3}, worst {worst:.3} levels, {:.0} ms a frame, margin {:?} px",
        sum / count,
        ms / count,
        engine.margin_px()
    );
    // The margin was computed from the motion, so no pixel reads beyond it.
    assert_eq!(invalid, 0.0, "{name} {what}");
    Some((sum / count, worst))
}

fn accumulation() -> Method {
    EngineOptions::default().method
}

/// The captures' README gives 0.3 to 0.6 levels for the real frames' own sampling error at edges; no frame may be
/// worse.
const WORST: f64 = 0.6;
/// The same with textures, which the path tracer filters a little differently.
const WORST_TEXTURED: f64 = 0.8;

#[test]
fn d00_no_effect() {
    let Some(mut c) = cycles("d00", "d00_no_effect") else { return };
    let Some((mean, worst)) = report("d00", "as answered", &c, &accumulation(), 2) else { return };
    assert!(worst <= WORST);
    let by_paper = report("d00", "paper", &c, &paper(2), 6).unwrap();
    assert!(by_paper.1 <= WORST, "without effects every method is the truth");
    c.intrinsics.cx += 0.5;
    assert!(report("d00", "half a pixel off", &c, &accumulation(), 9).unwrap().0 > 5.0 * mean, "control");
}

#[test]
fn d01_rolling_shutter() {
    let Some(mut c) = cycles("d01", "d01_rolling_shutter") else { return };
    let Some((mean, worst)) = report("d01", "as answered", &c, &accumulation(), 3) else { return };
    assert!(worst <= WORST);
    report("d01", "paper", &c, &paper(2), 6);
    let readout_s = c.readout_time_s;
    for (what, readout_time_s, order, factor) in [
        ("readout 10 % short", 0.9 * readout_s, c.scan_order, 5.0),
        ("no shutter", 0.0, c.scan_order, 20.0),
        ("reversed", readout_s, ScanOrder::BottomToTop, 20.0),
    ] {
        (c.readout_time_s, c.scan_order) = (readout_time_s, order);
        assert!(report("d01", what, &c, &accumulation(), 9).unwrap().0 > factor * mean, "control: {what}");
    }
}

#[test]
fn d02_motion_blur() {
    let Some(mut c) = cycles("d02", "d02_motion_blur") else { return };
    let Some((mean, worst)) = report("d02", "as answered", &c, &accumulation(), 4) else { return };
    assert!(worst <= WORST);
    report("d02", "paper", &c, &paper(2), 6);
    let exposure_s = c.exposure_time_s;
    c.exposure_time_s = 0.0;
    assert!(report("d02", "no exposure", &c, &accumulation(), 9).unwrap().0 > 20.0 * mean, "control");
    c.exposure_time_s = exposure_s;
    c.frames.iter_mut().for_each(|frame| frame.0 += 0.5 * exposure_s);
    assert!(
        report("d02", "half an exposure late", &c, &accumulation(), 9).unwrap().0 > 10.0 * mean,
        "control"
    );
}

#[test]
fn d08_moving_object_and_textures() {
    let Some(mut c) = cycles("d08", "d08_moving_object_and_textures") else { return };
    let Some((mean, worst)) = report("d08", "as answered", &c, &accumulation(), 2) else { return };
    assert!(worst <= WORST_TEXTURED);
    report("d08", "paper", &c, &paper(2), 6);
    let scene = c.scene.clone();
    let moving = c.scene.objects.iter_mut().find(|o| o.trajectory.is_some()).unwrap();
    moving.trajectory = Some(Arc::new(Trajectory::fixed(moving.world_from_object(0.0))));
    assert!(report("d08", "object at rest", &c, &accumulation(), 9).unwrap().0 > 3.0 * mean, "control");
    c.scene = scene;
    c.scene.vertices.iter_mut().for_each(|v| v.uv[1] = 1.0 - v.uv[1]);
    assert!(report("d08", "textures upside down", &c, &accumulation(), 9).unwrap().0 > 5.0 * mean, "control");
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
