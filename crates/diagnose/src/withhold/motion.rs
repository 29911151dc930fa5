//! How the camera of a case moves: as a hand holds it, as a robot turns it, or as one was recorded.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::draw::Draw;
use super::room::Mover;
use shutterbug::camera::{Pose, Trajectory};
use shutterbug::capture::read_text;
use shutterbug::error::{Error, Result};
use shutterbug::files::Limit;

/// Poses a second of what is written.
const RATE_HZ: f64 = 250.0;
/// Poses before and after the one that is smoothed, in recordings: their four decimals would else be seen as shaking.
const SMOOTHING: usize = 4;

/// A path of the camera, world from camera, over `0..duration_s`.
pub(super) struct Motion {
    pub(super) name: String,
    poses: Vec<Pose>,
}

impl Motion {
    /// Draws one; recordings, where there are any, come up half of the time.
    ///
    /// # Errors
    /// A recording that cannot be read.
    pub(super) fn draw(draw: &mut Draw, recordings: &[PathBuf], duration_s: f64) -> Result<Self> {
        let count = (duration_s * RATE_HZ).ceil() as usize + 1;
        if !recordings.is_empty() && draw.chance(0.5) {
            let recording = &recordings[draw.index(recordings.len())];
            return recorded(draw, recording, count);
        }
        Ok(if draw.chance(0.5) { hand(draw, count) } else { robot(draw, count) })
    }

    /// The text of `trajectory.tum`: the first pose is that of `start_s`.
    pub(super) fn tum(&self, start_s: f64) -> String {
        let mut text = String::from("# t tx ty tz qx qy qz qw\n");
        for (i, pose) in self.poses.iter().enumerate() {
            line(&mut text, start_s + i as f64 / RATE_HZ, pose);
        }
        text
    }
}

/// The text of `objects/<name>.tum` for a span of time.
pub(super) fn object_tum(mover: &Mover, start_s: f64, duration_s: f64) -> String {
    let mut text = String::new();
    for i in 0..=(duration_s * RATE_HZ).ceil() as usize {
        let time_s = start_s + i as f64 / RATE_HZ;
        let (at, angle) = mover.at(time_s);
        line(
            &mut text,
            time_s,
            &Pose { rotation: DQuat::from_rotation_z(angle), translation_m: DVec3::from(at) },
        );
    }
    text
}

fn line(text: &mut String, time_s: f64, pose: &Pose) {
    let (t, q) = (pose.translation_m, pose.rotation);
    let written = writeln!(
        text,
        "{time_s:.6} {:.9} {:.9} {:.9} {:.12} {:.12} {:.12} {:.12}",
        t.x, t.y, t.z, q.x, q.y, q.z, q.w
    );
    written.expect("a String");
}

/// World from camera of a camera that looks along `yaw` (0 is +x), `pitch` up, `roll` about its axis.
fn looking(yaw: f64, pitch: f64, roll: f64) -> DQuat {
    let body = DQuat::from_rotation_z(yaw) * DQuat::from_rotation_y(-pitch);
    body * Pose::body_from_camera() * DQuat::from_rotation_z(roll)
}

/// A hand: slow wandering, faster shaking, in all six directions.
fn hand(draw: &mut Draw, count: usize) -> Motion {
    let wave = |draw: &mut Draw, amplitude: f64| {
        let (slow, fast) = (draw.between(0.3, 0.9), draw.between(1.5, 4.0));
        let (a, b) = (draw.between(0.0, TAU), draw.between(0.0, TAU));
        move |t: f64| amplitude * ((TAU * slow * t + a).sin() + 0.15 * (TAU * fast * t + b).sin())
    };
    let turn = draw.between(0.15, 0.6);
    let angles = [wave(draw, turn), wave(draw, 0.5 * turn), wave(draw, 0.3 * turn)];
    let places = [wave(draw, 0.2), wave(draw, 0.2), wave(draw, 0.1)];
    let heading = draw.between(0.0, TAU);
    let pose = |i: usize| {
        let t = i as f64 / RATE_HZ;
        let rotation = looking(heading + angles[0](t), -0.1 + angles[1](t), angles[2](t));
        Pose { rotation, translation_m: DVec3::new(places[0](t), places[1](t), 1.4 + places[2](t)) }
    };
    Motion { name: "hand".to_owned(), poses: (0..count).map(pose).collect() }
}

