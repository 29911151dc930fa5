//! `pose_error`: six numbers a frame. How pictures change by them follows from depth, so that a step costs one render.

use glam::{DQuat, DVec3};

use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::linear::{back, cholesky};
use crate::diagnose::expect::model::{P, Theta};
use shutterbug::camera::{Pose, Trajectory};
use shutterbug::plane::Plane;
use shutterbug::plane::stats::median;

/// Units of the six numbers while they are solved for: a milliradian and a centimetre are a few tenths of a px.
pub(crate) const UNITS: [f64; 6] = [1e-3, 1e-3, 1e-3, 1e-2, 1e-2, 1e-2];
/// Share of a number's own curvature that is added to it: what a frame does not show stays as it is.
const RIDGE: f64 = 1e-4;

/// What is known of the pose of one frame beside the parameters of a fit.
#[derive(Clone, Debug)]
pub(crate) struct PoseShare {
    /// Place.
    pub at: usize,
    /// Its best step where the parameters stay, units.
    step: [f64; 6],
    /// How much less of it a step of each parameter leaves.
    cross: Vec<[f64; 6]>,
}

impl PoseShare {
    /// Moves the pose with a step of the parameters; `whole`: by its own step too.
    pub(crate) fn follow(&self, theta: &mut Theta, step: &[f64], lengths: f64, whole: bool) {
        let Some(pose) = theta.room.poses.get_mut(self.at) else { return };
        for i in 0..6 {
            let own = if whole { self.step[i] } else { 0.0 };
            let less: f64 = self.cross.iter().zip(step).map(|(c, s)| c[i] * s).sum();
            pose[i] += UNITS[i] * (own - lengths * less);
        }
    }
}

/// How far poses are off as a rule: turns and steps, units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Usual([f64; 2]);

/// Least that poses are off as a rule, units: a tenth of a milliradian and a millimetre.
const LEAST: f64 = 0.1;
/// Median of the absolute values of a normal variable, over its standard deviation.
const MEDIAN: f64 = 0.6745;
/// From so many times the usual on the pose of a frame is doubted. One that the frame shows comes out again.
const DOUBTED: f64 = 6.0;

impl Usual {
    /// Of some poses, a few of which may have gone astray; nothing where none is off.
    pub(crate) fn of<'a>(poses: impl Iterator<Item = &'a [f64; 6]> + Clone) -> Option<Self> {
        let size = |from: usize| {
            let all = poses.clone().flat_map(|v| (from..from + 3).map(|i| (v[i] / UNITS[i]).abs()));
            (median(all) / MEDIAN).max(LEAST)
        };
        let any = poses.clone().any(|v| *v != [0.0; 6]);
        any.then(|| Self([size(0), size(3)]))
    }

    /// Whether a pose is further off than a tracker is.
    pub(crate) fn is_doubted(&self, pose: &[f64; 6]) -> bool {
        (0..6).any(|i| (pose[i] / UNITS[i]).abs() > DOUBTED * self.0[i / 3])
    }

    /// Adds what is known of poses to the normal equations of one: `scale` is what a unit of their cost is worth.
    pub(crate) fn hold(&self, a: &mut [Vec<f64>], b: &mut [f64], pose: &[f64; 6], scale: f64) {
        for i in 0..6 {
            let known = scale / self.0[i / 3].powi(2);
            a[i][i] += known;
            b[i] -= known * pose[i] / UNITS[i];
        }
    }
}

/// The pose that six numbers make, in the camera's own frame.
pub(crate) fn pose_of(v: &[f64; 6]) -> Pose {
    Pose {
        rotation: DQuat::from_scaled_axis(DVec3::new(v[0], v[1], v[2])),
        translation_m: DVec3::new(v[3], v[4], v[5]),
    }
}

