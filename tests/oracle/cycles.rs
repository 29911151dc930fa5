//! The oracle against frames of an independent path tracer, with the effect that the answer names switched on.
#![allow(clippy::unwrap_used)]

use crate::oracle_support::{Answered, cycles};
use shutterbug::camera::accumulation::AccumulationPlan;
use shutterbug::camera::samples::sample_positions;
use shutterbug::camera::{ScanOrder, Trajectory};
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

/// Renders every frame, for controls every fourth, prints the figures, and returns mean and largest difference.
fn report(name: &str, what: &str, c: &Answered) -> (f64, f64) {
    let (mut sum, mut worst) = (0.0, 0.0_f64);
    let frames: Vec<usize> = (0..c.frames.len()).step_by(if what == AS_ANSWERED { 1 } else { 4 }).collect();
    for &frame in &frames {
        let clock = std::time::Instant::now();
        let (levels, renders, speed) = difference(c, frame);
        let ms = clock.elapsed().as_millis();
        eprintln!(
            "{name} {what} frame {frame:2}: {levels:.3} levels, {renders} renders, {speed:.0} px/s, {ms} ms"
        );
        sum += levels;
        worst = worst.max(levels);
    }
    let mean = sum / frames.len() as f64;
    eprintln!("{name} {what}: mean {mean:.3}, worst frame {worst:.3} levels");
    (mean, worst)
}

const AS_ANSWERED: &str = "as answered";
/// The captures' README gives 0.3 to 0.6 levels for the real frames' own sampling error at edges; no frame may be
/// worse.
const WORST: f64 = 0.6;
/// The same with textures, which the path tracer filters a little differently.
const WORST_TEXTURED: f64 = 0.8;

#[test]
fn d00_no_effect() {
    let Some(mut c) = cycles("d00", "d00_no_effect") else { return };
    let (mean, worst) = report("d00", AS_ANSWERED, &c);
    assert!(worst <= WORST);
    c.intrinsics.cx += 0.5;
    assert!(report("d00", "half a pixel off", &c).0 > 5.0 * mean, "control");
}

#[test]
fn d01_rolling_shutter() {
    let Some(mut c) = cycles("d01", "d01_rolling_shutter") else { return };
    let (mean, worst) = report("d01", AS_ANSWERED, &c);
    assert!(worst <= WORST);
    let readout_s = c.readout_time_s;
    c.readout_time_s = 0.9 * readout_s;
    assert!(report("d01", "readout 10 % short", &c).0 > 5.0 * mean, "control");
    c.readout_time_s = 0.0;
    assert!(report("d01", "global shutter", &c).0 > 20.0 * mean, "control");
    c.readout_time_s = readout_s;
    c.scan_order = ScanOrder::BottomToTop;
    assert!(report("d01", "reversed", &c).0 > 20.0 * mean, "control");
}

#[test]
fn d02_motion_blur() {
    let Some(mut c) = cycles("d02", "d02_motion_blur") else { return };
    let (mean, worst) = report("d02", AS_ANSWERED, &c);
    assert!(worst <= WORST);
    let exposure_s = c.exposure_time_s;
    c.exposure_time_s = 0.0;
    assert!(report("d02", "no exposure", &c).0 > 20.0 * mean, "control");
    for frame in &mut c.frames {
        frame.0 += 0.5 * exposure_s;
    }
    assert!(report("d02", "instant in the middle", &c).0 > 10.0 * mean, "control");
    c.exposure_time_s = exposure_s;
    assert!(report("d02", "half an exposure late", &c).0 > 10.0 * mean, "control");
}

#[test]
fn d08_moving_object_and_textures() {
    let Some(mut c) = cycles("d08", "d08_moving_object_and_textures") else { return };
    let (mean, worst) = report("d08", AS_ANSWERED, &c);
    assert!(worst <= WORST_TEXTURED);
    let scene = c.scene.clone();
    let moving = c.scene.objects.iter_mut().find(|o| o.trajectory.is_some()).unwrap();
    let first = moving.world_from_object(0.0);
    moving.trajectory = Some(std::sync::Arc::new(Trajectory::fixed(first)));
    assert!(report("d08", "object at rest", &c).0 > 3.0 * mean, "control");
    c.scene = scene;
    c.scene.vertices.iter_mut().for_each(|v| v.uv[1] = 1.0 - v.uv[1]);
    assert!(report("d08", "textures upside down", &c).0 > 5.0 * mean, "control");
}
