//! A frame of a moving camera by brute force: the scene is rendered at every instant of an [`AccumulationPlan`] and
//! added up, each line with its own weights. No motion vector is involved, so what the remapping methods get wrong
//! (what was hidden, parallax, curved paths) is right here.

use glam::DVec2;
use rayon::prelude::*;

use super::lens::LensGrid;
use super::raster::{MotionSpan, View, Window, render, render_through, render_window};
use crate::camera::accumulation::{AccumulationPlan, WeightedInstant};
use crate::camera::{Intrinsics, ScanOrder, ShutterTiming, Trajectory};
use crate::plane::Plane;
use crate::scene::Scene;

/// Linear RGB and coverage of one frame, shape `[height, width, 4]`, as [`super::raster::Rendered::color`].
///
/// `plan` is that of `timing`, whose lines are those of the picture; the trajectories of the camera and of moving
/// objects cover the frame.
///
/// # Panics
/// If the line count is not the picture's, or a trajectory is too short (callers check both once).
pub fn render_frame(
    scene: &Scene,
    trajectory: &Trajectory,
    intrinsics: &Intrinsics,
    timing: &ShutterTiming,
    plan: &AccumulationPlan,
    samples: &[[f32; 2]],
) -> Plane<f32> {
    sum_up(trajectory, intrinsics, timing, plan, |view, window| {
        render_window(scene, view, samples, None, window).color
    })
}

/// The same behind a lens: the time of a line is that of the sensor's line. The lens's camera is `intrinsics`.
///
/// # Panics
/// As [`render_frame`].
pub fn render_frame_through(
    scene: &Scene,
    trajectory: &Trajectory,
    intrinsics: &Intrinsics,
    timing: &ShutterTiming,
    plan: &AccumulationPlan,
    grid: &LensGrid,
) -> Plane<f32> {
    sum_up(trajectory, intrinsics, timing, plan, |view, window| {
        render_through(scene, view, grid, window).color
    })
}

fn sum_up(
    trajectory: &Trajectory,
    intrinsics: &Intrinsics,
    timing: &ShutterTiming,
    plan: &AccumulationPlan,
    picture_of: impl Fn(&View, Window) -> Plane<f32> + Sync,
) -> Plane<f32> {
    /// Instants rendered at the same time; bounds the memory that their pictures take.
    const BATCH: usize = 32;
    let lines = timing.scan_order.line_count(intrinsics.width, intrinsics.height);
    assert_eq!(timing.line_count, lines, "the shutter's lines are the picture's");
    let mut sum = Plane::new(intrinsics.width as usize, intrinsics.height as usize, 4);
    for batch in plan.instants.chunks(BATCH) {
        let pictures: Vec<(Window, Plane<f32>)> = batch
            .par_iter()
            .map(|instant| {
                let window = lines_window(timing.scan_order, intrinsics, instant);
                let world_from_camera = trajectory.pose_at(instant.time_s);
                let view = View { intrinsics: *intrinsics, world_from_camera, time_s: instant.time_s };
                (window, picture_of(&view, window))
            })
            .collect();
        // Added in order of time, so that the result does not depend on the number of threads.
        for (instant, (window, picture)) in batch.iter().zip(&pictures) {
            add(&mut sum, timing.scan_order, instant, *window, picture);
        }
    }
    sum
}

/// The part of the picture that the lines of an instant cover.
fn lines_window(order: ScanOrder, k: &Intrinsics, instant: &WeightedInstant) -> Window {
    let (first, count) = (instant.first_line, instant.weights.len() as u32);
    match order {
        ScanOrder::TopToBottom => Window { y: first, height: count, ..Window::whole(k) },
        ScanOrder::BottomToTop => Window { y: k.height - first - count, height: count, ..Window::whole(k) },
        ScanOrder::LeftToRight => Window { x: first, width: count, ..Window::whole(k) },
        ScanOrder::RightToLeft => Window { x: k.width - first - count, width: count, ..Window::whole(k) },
    }
}

fn add(
    sum: &mut Plane<f32>,
    order: ScanOrder,
    instant: &WeightedInstant,
    window: Window,
    picture: &Plane<f32>,
) {
    let (width, height) = (sum.width as u32, sum.height as u32);
    for y in window.y..window.y + window.height {
        for x in window.x..window.x + window.width {
            let line = order.line_of(x, y, width, height);
            let weight = instant.weights[(line - instant.first_line) as usize];
            let value = picture.pixel((x - window.x) as usize, (y - window.y) as usize);
            for (sum, value) in sum.pixel_mut(x as usize, y as usize).iter_mut().zip(value) {
                *sum += weight * value;
            }
        }
    }
}

/// The largest speed of the picture's content over a frame, px/s: what [`AccumulationPlan::auto_renders`] asks for.
/// Taken from the motion of a coarse grid of points in eight parts of the frame; 0 for a frame without duration.
///
/// # Panics
/// If a trajectory does not cover the frame.
pub fn largest_speed_px_per_s(
    scene: &Scene,
    trajectory: &Trajectory,
    intrinsics: &Intrinsics,
    timing: &ShutterTiming,
) -> f64 {
    const PARTS: u32 = 8;
    /// A grid of about this many points along the longer side sees every object that matters to a bound on speed.
    const GRID: u32 = 80;
    let duration_s = timing.end_s() - timing.start_s;
    if duration_s <= 0.0 {
        return 0.0;
    }
    let step = f64::from((intrinsics.width.max(intrinsics.height) / GRID).max(1));
    let coarse = Intrinsics {
        width: (f64::from(intrinsics.width) / step).ceil() as u32,
        height: (f64::from(intrinsics.height) / step).ceil() as u32,
        fx: intrinsics.fx / step,
        fy: intrinsics.fy / step,
        cx: intrinsics.cx / step,
        cy: intrinsics.cy / step,
    };
    let time_s = |part: f64| (timing.start_s + duration_s * part / f64::from(PARTS)).min(timing.end_s());
    let mut largest_px_per_s = 0.0_f64;
    for part in 0..PARTS {
        let (from_s, to_s) = (time_s(f64::from(part)), time_s(f64::from(part + 1)));
        let middle_s = time_s(f64::from(part) + 0.5);
        let view =
            View { intrinsics: coarse, world_from_camera: trajectory.pose_at(middle_s), time_s: middle_s };
        let span = MotionSpan { trajectory, from_s, to_s, scale: step / (to_s - from_s) };
        let motion = render(scene, &view, &[[0.5, 0.5]], Some(&span)).motion_px;
        for v in motion.data.chunks_exact(2) {
            largest_px_per_s = largest_px_per_s.max(DVec2::new(f64::from(v[0]), f64::from(v[1])).length());
        }
    }
    largest_px_per_s
}
