//! The camera's path from depth and motion: the turn and the step from each frame to the next that explain how its
//! content moves.

use glam::{DQuat, DVec2, DVec3};

use super::{GoOn, SimFrames};
use crate::diagnose::expect::linear::solve;
use shutterbug::camera::{Intrinsics, Pose, Trajectory};
use shutterbug::error::Result;
use shutterbug::plane::Plane;
use shutterbug::plane::stats::median;

/// Samples across a picture.
const ACROSS: usize = 80;
/// Steps of the fit.
const STEPS: usize = 12;
/// Differences from here on count less, px: what moves by itself.
const LARGE_PX: f64 = 0.1;
/// What a path may leave at most places for it to be the camera's, px.
const MOST_LEFT_PX: f64 = 0.5;

/// A path that was worked out.
pub(super) struct Tracked {
    pub path: Trajectory,
    /// Median over places of what it leaves of the motion, px.
    pub left_px: f64,
}

/// The path through the instants of all frames and one period behind the last; nothing where frames do not follow each
/// other or the planes disagree. What the camera's motion does not explain is put down as content's own.
///
/// # Errors
/// No time is left.
pub(super) fn track(sim: &mut SimFrames, k: &Intrinsics, go_on: GoOn<'_>) -> Result<Option<Tracked>> {
    let mut poses = vec![Pose::IDENTITY];
    let mut times_s = vec![sim.times_s[0]];
    let mut left = Vec::new();
    for i in 0..sim.frames.len() {
        go_on()?;
        let last = i + 1 == sim.frames.len();
        if !last && !sim.follows(i + 1) {
            return Ok(None);
        }
        let frame = &mut sim.frames[i];
        let (Some(depth), Some(motion)) = (&frame.depth, &frame.motion[0]) else {
            if last { break } else { return Ok(None) }
        };
        let Some(step) = step(depth, motion, k) else { return Ok(None) };
        let rest = rest(depth, motion, k, &step);
        left.push(median(rest.data.chunks_exact(2).step_by(11).map(|v| f64::from(v[0].hypot(v[1])))));
        // Below this a place goes with the camera: planes are written in half floats.
        let moves = |v: &[f32]| f64::from(v[0].hypot(v[1])) > MOST_LEFT_PX;
        if rest.data.chunks_exact(2).any(moves) {
            let own = rest
                .data
                .chunks_exact(2)
                .flat_map(|v| if moves(v) { [v[0], v[1]] } else { [0.0; 2] })
                .collect();
            frame.own = Some(Plane { data: own, ..rest });
        }
        poses.push(poses[i].then_from(&step.inverse()));
        times_s.push(if last { sim.times_s[i] + sim.period_s } else { sim.times_s[i + 1] });
    }
    let left_px = left.iter().fold(0.0f64, |a, b| a.max(*b));
    if left_px > MOST_LEFT_PX || poses.len() < 2 {
        return Ok(None);
    }
    let path = Trajectory::new(std::path::Path::new("depth and motion"), times_s, poses).ok();
    Ok(path.map(|path| Tracked { path: path.smoothed(), left_px }))
}

/// Content of one frame in the space of the camera of the next.
fn step(depth: &Plane<f32>, motion: &Plane<f32>, k: &Intrinsics) -> Option<Pose> {
    let stride = (depth.width / ACROSS).max(1);
    let places = (stride / 2..depth.height).step_by(stride);
    let places: Vec<usize> = places
        .flat_map(|y| (stride / 2..depth.width).step_by(stride).map(move |x| (x, y)))
        .map(|(x, y)| y * depth.width + x)
        .filter(|&i| depth.data[i].is_finite())
        .collect();
    if places.len() < 50 {
        return None;
    }
    let mut pose = Pose::IDENTITY;
    for _ in 0..STEPS {
        let (mut a, mut b) = (vec![vec![0.0; 6]; 6], vec![0.0; 6]);
        for &i in &places {
            let Some((off, rows)) = equation(depth, motion, k, &pose, i) else { continue };
            let weight = 1.0 / (1.0 + off.length_squared() / (LARGE_PX * LARGE_PX));
            for (row, off) in rows.iter().zip([off.x, off.y]) {
                for m in 0..6 {
                    b[m] += weight * row[m] * off;
                    (0..6).for_each(|n| a[m][n] += weight * row[m] * row[n]);
                }
            }
        }
        let x = solve(&a, &b, 1e-9)?;
        let turn = DQuat::from_scaled_axis(DVec3::new(x[0], x[1], x[2]));
        pose = Pose {
            rotation: turn * pose.rotation,
            translation_m: turn * pose.translation_m + DVec3::new(x[3], x[4], x[5]),
        };
    }
    Some(pose)
}

