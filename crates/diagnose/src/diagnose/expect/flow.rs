//! How the content of a picture moves when a parameter of the geometry changes: what derivatives are made of, without a
//! render.

use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::forward::Forward;
use super::model::{P, Theta};
use super::undistort::undistort;
use shutterbug::camera::Pose;
use shutterbug::plane::Plane;

/// Time over which a velocity is taken, s.
const STEP_S: f64 = 1e-3;

/// Displacement of the place that each pixel reads, px, per channel (one entry where channels agree).
pub(crate) struct Flow(pub Vec<Vec<[f32; 2]>>);

impl Forward {
    /// Velocity of the content at the time at which each pixel is exposed, px/s, shape `[height, width, 2]`.
    pub(crate) fn velocity(&self, at: usize, theta: &Theta) -> Plane<f32> {
        let sharp = &self.sharp[at];
        if self.static_camera || self.is_unposed() {
            return sharp.velocity.clone();
        }
        let shutter = self.shutter(at, theta);
        let time_s = |line: u32| shutter.line_middle_s(line);
        let mut velocity = self.camera_velocity(&sharp.depth, theta, time_s);
        if let Some(own) = &sharp.own {
            velocity.data.iter_mut().zip(&own.data).for_each(|(v, o)| *v += o);
        }
        velocity
    }

    /// How far the content moves while each pixel is exposed, px, by frame (place); nothing without an exposure.
    pub(crate) fn paths(&self, frames: &[usize], theta: &Theta) -> Vec<Plane<f32>> {
        if !theta.is_on(P::Exposure) {
            return Vec::new();
        }
        let path = |&at: &usize| {
            let exposure_s = self.shutter(at, theta).exposure_time_s as f32;
            let mut path = self.velocity(at, theta);
            path.data.iter_mut().for_each(|v| *v *= exposure_s);
            path
        };
        frames.iter().map(path).collect()
    }

    /// The part of the velocity that is the camera's; `time_s` gives the time of a line by its place in scan order.
    pub(crate) fn camera_velocity(
        &self,
        depth: &Plane<f32>,
        theta: &Theta,
        time_s: impl Fn(u32) -> f64,
    ) -> Plane<f32> {
        let k = &self.intrinsics;
        let (w, h) = (depth.width, depth.height);
        let order = theta.scan_order;
        let path = self.path(theta);
        let (first_s, last_s) = path.span_s();
        // The content in the camera's space a moment later, from that of now.
        let moves: Vec<Pose> = (0..order.line_count(k.width, k.height))
            .map(|line| {
                let t = time_s(line).clamp(first_s, (last_s - STEP_S).max(first_s));
                path.pose_at(t + STEP_S).inverse().then_from(&path.pose_at(t))
            })
            .collect();
        let f = theta.get(P::Focal) * DVec2::new(k.fx, k.fy);
        let centre = DVec2::new(k.cx, k.cy);
        let data: Vec<f32> = (0..w * h)
            .into_par_iter()
            .flat_map_iter(|i| {
                let (x, y) = (i % w, i / w);
                let z = f64::from(depth.data[i]);
                let line = order.line_of(x as u32, y as u32, k.width, k.height);
                let pose = &moves[line as usize];
                let at = (DVec2::new(x as f64 + 0.5, y as f64 + 0.5) - centre) / f;
                let ray = at.extend(1.0);
                let then = pose.rotation * ray
                    + if z.is_finite() { pose.translation_m / z.max(0.05) } else { DVec3::ZERO };
                let moved = f * (then.truncate() / then.z.max(0.05) - at) / STEP_S;
                [moved.x as f32, moved.y as f32]
            })
            .collect();
        Plane { width: w, height: h, channels: 2, data }
    }

    /// Where a point of the picture lies in the picture of the given camera at the given pose, px.
    pub(crate) fn source(&self, px: DVec2, theta: &Theta, channel: usize) -> DVec2 {
        let k = &self.intrinsics;
        let centre = DVec2::new(k.cx, k.cy);
        let scale = [theta.get(P::ScaleR), 1.0, theta.get(P::ScaleB)][channel];
        let ratio = theta.get(P::Focal);
        let distorted = (px - centre) / scale / (ratio * DVec2::new(k.fx, k.fy));
        let undistorted = undistort(distorted, theta);
        let turn = DVec3::new(theta.get(P::RotX), theta.get(P::RotY), theta.get(P::RotZ));
        let ray = DQuat::from_scaled_axis(turn) * undistorted.extend(1.0);
        centre + DVec2::new(k.fx, k.fy) * ray.truncate() / ray.z.max(0.05)
    }

    /// Where a point of the picture lies without the lens, px, for the focal length of `theta`.
    pub(crate) fn without_lens(&self, px: DVec2, theta: &Theta) -> DVec2 {
        let k = &self.intrinsics;
        let centre = DVec2::new(k.cx, k.cy);
        let f = theta.get(P::Focal) * DVec2::new(k.fx, k.fy);
        centre + f * undistort((px - centre) / f, theta)
    }

    /// The displacement that a step of a parameter of the set-up or the lens makes.
    pub(crate) fn flow_of_remap(&self, theta: &Theta, p: P, step: f64) -> Flow {
        let k = &self.intrinsics;
        let (w, h) = (k.width as usize, k.height as usize);
        let moved = theta.with(p, theta.get(p) + step);
        let of = |channel: usize| -> Vec<[f32; 2]> {
            (0..w * h)
                .into_par_iter()
                .map(|i| {
                    let px = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
                    let (now, then) = (self.source(px, theta, channel), self.source(px, &moved, channel));
                    (then - now).as_vec2().to_array()
                })
                .collect()
        };
        let none = || vec![[0.0; 2]; w * h];
        Flow(match p {
            P::ScaleR => vec![of(0), none(), none()],
            P::ScaleB => vec![none(), none(), of(2)],
            _ => vec![of(1)],
        })
    }

    /// The displacement that a step of an offset or a readout makes in a frame whose content moves with `velocity`.
    pub(crate) fn flow_of_time(&self, theta: &Theta, velocity: &Plane<f32>, p: P, step: f64) -> Flow {
        let k = &self.intrinsics;
        let order = theta.scan_order;
        let count = f64::from(order.line_count(k.width, k.height));
        let w = velocity.width;
        let flow = velocity.data.chunks_exact(2).enumerate().map(|(i, v)| {
            let part = if p == P::Readout {
                let line = order.line_of((i % w) as u32, (i / w) as u32, k.width, k.height);
                f64::from(line) / count
            } else {
                1.0
            };
            let late_s = (step * part) as f32;
            [-v[0] * late_s, -v[1] * late_s]
        });
        Flow(vec![flow.collect()])
    }
}

/// The picture with its content displaced, to first order.
pub(crate) fn displaced(radiance: &Plane<f32>, flow: &Flow) -> Plane<f32> {
    let (w, h) = (radiance.width, radiance.height);
    let mut out = radiance.clone();
    for y in 0..h {
        let (above, below) = (radiance.row(y.saturating_sub(1)), radiance.row((y + 1).min(h - 1)));
        let row = radiance.row(y);
        for x in 0..w {
            let (left, right) = (3 * x.saturating_sub(1), 3 * (x + 1).min(w - 1));
            for c in 0..3 {
                let [dx, dy] = flow.0[c.min(flow.0.len() - 1)][y * w + x];
                out.data[3 * (y * w + x) + c] += 0.5
                    * ((row[right + c] - row[left + c]) * dx + (below[3 * x + c] - above[3 * x + c]) * dy);
            }
        }
    }
    out
}
