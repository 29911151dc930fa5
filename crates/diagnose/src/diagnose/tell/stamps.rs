//! Whether errors of poses are errors of time: frames whose stamps jitter lie on the path, earlier or later.

use crate::diagnose::expect::description::poses::moves_of;
use crate::diagnose::expect::discrepancy::EDGE_PX;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::Theta;
use shutterbug::camera::{Pose, Trajectory};
use shutterbug::plane::stats::median;

/// Times that are tried on each side of a stamp, over the usual time between frames.
const TRIED: usize = 200;
/// Of so many pixels one is looked at.
const SPARSE: usize = 29;

/// How late each frame would be if its time and not its pose were off.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Late {
    /// By place, s: the frame was taken so long after its stamp.
    pub late_s: Vec<f64>,
    /// How far the poses move the picture, px (rms; median over the frames).
    pub poses_px: f64,
    /// What of that times leave, px.
    pub left_px: f64,
}

/// Sums of products of what six numbers do to the picture, px^2 a pixel.
type Products = [[f64; 6]; 6];

fn square(m: &Products, v: &[f64; 6]) -> f64 {
    (0..6).flat_map(|i| (0..6).map(move |j| (i, j))).map(|(i, j)| v[i] * m[i][j] * v[j]).sum()
}

/// The six numbers of a small step from one pose to another, in the frame of the first.
fn step(from: &Pose, to: &Pose) -> [f64; 6] {
    let by = from.relative(to);
    let (r, t) = (by.rotation.to_scaled_axis(), by.translation_m);
    [r.x, r.y, r.z, t.x, t.y, t.z]
}

/// The time near `time_s` at which a path is nearest to where the pose `off` has the camera: how much later, s, and
/// what is left, px^2.
fn nearest(path: &Trajectory, time_s: f64, reach_s: f64, off: &[f64; 6], m: &Products) -> (f64, f64) {
    let here = path.pose_at(time_s);
    let left = |late_s: f64| {
        let along = step(&here, &path.pose_at(time_s + late_s));
        square(m, &std::array::from_fn(|i| off[i] - along[i]))
    };
    let at = |k: usize| reach_s * (k as f64 / TRIED as f64 - 1.0);
    let there = |late_s: &f64| path.covers(time_s + late_s, time_s + late_s);
    let tried = (0..=2 * TRIED).map(at).filter(there).map(|t| (t, left(t)));
    let best = tried.fold((0.0, left(0.0)), |best, new| if new.1 < best.1 { new } else { best });
    // The lowest point of the parabola through the best and its neighbours.
    let h = reach_s / TRIED as f64;
    if !(there(&(best.0 - h)) && there(&(best.0 + h))) {
        return best;
    }
    let (a, c) = (left(best.0 - h), left(best.0 + h));
    let bend = a - 2.0 * best.1 + c;
    let finer = best.0 + if bend > 0.0 { (0.5 * h * (a - c) / bend).clamp(-h, h) } else { 0.0 };
    let new = left(finer);
    if new < best.1 { (finer, new) } else { best }
}

impl Late {
    /// Of poses that are off, whose frames are settled; nothing where times would leave more of it than two correct
    /// simulations may differ by at edges.
    pub(crate) fn of(forward: &Forward, theta: &Theta) -> Option<Self> {
        let mut plain = theta.clone();
        plain.room.poses.clear();
        let path = forward.path(&plain);
        let poses = &theta.room.poses;
        let middle = |at: usize| {
            let s = forward.shutter(at, theta);
            s.start_s + 0.5 * (s.readout_time_s + s.exposure_time_s)
        };
        let times: Vec<f64> = (0..poses.len()).map(middle).collect();
        let products: Vec<Products> = (0..poses.len()).map(|at| products(forward, at, theta)).collect();
        Self::along(&path, &times, poses, &products).filter(|l| l.left_px < EDGE_PX && l.left_px < l.poses_px)
    }

    fn along(path: &Trajectory, times: &[f64], poses: &[[f64; 6]], products: &[Products]) -> Option<Self> {
        let mut sorted = times.to_vec();
        sorted.sort_by(f64::total_cmp);
        // A stamp that is off by more belongs to another frame.
        let reach_s = median(sorted.windows(2).map(|w| w[1] - w[0]));
        if poses.len() < 2 || !(reach_s > 0.0) || !times.iter().all(|&t| path.covers(t, t)) {
            return None;
        }
        let found: Vec<(f64, f64)> = times
            .iter()
            .zip(poses.iter().zip(products))
            .map(|(&time_s, (off, m))| nearest(path, time_s, reach_s, off, m))
            .collect();
        // A pose that went astray says nothing of time.
        let poses_px = median(poses.iter().zip(products).map(|(v, m)| square(m, v).sqrt()));
        let left_px = median(found.iter().map(|f| f.1.sqrt()));
        tracing::debug!(
            "poses are off by {poses_px:.3} px, {left_px:.3} of it aside of the path: {found:.4?}"
        );
        Some(Self { late_s: found.iter().map(|f| f.0).collect(), poses_px, left_px })
    }

