//! The oracle against frames of an independent path tracer, with the effect that the answer names switched on.
#![allow(clippy::unwrap_used)]

mod oracle_support;

use oracle_support::{Answered, cycles};
use shutterbug::camera::ScanOrder;
use shutterbug::camera::accumulation::AccumulationPlan;
use shutterbug::camera::samples::sample_positions;
use shutterbug::plane::metrics::mean_absolute_difference;
use shutterbug::plane::{Plane, srgb8};
use shutterbug::reference::accumulate::{largest_speed_px_per_s, render_frame};

/// Mean absolute difference to the real frame, 8-bit levels; number of renders; largest speed, px/s.
fn difference(c: &Answered, frame: usize) -> (f64, usize, f64) {
    let timing = c.timing(frame);
    let speed = largest_speed_px_per_s(&c.scene, &c.trajectory, &c.intrinsics, &timing);
    // Blurred frames average many renders, which places samples densely enough; the others need all sixteen.
    let samples = sample_positions(if c.exposure_time_s > 0.0 { 4 } else { 16 });
    let renders = AccumulationPlan::auto_renders(&timing, speed, 0.5, 240);
    let plan = AccumulationPlan::new(&timing, renders);
    let linear = render_frame(&c.scene, &c.trajectory, &c.intrinsics, &timing, &plan, &samples);
    let encoded = Plane::from_fn(linear.width, linear.height, |x, y| {
        let p = linear.pixel(x, y);
        [srgb8(p[0]), srgb8(p[1]), srgb8(p[2])]
    });
    (mean_absolute_difference(&encoded, &c.real(frame)), plan.instants.len(), speed)
}

/// Renders `frames`, prints the figures, and returns the mean difference over them.
fn report(name: &str, what: &str, c: &Answered, frames: &[usize]) -> f64 {
    let mut sum = 0.0;
    for &frame in frames {
        let clock = std::time::Instant::now();
        let (levels, renders, speed) = difference(c, frame);
        let ms = clock.elapsed().as_millis();
        eprintln!("{name} {what} frame {frame:2}: {levels:.3} levels, {renders} renders, {speed:.0} px/s, {ms} ms");
        sum += levels;
    }
    let mean = sum / frames.len() as f64;
    eprintln!("{name} {what}: {mean:.3} levels");
    mean
}

#[test]
fn d00_no_effect() {
    let Some(c) = cycles("d00", "d00_no_effect") else { return };
    assert!(report("d00", "as answered", &c, &[0, 6, 12, 18]) <= 0.6);
}

#[test]
fn d01_rolling_shutter() {
    let Some(mut c) = cycles("d01", "d01_rolling_shutter") else { return };
    let with = report("d01", "as answered", &c, &[0, 5, 10, 15]);
    assert!(with <= 0.6);
    c.scan_order = ScanOrder::BottomToTop;
    assert!(report("d01", "reversed", &c, &[0, 5, 10, 15]) > 5.0 * with);
    c.readout_time_s = 0.0;
    assert!(report("d01", "global", &c, &[0, 5, 10, 15]) > 5.0 * with);
}

#[test]
fn d02_motion_blur() {
    let Some(mut c) = cycles("d02", "d02_motion_blur") else { return };
    let with = report("d02", "as answered", &c, &[0, 7, 14, 21]);
    assert!(with <= 0.6);
    c.exposure_time_s = 0.0;
    assert!(report("d02", "no exposure", &c, &[0, 7, 14, 21]) > 5.0 * with);
}

#[test]
fn d08_moving_object_and_textures() {
    let Some(c) = cycles("d08", "d08_moving_object_and_textures") else { return };
    assert!(report("d08", "as answered", &c, &[0, 4, 8, 11]) <= 0.8);
}