/// A robot: it drives on an arc, turns its head from one direction to the next and stops there, and trembles as it
/// goes.
fn robot(draw: &mut Draw, count: usize) -> Motion {
    let heading = draw.between(0.0, TAU);
    let (sweep, period_s) = (draw.between(0.4, 1.3), draw.between(0.5, 1.4));
    let (speed, tremble_hz, tremble) =
        (draw.between(0.0, 0.5), draw.between(5.0, 12.0), draw.between(0.0, 0.004));
    let phase = draw.unit();
    let mut yaw_from = 0.0;
    let turns: Vec<f64> = (0..64).map(|_| draw.between(-sweep, sweep)).collect();
    let poses = (0..count).map(|i| {
        let t = i as f64 / RATE_HZ;
        let steps = t / period_s + phase;
        let (step, part) = (steps as usize % turns.len(), steps.fract());
        if step > 0 {
            yaw_from = turns[step - 1];
        }
        // Moves during four fifths of a step, with a smooth start and end.
        let part = (part / 0.8).min(1.0);
        let eased = 0.5 - 0.5 * (PI * part).cos();
        let shake = tremble * (TAU * tremble_hz * t).sin();
        let yaw = heading + yaw_from + (turns[step] - yaw_from) * eased;
        let rotation = looking(yaw, -0.05 + shake, 0.5 * shake);
        let along = DVec3::new(heading.cos(), heading.sin(), 0.0) * (speed * t - 0.3);
        Pose { rotation, translation_m: along + DVec3::new(0.0, 0.0, 1.0) }
    });
    Motion { name: "robot".to_owned(), poses: poses.collect() }
}

/// A stretch of a recording, smoothed, moved to the middle of the room.
fn recorded(draw: &mut Draw, path: &Path, count: usize) -> Result<Motion> {
    let text = read_text(path, "recorded motion: lines of t tx ty tz qx qy qz qw", Limit::TABLE)?;
    let first = text.lines().find(|l| !l.trim_start().starts_with('#') && !l.trim().is_empty());
    let epoch_s = first.and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok()).unwrap_or(0.0);
    let trajectory = Trajectory::parse(path, &text, (epoch_s * 1e9) as i64)?;
    let (from_s, to_s) = trajectory.span_s();
    let (step_s, margin_s) = (1.0 / RATE_HZ, SMOOTHING as f64 * 0.01);
    let last_start_s = to_s - margin_s - count as f64 * step_s;
    if last_start_s <= from_s + margin_s {
        let found = format!("{:.1} s of motion", to_s - from_s);
        return Err(Error::input(
            path,
            None,
            found,
            format!("at least {:.1} s", count as f64 * step_s + 0.1),
        ));
    }
    let start_s = draw.between(from_s + margin_s, last_start_s);
    let smoothed: Vec<Pose> = (0..count).map(|i| mean(&trajectory, start_s + i as f64 * step_s)).collect();
    // Where the recorded camera looked is unknown to the room: the first pose looks level, the rest follows it.
    let origin = Pose {
        rotation: looking(draw.between(0.0, TAU), 0.0, 0.0),
        translation_m: DVec3::new(0.0, 0.0, 1.4),
    };
    let back = smoothed[0].inverse();
    let poses = smoothed.iter().map(|pose| {
        let rotation = (origin.rotation * back.rotation * pose.rotation).normalize();
        let moved = origin.rotation
            * (smoothed[0].rotation.inverse() * (pose.translation_m - smoothed[0].translation_m));
        // The camera must stay off the walls and the things before them.
        Pose { rotation, translation_m: origin.translation_m + moved.clamp_length_max(0.9) }
    });
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Motion { name, poses: poses.collect() })
}

/// Mean pose of a tenth of a second around an instant, weighted towards it.
fn mean(trajectory: &Trajectory, time_s: f64) -> Pose {
    let centre = trajectory.pose_at(time_s);
    let (mut place, mut turn, mut total) = (DVec3::ZERO, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), 0.0);
    let reach = SMOOTHING as i32;
    for k in -reach..=reach {
        let weight = 1.0 - f64::from(k.abs()) / f64::from(reach + 1);
        let pose = trajectory.pose_at(time_s + 0.01 * f64::from(k));
        let sign = if pose.rotation.dot(centre.rotation) < 0.0 { -1.0 } else { 1.0 };
        place += weight * pose.translation_m;
        turn += pose.rotation * (sign * weight);
        total += weight;
    }
    Pose { rotation: turn.normalize(), translation_m: place / total }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn made_motion_is_smooth_and_stays_in_the_room() {
        for case in 0..40 {
            let motion =
                Motion::draw(&mut Draw::new(3, case, "motion"), &[], 1.0).unwrap_or_else(|e| panic!("{e}"));
            let trajectory =
                Trajectory::parse(Path::new("t.tum"), &motion.tum(0.0), 0).unwrap_or_else(|e| panic!("{e}"));
            assert!(trajectory.covers(0.0, 1.0));
            for pair in motion.poses.windows(2) {
                let (a, b) = (pair[0], pair[1]);
                // 8 rad/s is faster than any pan-tilt head.
                assert!(a.rotation.angle_between(b.rotation) * RATE_HZ < 8.0, "{}: jump", motion.name);
                assert!(b.translation_m.truncate().length() < 1.0, "{}: {}", motion.name, b.translation_m);
            }
        }
    }

    #[test]
    fn level_cameras_see_down_below() {
        // A point below and ahead of a level camera lies below the middle of its picture.
        let camera = looking(0.3, 0.0, 0.0);
        let ahead = DVec3::new(0.3f64.cos(), 0.3f64.sin(), -0.1);
        let seen = camera.inverse() * ahead;
        assert!(seen.z > 0.9 && seen.y > 0.05 && seen.x.abs() < 1e-9, "{seen}");
    }
}
