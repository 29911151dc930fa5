//! How camera, balls and robots move: closed forms of the time, sampled into `.tum` files.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3, dvec3};
use shutterbug::camera::Pose;

use super::robots::BALL_RADIUS_M;

/// Number of frames.
const FRAMES: u32 = 24;
/// Frames a second.
pub const FRAME_RATE_HZ: f64 = 30.0;
/// Start of exposure of the first frame, s.
const START_S: f64 = 10.0;
/// First and last pose, s: room for slow shutters and for motion taken from earlier frames.
pub const SPAN_S: [f64; 2] = [9.8, 11.0];
/// The middle of the recording, s: the camera looks straight at the field then.
const MIDDLE_S: f64 = 10.4;
/// Mean speed of the pan, rad/s, and what is added to and taken from it in turn.
const PAN_RAD_PER_S: f64 = 0.9;
const PAN_SWAY_RAD: f64 = 0.02;
const PAN_SWAY_HZ: f64 = 2.2;
/// The carpet's height, m.
const GROUND_M: f64 = 0.01;

type Motion = Box<dyn Fn(f64) -> Pose>;

/// World from camera: the head of a robot at the touch line that pans to the left.
pub fn camera(time_s: f64) -> Pose {
    let t = time_s - MIDDLE_S;
    let pan = 0.43 + PAN_RAD_PER_S * t + PAN_SWAY_RAD * (TAU * PAN_SWAY_HZ * t).sin();
    let down = 0.13 + 0.006 * (TAU * 3.2 * t).sin();
    let forward = dvec3(pan.cos() * down.cos(), pan.sin() * down.cos(), -down.sin());
    let right = dvec3(pan.sin(), -pan.cos(), 0.0);
    let level = DQuat::from_mat3(&DMat3::from_cols(right, forward.cross(right), forward));
    let position = dvec3(-3.75 + 0.15 * t, -1.75 + 0.02 * (TAU * 1.6 * t).sin(), 0.95);
    Pose { rotation: level * DQuat::from_rotation_z(0.012 * (TAU * 1.6 * t).sin()), translation_m: position }
}

/// The frames' times and names.
pub fn frames_csv() -> String {
    let timestamp_ns = |i: u32| (START_S * 1e9) as u64 + u64::from(i) * 1_000_000_000 / FRAME_RATE_HZ as u64;
    let rows = (0..FRAMES).map(|i| format!("{},{i:06}.png\n", timestamp_ns(i)));
    std::iter::once("#timestamp [ns],filename\n".to_owned()).chain(rows).collect()
}

/// Where what rests stands, and how far it is turned to the left; `None` for what moves and for names that are none.
pub fn resting(name: &str) -> Option<(DVec3, f64)> {
    let (x, y, z, turn) = match name {
        "ball_4" => (1.9, 2.25, BALL_RADIUS_M, 0.0),
        "ball_5" => (-0.6, 2.35, BALL_RADIUS_M, 0.0),
        "robot_5" => (2.75, 0.25, 0.0, 3.1),
        "robot_6" => (-2.75, 0.1, 0.0, 0.1),
        "robot_7" => (1.7, 1.5, 0.0, -2.4),
        "robot_8" => (0.6, -1.5, 0.0, 2.0),
        _ => return None,
    };
    Some((dvec3(x, y, GROUND_M + z), turn))
}

/// What moves: names and poses.
pub fn objects() -> Vec<(&'static str, Motion)> {
    let ball = |from: [f64; 2], to: [f64; 2]| -> Motion { Box::new(move |t| rolling(t, from, to)) };
    let robot = |from: [f64; 2], heading: f64, speed: f64| -> Motion {
        Box::new(move |t| walking(t, from, heading, speed))
    };
    vec![
        ("ball_1", ball([-1.7, -0.9], [1.6, 0.9])),
        ("ball_2", ball([0.4, 0.6], [-0.9, 1.6])),
        ("ball_3", ball([1.2, -0.6], [-1.2, 0.3])),
        ("robot_1", robot([-1.75, -0.35], 2.75, 0.5)),
        ("robot_2", robot([-0.2, 0.95], 2.5, 0.6)),
        ("robot_3", robot([0.7, 0.1], 3.4, 0.5)),
        ("robot_4", robot([-1.2, 1.35], -0.6, 0.4)),
    ]
}

/// Rolls without slipping from `from` (at the middle of the recording), m, at `speed`, m/s.
fn rolling(time_s: f64, from: [f64; 2], speed: [f64; 2]) -> Pose {
    let t = time_s - MIDDLE_S;
    let velocity = dvec3(speed[0], speed[1], 0.0);
    let axis = DVec3::Z.cross(velocity.normalize());
    Pose {
        rotation: DQuat::from_axis_angle(axis, velocity.length() * t / BALL_RADIUS_M)
            * DQuat::from_rotation_x(0.5),
        translation_m: dvec3(from[0], from[1], GROUND_M + BALL_RADIUS_M) + velocity * t,
    }
}

/// Walks in a straight line and rocks from foot to foot.
fn walking(time_s: f64, from: [f64; 2], heading: f64, speed: f64) -> Pose {
    let t = time_s - MIDDLE_S;
    let step = TAU * 2.2 * t;
    let way = speed * t * dvec3(heading.cos(), heading.sin(), 0.0);
    let turn = DQuat::from_rotation_z(heading + 0.1 * step.sin());
    Pose {
        rotation: turn * DQuat::from_rotation_x(0.06 * step.cos()),
        translation_m: dvec3(from[0], from[1], GROUND_M + 0.006 * (1.0 + (2.0 * step).cos())) + way,
    }
}