    /// A sentence; `index` by place.
    pub(crate) fn said(&self, index: impl Fn(usize) -> usize) -> String {
        let n = self.late_s.len() as f64;
        let rms_s = (self.late_s.iter().map(|l| l * l).sum::<f64>() / n).sqrt();
        let most =
            (0..self.late_s.len()).max_by(|&a, &b| self.late_s[a].abs().total_cmp(&self.late_s[b].abs()));
        let most = most.map_or(String::new(), |at| {
            let late_s = self.late_s[at];
            let side = if late_s > 0.0 { "later" } else { "earlier" };
            format!(", frame {} taken {:.1} ms {side} than its stamp says", index(at), 1e3 * late_s.abs())
        });
        format!(
            "the poses err along the path: time stamps in frames.csv that are off by {:.1} ms (rms{most}) would move \
             the pictures in the same way, but for {:.2} of {:.2} px (median); description.poses has the times by \
             frame. Look at the clock of the camera before the tracker",
            1e3 * rms_s,
            self.left_px,
            self.poses_px
        )
    }
}

fn products(forward: &Forward, at: usize, theta: &Theta) -> Products {
    let count = forward.sharp[at].depth.data.len();
    let mut out = [[0.0; 6]; 6];
    let part = SPARSE as f64 / count as f64;
    for i in (0..count).step_by(SPARSE) {
        let moves = moves_of(forward, at, i, theta);
        for (row, a) in out.iter_mut().zip(&moves) {
            row.iter_mut().zip(&moves).for_each(|(o, b)| *o += part * (a[0] * b[0] + a[1] * b[1]));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};
    use shutterbug::chain::rng::random_normal;
    use std::path::Path;

    /// A camera that swings about, with a pose every 5 ms.
    fn path() -> Trajectory {
        let pose = |t: f64| Pose {
            rotation: DQuat::from_scaled_axis(DVec3::new(0.1 * (3.0 * t).sin(), 0.2 * (4.0 * t).cos(), 0.0)),
            translation_m: DVec3::new(0.3 * t, 0.05 * (5.0 * t).sin(), 0.0),
        };
        let times: Vec<f64> = (0..400).map(|i| 0.005 * f64::from(i)).collect();
        let poses = times.iter().map(|&t| pose(t)).collect();
        Trajectory::new(Path::new("t.tum"), times, poses).expect("a path")
    }

    /// A radian moves the picture by 300 px, a metre by 100.
    fn px() -> Products {
        let mut m = [[0.0; 6]; 6];
        (0..6).for_each(|i| m[i][i] = if i < 3 { 9e4 } else { 1e4 });
        m
    }

    #[test]
    fn stamps_that_jitter_are_found_from_the_errors_of_poses() {
        let path = path();
        let times: Vec<f64> = (0..20).map(|i| 0.2 + 0.05 * f64::from(i)).collect();
        let draw = |i: usize, k: u32| f64::from(random_normal([i as u32, k], 0, 3, [5, 1])[0]);
        let late: Vec<f64> = (0..20).map(|i| 0.012 * draw(i, 0)).collect();
        let off = |i: usize| step(&path.pose_at(times[i]), &path.pose_at(times[i] + late[i]));
        let jittered: Vec<[f64; 6]> = (0..20).map(off).collect();
        let found = Late::along(&path, &times, &jittered, &[px(); 20]).expect("a path");
        let worst = found.late_s.iter().zip(&late).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 2e-4 && found.left_px < EDGE_PX && found.poses_px > 1.0, "{worst} {found:?}");
        assert!(found.said(|at| at).contains("off by 1"), "{}", found.said(|at| at));
        // A tracker that errs as far in all directions.
        let tracker: Vec<[f64; 6]> =
            (0..20).map(|i| std::array::from_fn(|k| 0.006 * draw(i, 1 + k as u32))).collect();
        let other = Late::along(&path, &times, &tracker, &[px(); 20]).expect("a path");
        assert!(other.left_px > 10.0 * EDGE_PX, "control: {other:?}");
    }
}
