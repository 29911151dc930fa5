//! Poses of a board that moves: a smooth path through those of the frames, and where it was when a line of the sensor
//! was read.

use std::path::Path;

use glam::DQuat;

use shutterbug::camera::{Pose, Trajectory};
use shutterbug::error::Result;

/// Frames further apart than this many usual intervals have nothing between them that is known.
const GAP: f64 = 1.5;
/// Poses that are written for each interval between frames: between them the contract's straight lines hold, and a bend
/// of one interval is met to one over the square of this.
const PER_INTERVAL: usize = 8;
/// Step of derivatives by time, as a share of the time between frames.
const STEP: f64 = 1e-3;

/// The path of a camera past a board at rest.
pub(super) struct BoardPath {
    trajectory: Trajectory,
    starts_s: Vec<f64>,
    /// Usual time between frames, s.
    pub(super) period_s: f64,
}

impl BoardPath {
    /// Through the poses (camera from board) of frames that began at these times.
    pub(super) fn new(starts_s: &[f64], poses: &[Pose]) -> Result<Self> {
        let inverse = poses.iter().map(Pose::inverse).collect();
        let trajectory =
            Trajectory::new(Path::new("the board's frames"), starts_s.to_vec(), inverse)?.smoothed();
        Ok(Self { trajectory, starts_s: starts_s.to_vec(), period_s: usual_interval_s(starts_s) })
    }

    /// What takes the pose at a frame's start to the pose a moment later, and how that changes by time (per s): the
    /// pose a little later over the pose.
    pub(super) fn since(&self, view: usize, late_s: f64) -> (Pose, Pose, f64) {
        let step_s = STEP * self.period_s;
        let start_s = self.starts_s[view];
        let from = self.camera_from_board(start_s).inverse();
        let now = self.camera_from_board(start_s + late_s);
        let then = self.camera_from_board(start_s + late_s + step_s);
        (now.then_from(&from), then.then_from(&now.inverse()), step_s)
    }

    /// The pose at a time; beyond the first and last frames' starts with the speed that it has there. That is for fits
    /// alone: what is written is never extrapolated.
    fn camera_from_board(&self, time_s: f64) -> Pose {
        let (first_s, last_s) = self.trajectory.span_s();
        let inside_s = time_s.clamp(first_s, last_s);
        let at = self.trajectory.pose_at(inside_s);
        if time_s == inside_s {
            return at.inverse();
        }
        let step_s = (STEP * self.period_s).min(last_s - first_s);
        let inward_s = if time_s > last_s { inside_s - step_s } else { inside_s + step_s };
        let before = self.trajectory.pose_at(inward_s);
        let steps = (time_s - inside_s) / (inside_s - inward_s);
        let turn = (before.rotation.conjugate() * at.rotation).to_scaled_axis() * steps;
        let beyond = Pose {
            rotation: (at.rotation * DQuat::from_scaled_axis(turn)).normalize(),
            translation_m: at.translation_m + (at.translation_m - before.translation_m) * steps,
        };
        beyond.inverse()
    }

    /// The trajectory as the contract's straight lines, `late_s` later, over what frames with neighbours on both sides
    /// need; and which frames those are.
    pub(super) fn written(&self, late_s: f64) -> Result<(Trajectory, Vec<usize>)> {
        let n = self.starts_s.len();
        let near = |i: usize| self.starts_s[i + 1] - self.starts_s[i] <= GAP * self.period_s;
        let kept: Vec<usize> = (1..n.saturating_sub(1)).filter(|&i| near(i - 1) && near(i)).collect();
        let (first_s, last_s) = self.trajectory.span_s();
        let mut times_s = Vec::new();
        for i in 0..n.saturating_sub(1) {
            let (from_s, to_s) = (self.starts_s[i], self.starts_s[i + 1]);
            let parts =
                (PER_INTERVAL as f64 * ((to_s - from_s) / self.period_s)).ceil().clamp(1.0, 64.0) as usize;
            times_s.extend((0..parts).map(|k| from_s + (to_s - from_s) * k as f64 / parts as f64));
        }
        times_s.push(last_s);
        let poses = times_s.iter().map(|t| self.trajectory.pose_at(t.clamp(first_s, last_s))).collect();
        let times_s = times_s.iter().map(|t| t + late_s).collect();
        Ok((Trajectory::new(Path::new("trajectory.tum"), times_s, poses)?, kept))
    }
}

/// The middle of the times between frames, s.
pub(super) fn usual_interval_s(starts_s: &[f64]) -> f64 {
    let mut intervals: Vec<f64> = starts_s.windows(2).map(|w| w[1] - w[0]).collect();
    intervals.sort_by(f64::total_cmp);
    intervals.get(intervals.len() / 2).copied().unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn the_path_is_where_the_board_was_and_frames_beside_a_gap_are_left_out() {
        let pose = |t: f64| Pose {
            rotation: DQuat::from_rotation_y(0.3 * t),
            translation_m: DVec3::new(0.2 * t, 0.1 * t * t, 1.0),
        };
        let starts_s: Vec<f64> = (0..12).filter(|i| *i != 6).map(|i| f64::from(i) * 0.1).collect();
        let poses: Vec<Pose> = starts_s.iter().map(|t| pose(*t)).collect();
        let path = BoardPath::new(&starts_s, &poses).expect("increasing");
        let (since, _, _) = path.since(3, 0.04);
        let (is, should) = (since.then_from(&poses[3]), pose(starts_s[3] + 0.04));
        assert!((is.translation_m - should.translation_m).length() < 1e-4, "{is:?} {should:?}");
        let (beyond, _, _) = path.since(10, 0.02);
        let (is, should) = (beyond.then_from(&poses[10]), pose(1.12));
        assert!((is.translation_m - should.translation_m).length() < 2e-3, "{is:?} {should:?}");
        // Control: a straight line between the frames is off by more.
        let line = poses[3].interpolate(&poses[4], 0.4);
        assert!((line.translation_m - should.translation_m).length() > 2e-4);
        let (written, kept) = path.written(0.0).expect("poses");
        assert_eq!(kept, [1, 2, 3, 4, 7, 8, 9], "the gap is between 5 and 6");
        assert!(written.covers(0.0, 1.1));
    }
}
