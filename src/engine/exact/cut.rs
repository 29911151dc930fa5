//! How finely triangles must be cut so that straight edges between corners that were projected at times of their own
//! stay near the curves that a rolling shutter makes of them.
//!
//! Over an edge, displacement is velocity times time, and both change: by dv and dt from end to end, and the velocity by
//! a dt on its own. To second order the chord is then off by `dv dt / 4 + a dt^2 / 8` in its middle. Velocities of the
//! picture's content differ over an angle s by at most (w + V/d) s for a camera that turns at w rad/s and passes at V
//! m/s what is d m away. The bound is taken over samples of the camera's path, so triangles are cut once, at load.

use glam::DVec3;

use super::super::Stage;
use crate::camera::{ExtendedLens, Intrinsics, Trajectory};
use crate::raster::{Mesh, MotionGroups};
use crate::scene::Vertex;

/// Samples of the path: the span of the trajectory, and three times in each of the frames that are expected.
const PATH_SAMPLES: usize = 64;
const FRAME_SAMPLES: usize = 96;
/// What is nearer to the lens is cut as if it were so far away, m.
const NEAREST_M: f64 = 0.15;
/// Angle beyond the picture's corner within which edges still count, rad.
const CONE_GUARD: f64 = 0.1;

/// The camera as a motion group sees it at one time.
struct Seen {
    eye_m: DVec3,
    axis: DVec3,
    /// rad/s and m/s.
    turn: f64,
    pass: f64,
    /// Their derivatives.
    turn_change: f64,
    pass_change: f64,
}

/// Cuts the mesh for a readout so that chords are off by at most `chord_px`, or by as little as `most` triangles allow;
/// also returns what was reached, px.
pub(super) fn cut(
    stage: &Stage,
    groups: &MotionGroups,
    mesh: &Mesh,
    frames: &[(f64, f64)],
    readout_time_s: f64,
    (chord_px, most): (f64, usize),
) -> (Mesh, f64) {
    let times = sample_times(&stage.trajectory, frames);
    let seen: Vec<Vec<Seen>> = (0..groups.count())
        .map(|g| times.iter().filter_map(|&t| see(&stage.trajectory, groups, g, t, readout_time_s)).collect())
        .collect();
    let bound = Bound::new(&stage.intrinsics, stage.lens.as_ref().map(|l| &l.extended), readout_time_s);
    let mut allowed_px = chord_px;
    loop {
        let long = |a: &Vertex, b: &Vertex| {
            let group = a.object as usize;
            bound.is_long(&seen[group], a, b, allowed_px)
                || stage.lens.as_ref().is_some_and(|l| l.chords.is_long(group, a, b, 0.5 * allowed_px))
        };
        match mesh.split(long, most) {
            Some(cut) => return (cut, allowed_px),
            None => allowed_px *= 2.0,
        }
        if allowed_px > 1e3 {
            return (mesh.clone(), allowed_px);
        }
    }
}

fn sample_times(path: &Trajectory, frames: &[(f64, f64)]) -> Vec<f64> {
    let stride = (3 * frames.len()).div_ceil(FRAME_SAMPLES).max(1);
    let mut times: Vec<f64> =
        frames.iter().step_by(stride).flat_map(|&(from, to)| [from, 0.5 * (from + to), to]).collect();
    let (from_s, to_s) = path.span_s();
    if from_s.is_finite() && to_s.is_finite() {
        let step_s = (to_s - from_s) / (PATH_SAMPLES - 1) as f64;
        times.extend((0..PATH_SAMPLES).map(|i| from_s + step_s * i as f64));
    }
    times
}

/// Differences over a quarter of the readout; `None` where there are no poses for them.
fn see(path: &Trajectory, groups: &MotionGroups, group: usize, time_s: f64, readout_s: f64) -> Option<Seen> {
    let step_s = 0.25 * readout_s;
    let covered = |t: f64| path.covers(t, t) && groups.covers(group, t);
    // Moved inwards where the trajectory begins or ends.
    let time_s = [time_s, time_s + step_s, time_s - step_s]
        .into_iter()
        .find(|t| covered(t - step_s) && covered(t + step_s))?;
    let pose = |t: f64| groups.world_from_object(group, t).inverse().then_from(&path.pose_at(t));
    let [before, now, after] = [time_s - step_s, time_s, time_s + step_s].map(pose);
    let turn = |a: glam::DQuat, b: glam::DQuat| (a.inverse() * b).to_scaled_axis() / step_s;
    let turns = [turn(before.rotation, now.rotation), turn(now.rotation, after.rotation)];
    let passes = [now.translation_m - before.translation_m, after.translation_m - now.translation_m]
        .map(|way_m| way_m / step_s);
    Some(Seen {
        eye_m: now.translation_m,
        axis: now.rotation * DVec3::Z,
        turn: turns[0].length().max(turns[1].length()),
        pass: passes[0].length().max(passes[1].length()),
        turn_change: (turns[1] - turns[0]).length() / step_s,
        pass_change: (passes[1] - passes[0]).length() / step_s,
    })
}

struct Bound {
    focal_px: f64,
    line_delay_s: f64,
    readout_time_s: f64,
    cone: f64,
}

impl Bound {
    fn new(k: &Intrinsics, lens: Option<&ExtendedLens>, readout_time_s: f64) -> Self {
        let (w, h) = (f64::from(k.width), f64::from(k.height));
        let corner = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|(x, y)| {
            let ray = k.ray(glam::DVec2::new(x, y));
            ray.angle_between(DVec3::Z)
        });
        let stretch = lens.map_or(1.0, ExtendedLens::stretch);
        Self {
            focal_px: stretch * k.fx.max(k.fy),
            // The shorter side: a readout along it has the greater delay a line.
            line_delay_s: readout_time_s / w.min(h),
            readout_time_s,
            cone: match lens {
                Some(lens) => lens.radius().atan(),
                None => corner.into_iter().fold(0.0, f64::max) + CONE_GUARD,
            },
        }
    }

    fn is_long(&self, seen: &[Seen], a: &Vertex, b: &Vertex, allowed_px: f64) -> bool {
        let [a, b] = [a, b].map(|v| DVec3::from(v.position_m.map(f64::from)));
        let middle = 0.5 * (a + b);
        let length_m = (b - a).length();
        seen.iter().any(|s| {
            let to_middle = middle - s.eye_m;
            let along = ((s.eye_m - a).dot(b - a) / (length_m * length_m).max(1e-12)).clamp(0.0, 1.0);
            let away_m = (a + along * (b - a) - s.eye_m).length();
            let inside = (0.5 * length_m / to_middle.length().max(1e-9)).min(1.0).asin();
            if away_m > NEAREST_M && to_middle.angle_between(s.axis) - inside > self.cone {
                return false;
            }
            let away_m = away_m.max(NEAREST_M);
            let span_px = self.focal_px * length_m / away_m;
            let span_s = (span_px * self.line_delay_s).min(self.readout_time_s);
            let speeds = (s.turn + s.pass / away_m) * span_px;
            let change = (s.turn_change + s.pass_change / away_m) * self.focal_px;
            span_s * (0.25 * speeds + 0.125 * change * span_s) > allowed_px
        })
    }
}