impl Forward {
    /// The trajectory with the poses of `theta`: each frame's while its lines are read, and on a straight line between.
    pub(crate) fn corrected(&self, path: &Trajectory, theta: &Theta) -> Trajectory {
        let mut knots: Vec<(f64, [f64; 6])> = Vec::new();
        for (at, pose) in theta.room.poses.iter().enumerate() {
            let shutter = self.shutter(at, theta);
            for time_s in [shutter.start_s, shutter.end_s()] {
                if knots.last().is_none_or(|k| time_s > k.0 + 1e-6) {
                    knots.push((time_s, *pose));
                }
            }
        }
        let by = |time_s: f64| {
            let after = knots.partition_point(|k| k.0 <= time_s);
            let (Some(a), b) = (knots.get(after.saturating_sub(1)), knots.get(after)) else {
                return Pose::IDENTITY;
            };
            let Some(b) = b.filter(|_| after > 0) else { return pose_of(&a.1) };
            let part = (time_s - a.0) / (b.0 - a.0);
            pose_of(&std::array::from_fn(|i| a.1[i] + part * (b.1[i] - a.1[i])))
        };
        let times: Vec<f64> = knots.iter().map(|k| k.0).collect();
        path.adjusted(&times, by)
    }

    /// How the values of a picture change by a unit of each of the six numbers of its pose, DN, shape six times
    /// `[height, width, 3]`. `picture`: the values.
    pub(crate) fn pose_columns(&self, at: usize, picture: &Plane<f32>, theta: &Theta) -> Vec<Vec<f32>> {
        let (w, h) = (picture.width, picture.height);
        let mut out = vec![vec![0.0f32; w * h * 3]; 6];
        for i in 0..w * h {
            let (moves, slopes) = (moves_of(self, at, i, theta), slopes_of(picture, i % w, i / w));
            for (j, m) in moves.iter().enumerate() {
                let [u, v] = m.map(|m| (UNITS[j] * m) as f32);
                (0..3).for_each(|c| out[j][3 * i + c] = -(slopes[c][0] * u + slopes[c][1] * v));
            }
        }
        out
    }
}

/// How far a pixel's content moves for a radian and a meter of each of the six numbers of a pose, px.
pub(crate) fn moves_of(forward: &Forward, at: usize, i: usize, theta: &Theta) -> [[f64; 2]; 6] {
    let (k, depth) = (&forward.intrinsics, &forward.sharp[at].depth);
    let f = theta.get(P::Focal) * glam::DVec2::new(k.fx, k.fy);
    let (px, py) = (i % depth.width, i / depth.width);
    let (x, y) = ((px as f64 + 0.5 - k.cx) / f.x, (py as f64 + 0.5 - k.cy) / f.y);
    let z = 1.0 / f64::from(depth.data[i]).max(0.05);
    // What the content does, over the distance, when the camera turns and moves.
    let moves =
        [[0.0, 1.0, -y], [-1.0, 0.0, x], [y, -x, 0.0], [-z, 0.0, 0.0], [0.0, -z, 0.0], [0.0, 0.0, -z]];
    moves.map(|m| [f.x * (m[0] - x * m[2]), f.y * (m[1] - y * m[2])])
}

/// How a picture's values change along rows and columns, DN a px, by colour.
pub(crate) fn slopes_of(picture: &Plane<f32>, x: usize, y: usize) -> [[f32; 2]; 3] {
    let (w, h, d) = (picture.width, picture.height, &picture.data);
    let row = 3 * y * w;
    let (left, right) = (row + 3 * x.saturating_sub(1), row + 3 * (x + 1).min(w - 1));
    let (up, down) = (3 * (y.saturating_sub(1) * w + x), 3 * ((y + 1).min(h - 1) * w + x));
    std::array::from_fn(|c| [0.5 * (d[right + c] - d[left + c]), 0.5 * (d[down + c] - d[up + c])])
}

