//! What a pose a frame leaves open where lines are read one after another: the path errs otherwise at the first line
//! than at the last. How fast it does is seen from frame to frame; what that makes of a frame is drawn, as whatever
//! else two correct simulations differ by.

use std::sync::Arc;

use rayon::prelude::*;

use super::poses::{moves_of, slopes_of};
use crate::diagnose::expect::discrepancy::DRAWS;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::Theta;
use shutterbug::chain::rng::{random_normal, seed_words};
use shutterbug::plane::Plane;

/// Stream of the walks ("WA").
const STREAM_WALK: u32 = 0x5741;

/// How far the camera is from its pose, by line; see `Room::poses`.
type Walk = Vec<[f64; 6]>;

/// Variance by which rotations (rad^2) and positions (m^2) change in a second, a axis, if they walk at random: from
/// what they do from each frame to the next.
fn rates(poses: &[[f64; 6]], starts_s: &[f64]) -> [f64; 2] {
    let mut order: Vec<usize> = (0..poses.len().min(starts_s.len())).collect();
    order.sort_by(|&a, &b| starts_s[a].total_cmp(&starts_s[b]));
    let (mut squares, mut time_s) = ([0.0; 2], 0.0);
    for pair in order.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        (0..6).for_each(|i| squares[i / 3] += (poses[b][i] - poses[a][i]).powi(2) / 3.0);
        time_s += starts_s[b] - starts_s[a];
    }
    squares.map(|s| if time_s > 0.0 { s / time_s } else { 0.0 })
}

/// A random walk over the lines of a frame, about its mean, which the frame's pose has.
fn walk(rates: [f64; 2], readout_s: f64, lines: usize, frame: usize, draw: usize) -> Walk {
    let step = rates.map(|r| (r * readout_s / lines.max(1) as f64).sqrt());
    let mut now = [0.0; 6];
    let mut out: Walk = (0..lines)
        .map(|line| {
            let normal = |half: u32| {
                random_normal([line as u32, 2 * draw as u32 + half], frame as u32, STREAM_WALK, seed_words(0))
            };
            let drawn = [normal(0), normal(1)];
            (0..6).for_each(|i| now[i] += step[i / 3] * f64::from(drawn[i / 3][i % 3]));
            now
        })
        .collect();
    let mean: [f64; 6] = std::array::from_fn(|i| out.iter().map(|p| p[i]).sum::<f64>() / lines.max(1) as f64);
    out.iter_mut().for_each(|p| (0..6).for_each(|i| p[i] -= mean[i]));
    out
}

impl Forward {
    /// By frame (place): differences, DN, between pictures from a path that errs within the frame as it does from frame
    /// to frame, and those from one pose a frame, one a draw. `pictures` are those. Nothing where poses are right or
    /// all lines are read at once.
    pub(crate) fn wandered(
        &self,
        frames: &[usize],
        theta: &Theta,
        pictures: &[Arc<Plane<f32>>],
    ) -> Vec<Vec<Arc<Plane<f32>>>> {
        let rates = rates(&theta.room.poses, &self.starts_s);
        let one = |(&at, picture): (&usize, &Arc<Plane<f32>>)| {
            let shutter = self.shutter(at, theta);
            if rates == [0.0; 2] || shutter.readout_time_s <= 0.0 {
                return Vec::new();
            }
            let lines = shutter.line_count as usize;
            let walks: Vec<Walk> =
                (0..DRAWS).map(|k| walk(rates, shutter.readout_time_s, lines, at, k)).collect();
            self.moved(at, picture, theta, &walks)
        };
        frames.par_iter().zip(pictures).map(one).collect()
    }

    /// What a picture changes by where each line has moved as its walk says.
    fn moved(&self, at: usize, picture: &Plane<f32>, theta: &Theta, walks: &[Walk]) -> Vec<Arc<Plane<f32>>> {
        let (w, h) = (picture.width, picture.height);
        let mut out = vec![Plane::new(w, h, 3); walks.len()];
        for i in 0..w * h {
            let (x, y) = (i % w, i / w);
            let line = theta.scan_order.line_of(x as u32, y as u32, w as u32, h as u32) as usize;
            let (moves, slopes) = (moves_of(self, at, i, theta), slopes_of(picture, x, y));
            for (to, walk) in out.iter_mut().zip(walks) {
                let by = |k: usize| (0..6).map(|j| moves[j][k] * walk[line][j]).sum::<f64>() as f32;
                let (u, v) = (by(0), by(1));
                (0..3).for_each(|c| to.data[3 * i + c] = -(slopes[c][0] * u + slopes[c][1] * v));
            }
        }
        out.into_iter().map(Arc::new).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_goes_as_far_over_a_readout_as_poses_do_from_frame_to_frame_in_that_time() {
        // Poses that jump by 1e-3 rad from frame to frame, 50 ms apart: 2e-5 rad^2 a second.
        let poses: Vec<[f64; 6]> = (0..200).map(|i| [1e-3 * f64::from(i % 2); 6]).collect();
        let starts_s: Vec<f64> = (0..200).map(|i| 0.05 * f64::from(i)).collect();
        let seen = rates(&poses, &starts_s);
        assert!(seen.iter().all(|r| (r / 2e-5 - 1.0).abs() < 1e-9), "{seen:?}");
        let span = |k: usize| {
            let walk = walk(seen, 0.025, 100, 3, k);
            (0..6).map(|i| (walk[99][i] - walk[0][i]).powi(2) / 6.0).sum::<f64>()
        };
        let mean = (0..400).map(span).sum::<f64>() / 400.0;
        assert!((mean / (2e-5 * 0.025) - 1.0).abs() < 0.1, "{mean}");
        assert_eq!(rates(&[[0.0; 6]; 5], &starts_s), [0.0; 2], "control: poses that are right do not wander");
    }
}
