//! Between recorded poses along a curve that bends as they do: for poses that lie so far apart that straight lines
//! between them would be seen, as the steps of a physics engine under a camera that shakes.

use glam::{DQuat, DVec3};

use super::Pose;

/// The pose at a time within step `before` (from its pose to the next). The parabolas through either end and its two
/// neighbours are blended (a cubic with continuous speed); a constant acceleration, and a turn about one axis whose
/// rate changes evenly, are met exactly. At a recorded time: that pose. The outermost steps lie on one parabola.
pub(super) fn pose_within(times_s: &[f64], poses: &[Pose], before: usize, time_s: f64) -> Pose {
    let own = &poses[before];
    // Relative to the step's first pose turns are small, and vectors of them may be added.
    let turn_of = |i: usize| {
        let turn = own.rotation.conjugate() * poses[i].rotation;
        // The shorter arc.
        let turn = if turn.w < 0.0 { -turn } else { turn };
        (turn.to_scaled_axis(), poses[i].translation_m - own.translation_m)
    };
    let share = (time_s - times_s[before]) / (times_s[before + 1] - times_s[before]);
    let left = (before > 0).then(|| before - 1);
    let right = (before + 2 < times_s.len()).then_some(before);
    let parabola = |first: usize| {
        let weights = lagrange([times_s[first], times_s[first + 1], times_s[first + 2]], time_s);
        weights.iter().enumerate().fold((DVec3::ZERO, DVec3::ZERO), |sum, (i, w)| {
            let (turn, moved_m) = turn_of(first + i);
            (sum.0 + *w * turn, sum.1 + *w * moved_m)
        })
    };
    let (turn, moved_m) = match (left, right) {
        (Some(left), Some(right)) => {
            let (a, b) = (parabola(left), parabola(right));
            ((1.0 - share) * a.0 + share * b.0, (1.0 - share) * a.1 + share * b.1)
        }
        (Some(only), None) | (None, Some(only)) => parabola(only),
        (None, None) => {
            let (turn, moved_m) = turn_of(before + 1);
            (share * turn, share * moved_m)
        }
    };
    Pose {
        rotation: (own.rotation * DQuat::from_scaled_axis(turn)).normalize(),
        translation_m: own.translation_m + moved_m,
    }
}

/// Weights of three points in the parabola through them.
fn lagrange([a, b, c]: [f64; 3], t: f64) -> [f64; 3] {
    [
        (t - b) * (t - c) / ((a - b) * (a - c)),
        (t - a) * (t - c) / ((b - a) * (b - c)),
        (t - a) * (t - b) / ((c - a) * (c - b)),
    ]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::camera::Trajectory;

    /// Poses of a motion at uneven times, and the largest distance and angle of what lies between them from it.
    fn worst(smooth: bool, times_s: &[f64], motion: impl Fn(f64) -> Pose) -> [f64; 2] {
        let poses = times_s.iter().map(|&t| motion(t)).collect();
        let path = Trajectory::new(std::path::Path::new("t"), times_s.to_vec(), poses).expect("a path");
        let path = if smooth { path.smoothed() } else { path };
        let (from, to) = path.span_s();
        let mut worst = [0.0_f64; 2];
        for i in 0..=997 {
            let t = from + (to - from) * f64::from(i) / 997.0;
            let (got, want) = (path.pose_at(t), motion(t));
            worst[0] = worst[0].max((got.translation_m - want.translation_m).length());
            worst[1] = worst[1].max(got.rotation.angle_between(want.rotation));
        }
        worst
    }

    #[test]
    fn what_accelerates_evenly_is_met_and_what_shakes_nearly() {
        let even = |t: f64| Pose {
            rotation: DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.5 * t + 40.0 * t * t),
            translation_m: DVec3::new(0.3 + t, -2.0 * t * t, 9.0 * t * t + 1e4),
        };
        let uneven = [0.0, 0.002, 0.0031, 0.006, 0.0075, 0.01];
        for times_s in [&uneven[..], &uneven[..3]] {
            let [metres, radians] = worst(true, times_s, even);
            assert!(metres < 1e-9 && radians < 1e-7, "{metres} m, {radians} rad");
        }
        let [metres, radians] = worst(false, &uneven, even);
        assert!(metres > 1e-6 && radians > 1e-5, "control: straight lines pass, {metres} m, {radians} rad");

        let shake = |t: f64| Pose {
            rotation: DQuat::from_rotation_x(0.02 * (TAU * 25.0 * t).sin()),
            translation_m: DVec3::new(0.01 * (TAU * 18.0 * t).cos(), 0.0, 0.0),
        };
        let steps: Vec<_> = (0..=16).map(|i| 0.002 * f64::from(i)).collect();
        let (cubic, straight) = (worst(true, &steps, shake), worst(false, &steps, shake));
        assert!(cubic[0] < 0.25 * straight[0] && cubic[1] < 0.25 * straight[1], "{cubic:?} of {straight:?}");
    }

    #[test]
    fn recorded_poses_are_met_and_two_of_them_make_a_straight_line() {
        let pose = |t: f64| Pose {
            rotation: DQuat::from_rotation_y(t) * DQuat::from_rotation_z(0.5 * t * t),
            translation_m: DVec3::new(t, t * t, 1.0),
        };
        let times_s: Vec<f64> = vec![0.0, 0.5, 0.7, 1.5];
        let poses: Vec<_> = times_s.iter().map(|&t| pose(t)).collect();
        let path =
            Trajectory::new(std::path::Path::new("t"), times_s.clone(), poses.clone()).expect("a path");
        let path = path.smoothed();
        for (t, want) in times_s.iter().zip(&poses) {
            let got = path.pose_at(*t);
            assert!((got.translation_m - want.translation_m).length() < 1e-12, "{t}");
            assert!(got.rotation.angle_between(want.rotation) < 1e-7, "{t}");
        }
        let two = |smooth: bool| {
            let path = Trajectory::new(std::path::Path::new("t"), vec![0.0, 1.5], vec![poses[0], poses[3]]);
            let path = path.expect("a path");
            if smooth { path.smoothed() } else { path }.pose_at(0.4)
        };
        assert!((two(true).translation_m - two(false).translation_m).length() < 1e-12);
        assert!(two(true).rotation.angle_between(two(false).rotation) < 1e-7);
        // Control: with those in between it is another place.
        assert!((path.pose_at(0.4).translation_m - two(true).translation_m).length() > 0.1);
    }
}