/// What a pose leaves of the motion at a place, px, and how that falls with a turn and a step of the content.
fn equation(
    depth: &Plane<f32>,
    motion: &Plane<f32>,
    k: &Intrinsics,
    pose: &Pose,
    i: usize,
) -> Option<(DVec2, [[f64; 6]; 2])> {
    let (px, z) = (
        DVec2::new((i % depth.width) as f64 + 0.5, (i / depth.width) as f64 + 0.5),
        f64::from(depth.data[i]),
    );
    let point = pose.transform(k.ray(px) * z);
    let to = k.project(point)?;
    let seen = px + DVec2::new(f64::from(motion.data[2 * i]), f64::from(motion.data[2 * i + 1]));
    let (x, y, d) = (point.x / point.z, point.y / point.z, 1.0 / point.z);
    let moves = [
        [k.fx * -x * y, k.fx * (1.0 + x * x), k.fx * -y, k.fx * d, 0.0, k.fx * -x * d],
        [k.fy * -(1.0 + y * y), k.fy * x * y, k.fy * x, 0.0, k.fy * d, k.fy * -y * d],
    ];
    Some((seen - to, moves))
}

/// What a pose leaves of the motion everywhere, px.
fn rest(depth: &Plane<f32>, motion: &Plane<f32>, k: &Intrinsics, pose: &Pose) -> Plane<f32> {
    let of = |i: usize| {
        if !depth.data[i].is_finite() {
            return [0.0; 2];
        }
        equation(depth, motion, k, pose, i).map_or([0.0; 2], |(off, _)| off.as_vec2().to_array())
    };
    let data = (0..depth.data.len()).flat_map(of).collect();
    Plane { width: depth.width, height: depth.height, channels: 2, data }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::pair::frames::{Geometry, SimFrame};
    use std::sync::Arc;

    #[test]
    fn a_turn_and_a_step_are_found_beside_something_that_moves_by_itself() {
        let k = Intrinsics { width: 160, height: 120, fx: 140.0, fy: 140.0, cx: 80.0, cy: 60.0 };
        let depth = Plane::from_fn(160, 120, |x, y| [2.0 + x as f32 / 80.0 + ((y / 30) % 2) as f32]);
        let truth = Pose {
            rotation: DQuat::from_scaled_axis(DVec3::new(0.01, -0.03, 0.005)),
            translation_m: DVec3::new(0.02, -0.01, 0.03),
        };
        let motion = Plane::from_fn(160, 120, |x, y| {
            let px = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let to =
                k.project(truth.transform(k.ray(px) * f64::from(depth.pixel(x, y)[0]))).expect("before it")
                    - px;
            let own = if x > 60 && x < 90 && y > 40 { 6.0 } else { 0.0 };
            [to.x as f32 + own, to.y as f32]
        });
        let frame = || SimFrame {
            radiance: Arc::new(Plane::new(160, 120, 3)),
            depth: Some(depth.clone()),
            motion: [Some(motion.clone()), None],
            own: None,
            open: Plane::new(160, 120, 1),
            jumps: None,
        };
        let mut sim = SimFrames {
            frames: vec![frame(), frame()],
            times_s: vec![0.0, 0.1],
            period_s: 0.1,
            geometry: Geometry::None,
            linear: false,
        };
        let found = track(&mut sim, &k, &|| Ok(())).expect("in time").expect("a path");
        let step = found.path.pose_at(0.1).inverse().then_from(&found.path.pose_at(0.0));
        assert!((step.translation_m - truth.translation_m).length() < 1e-3, "{step:?}");
        assert!(step.rotation.angle_between(truth.rotation) < 1e-3, "{step:?}");
        let own = sim.frames[0].own.as_ref().expect("something moves");
        assert!(
            (own.pixel(75, 80)[0] - 6.0).abs() < 0.1 && own.pixel(20, 20)[0] == 0.0,
            "{:?}",
            own.pixel(75, 80)
        );
        let wrong = rest(&depth, &motion, &k, &Pose::IDENTITY);
        assert!(
            wrong.pixel(20, 20)[0].hypot(wrong.pixel(20, 20)[1]) > 1.0,
            "control: at rest all of it is left"
        );
    }
}
