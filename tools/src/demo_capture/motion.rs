//! How camera, ball and robot move: closed forms of the time, sampled into `.tum` files.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use glam::{DMat3, DQuat, DVec3, dvec3};
use shutterbug::camera::Pose;

use super::field::BALL_RADIUS_M;

/// Number of frames.
pub const FRAMES: u32 = 6;
/// Frames a second.
pub const FRAME_RATE_HZ: f64 = 30.0;
/// Start of exposure of the first frame, s.
pub const START_S: f64 = 10.0;
/// First and last pose, s: room for slow shutters and for motion taken from earlier frames.
pub const SPAN_S: [f64; 2] = [9.6, 10.6];

/// The head looks from right to left and back, as robots do that search the ball.
const PAN_AMPLITUDE_RAD: f64 = 0.16;
const PAN_HZ: f64 = 2.6;
/// The first frame lies just after a turning point, the fourth at the fastest moment.
const PAN_PHASE_RAD: f64 = -1.48;
/// Steps with the left and the right foot, pairs a second.
const GAIT_HZ: f64 = 1.6;

/// Rotation of the head about the vertical, to the left, rad.
pub fn pan_rad(time_s: f64) -> f64 {
    PAN_AMPLITUDE_RAD * (TAU * PAN_HZ * (time_s - START_S) + PAN_PHASE_RAD).sin()
}

/// World from camera: a head at 0.62 m that walks towards +x behind the blue goal.
pub fn camera(time_s: f64) -> Pose {
    let t = time_s - START_S;
    let step = TAU * GAIT_HZ * t;
    let position = dvec3(-4.28 + 0.15 * t, 0.02 * step.sin(), 0.62 + 0.012 * (2.0 * step).cos());
    let pan = pan_rad(time_s);
    let down = 0.085 + 0.015 * (2.0 * step + 0.6).sin();
    let roll = 0.02 * (step + 0.3).sin();
    let forward = dvec3(pan.cos() * down.cos(), pan.sin() * down.cos(), -down.sin());
    let right = dvec3(pan.sin(), -pan.cos(), 0.0);
    let level = DQuat::from_mat3(&DMat3::from_cols(right, forward.cross(right), forward));
    Pose { rotation: level * DQuat::from_rotation_z(roll), translation_m: position }
}

/// World from ball: it rolls across the view without slipping, at 2 m/s.
pub fn ball(time_s: f64) -> Pose {
    let t = time_s - START_S;
    let direction = dvec3(0.25, -1.0, 0.0).normalize();
    let way_m = 2.0 * t;
    let position = dvec3(-2.65, 0.2, BALL_RADIUS_M) + direction * way_m;
    let tilt = DQuat::from_rotation_x(0.5);
    Pose {
        rotation: DQuat::from_axis_angle(DVec3::Z.cross(direction), way_m / BALL_RADIUS_M) * tilt,
        translation_m: position,
    }
}

/// World from robot: it walks to the left, 0.9 m/s, and rocks from foot to foot.
pub fn robot(time_s: f64) -> Pose {
    let t = time_s - START_S;
    let step = TAU * 2.2 * t;
    let heading = DQuat::from_rotation_z(1.45 + 0.1 * step.sin());
    Pose {
        rotation: heading * DQuat::from_rotation_x(0.06 * step.cos()),
        translation_m: dvec3(-1.5, -0.55 + 0.9 * t, 0.006 * (1.0 + (2.0 * step).cos())),
    }
}

/// The text of a `.tum` file over a span, s: time s, position m, unit quaternion x y z w without sign jumps.
pub fn tum(span_s: [f64; 2], rate_hz: u32, pose: impl Fn(f64) -> Pose) -> String {
    let mut text = String::new();
    let mut before: Option<DQuat> = None;
    let lines = ((span_s[1] - span_s[0]) * f64::from(rate_hz)).round() as u32;
    for i in 0..=lines {
        let time_s = span_s[0] + f64::from(i) / f64::from(rate_hz);
        let pose = pose(time_s);
        let flip = before.is_some_and(|b| b.dot(pose.rotation) < 0.0);
        let q = if flip { -pose.rotation } else { pose.rotation };
        before = Some(q);
        let t = pose.translation_m;
        writeln!(
            text,
            "{time_s:.9} {:.7} {:.7} {:.7} {:.9} {:.9} {:.9} {:.9}",
            t.x + 0.0,
            t.y + 0.0,
            t.z,
            q.x,
            q.y,
            q.z,
            q.w
        )
        .expect("writing to a String cannot fail");
    }
    text
}

/// Timestamp of a frame, ns: exact thirds of 100 ms, rounded down.
pub fn timestamp_ns(frame: u32) -> u64 {
    10_000_000_000 + u64::from(frame) * 1_000_000_000 / 30
}