/// Takes what the pose of a frame could do out of the columns of a fit; returns what the pose then does.
pub(crate) fn eliminated(
    at: usize,
    own: &[Vec<f32>],
    weights: &[f32],
    residual: &[f32],
    columns: &mut [Vec<f32>],
) -> Option<PoseShare> {
    let product = |a: &[f32], b: &[f32]| -> f64 {
        weights.iter().zip(a).zip(b).map(|((&w, &a), &b)| f64::from(w * a * b)).sum()
    };
    let a: Vec<Vec<f64>> = own.iter().map(|i| own.iter().map(|j| product(i, j)).collect()).collect();
    let l = cholesky(&a, RIDGE)?;
    let solved = |d: &[f32]| -> [f64; 6] {
        let b: Vec<f64> = own.iter().map(|j| product(j, d)).collect();
        let x = back(&l, &b);
        std::array::from_fn(|i| x[i])
    };
    let step = solved(residual);
    let mut cross = Vec::new();
    for d in columns {
        let x = solved(d);
        for (j, x) in own.iter().zip(x) {
            d.iter_mut().zip(j).for_each(|(d, j)| *d -= x as f32 * j);
        }
        cross.push(x);
    }
    Some(PoseShare { at, step, cross })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_frame_does_not_show_of_its_pose_is_held_by_what_is_usual() {
        let off = |k: f64| [1e-3 * k, -2e-3 * k, 1.5e-3 * k, 4e-3 * k, -5e-3 * k, 3e-3 * k];
        let mut poses: Vec<[f64; 6]> = [1.0, -0.7, 0.5, -1.2, 0.9, 0.3].map(off).to_vec();
        let usual = Usual::of(poses.iter()).expect("they are off");
        assert!(poses.iter().all(|p| !usual.is_doubted(p)), "{usual:?}");
        poses.push([0.0, 0.0, 0.0, 0.3, 0.0, 0.0]);
        let with = Usual::of(poses.iter()).expect("they are off");
        assert!(with.is_doubted(&poses[6]) && !with.is_doubted(&poses[0]), "{with:?}");
        // A frame in which a turn and a step look alike but for a thousandth, and which shows their sum.
        let mut a = vec![vec![0.0; 6]; 6];
        let mut b = vec![0.0; 6];
        for (i, j) in [(1, 1), (1, 3), (3, 1), (3, 3)] {
            a[i][j] = 1e3;
        }
        (0..6).for_each(|i| a[i][i] += 1e-3);
        (b[1], b[3]) = (1e3, 1e3 - 0.1);
        let step =
            |a: &[Vec<f64>], b: &[f64]| crate::diagnose::expect::linear::solve(a, b, 1e-9).expect("solved");
        let astray = step(&a, &b);
        usual.hold(&mut a, &mut b, &[0.0; 6], 1.0);
        let held = step(&a, &b);
        assert!(astray[3].abs() > 20.0, "control: {astray:?}");
        assert!((held[1] + held[3] - 1.0).abs() < 0.01 && held[3].abs() < 1.0, "{held:?}");
    }

    #[test]
    fn what_a_pose_could_do_is_no_longer_in_the_columns() {
        let value =
            |i: usize, k: u32| shutterbug::chain::rng::random_uniform([i as u32, k], 0, 5, [1, 2])[0] - 0.5;
        let own: Vec<Vec<f32>> = (0..6).map(|k| (0..600).map(|i| value(i, k)).collect()).collect();
        let both: Vec<f32> = (0..600).map(|i| 2.0 * own[1][i] + value(i, 9)).collect();
        let mut columns = vec![both.clone()];
        let share = eliminated(0, &own, &[1.0; 600], &own[4], &mut columns).expect("solved");
        let product = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        for j in &own {
            assert!(product(&columns[0], j).abs() < 0.01 * product(j, j), "{}", product(&columns[0], j));
        }
        assert!(product(&both, &own[1]) > product(&own[1], &own[1]), "control: it was there");
        assert!((share.step[4] - 1.0).abs() < 1e-2 && share.step[0].abs() < 1e-2, "{share:?}");
        assert!((share.cross[0][1] - 2.0).abs() < 0.2, "{share:?}");
    }
}
