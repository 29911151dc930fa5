//! What a report says of the description, and the files that `simulate` takes it from.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::json;

use super::stamps::Late;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::room::SURFACES;
use crate::diagnose::report::{Parameter, PoseOff};
use crate::diagnose::search::Search;
use crate::diagnose::search::objects::Objects;
use shutterbug::camera::Trajectory;
use shutterbug::capture::Capture;
use shutterbug::error::{Error, Result};
use shutterbug::plane::{COLOR_CHANNELS, Plane, write_atomic, write_exr_plane};

/// What is written beside a report: the factor seen through the camera, by index of the frame, and the camera's path.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parts {
    pub factors: Vec<(usize, Plane<f32>)>,
    pub trajectory: Option<Arc<Trajectory>>,
    /// How far each pose is off.
    pub poses: Vec<PoseOff>,
    /// How late frames would be if their times and not their poses were off.
    pub late: Option<Late>,
    /// Frames (index) with what of them is compared: 0 where something is that the scene does not have.
    pub objects: Vec<(usize, Plane<f32>)>,
}

impl Parts {
    /// Keeps where the objects are in frames of the evidence.
    pub(crate) fn add(&mut self, objects: &Objects, evidence: &Evidence) {
        let frames = evidence.frames.iter().zip(&objects.masks);
        self.objects = frames.map(|(frame, mask)| (frame.index, mask.clone())).collect();
    }

    /// Writes the files of the description into a report's folder: `scene_radiance/NNNNNN.exr` and `trajectory.tum`.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub(crate) fn write(&self, folder: &Path, capture: &Capture) -> Result<()> {
        if let Some(path) = &self.trajectory {
            write_atomic(&folder.join("trajectory.tum"), path.to_tum(capture.epoch_ns).as_bytes())?;
        }
        if self.factors.is_empty() {
            return Ok(());
        }
        let maps = folder.join(SURFACES);
        fs::create_dir_all(&maps).map_err(|e| Error::io(&maps, "create the folder", e))?;
        for (index, factor) in &self.factors {
            let stem = Path::new(&capture.frames[*index].filename).with_extension("exr");
            write_exr_plane(&maps.join(stem), factor, &COLOR_CHANNELS)?;
        }
        Ok(())
    }
}

/// A mean square over draws as a root with its 95 % interval.
fn root(squares: &[f64], unit: &str) -> Parameter {
    let n = squares.len().max(2) as f64;
    let mean = squares.iter().sum::<f64>() / n;
    let variance = squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
    let value = mean.sqrt();
    // The root of a mean that is off by some.
    let half = 1.96 * variance.sqrt() / (2.0 * value.max(1e-12));
    let ci95 = json!([(value - half).max(0.0), value + half]);
    Parameter { value: json!(value), ci95: Some(ci95), unit: unit.to_owned() }
}

impl Search<'_> {
    /// The figures of a member of the set that is the description's.
    ///
    /// # Errors
    /// Those of the device.
    pub(crate) fn description_parameters(
        &mut self,
        name: &str,
        theta: &Theta,
    ) -> Result<BTreeMap<String, Parameter>> {
        let all: Vec<usize> = (0..self.evidence.frames.len()).collect();
        let theta = self.forward.settled(&all, theta)?.into_owned();
        if name == SURFACES {
            return self.radiance_parameters(&theta);
        }
        let poses = &theta.room.poses;
        let sum = |p: &[f64]| p.iter().map(|v| v * v).sum::<f64>();
        let rotation: Vec<f64> = poses.iter().map(|p| sum(&p[..3])).collect();
        let position: Vec<f64> = poses.iter().map(|p| sum(&p[3..])).collect();
        let px: Vec<f64> = all.iter().map(|&at| self.displacement2_px(at, &theta)).collect();
        Ok(BTreeMap::from([
            ("rotation_rms_rad".to_owned(), root(&rotation, "rad")),
            ("position_rms_m".to_owned(), root(&position, "m")),
            ("rms_px".to_owned(), root(&px, "px")),
        ]))
    }

    /// Mean square by which the pose of a frame moves its content, px^2.
    fn displacement2_px(&self, at: usize, theta: &Theta) -> f64 {
        let (k, pose) = (&self.forward.intrinsics, &theta.room.poses[at]);
        let depth = &self.forward.sharp[at].depth;
        let (mut sum, mut count) = (0.0, 0.0);
        for i in (0..depth.data.len()).step_by(29) {
            let (px, py) = (i % depth.width, i / depth.width);
            let (x, y) = ((px as f64 + 0.5 - k.cx) / k.fx, (py as f64 + 0.5 - k.cy) / k.fy);
            let z = 1.0 / f64::from(depth.data[i]).max(0.05);
            let [a, b, c, p, q, r] = *pose;
            let m = [y * c - b - p * z, a - x * c - q * z, x * b - y * a - r * z];
            sum += (k.fx * (m[0] - x * m[2])).powi(2) + (k.fy * (m[1] - y * m[2])).powi(2);
            count += 1.0;
        }
        sum / f64::max(count, 1.0)
    }

    fn radiance_parameters(&mut self, theta: &Theta) -> Result<BTreeMap<String, Parameter>> {
        let map = self.forward.map_of(theta, Quality::Fit)?;
        let mut squares = Vec::new();
        for &at in &self.evidence.report {
            let surface = self.forward.surface(at, theta);
            let grid = &self.forward.description.grid;
            let (mut sum, mut count) = (0.0f64, 0.0f64);
            for (_, log) in map.seen_in(grid, &surface) {
                sum += log.iter().map(|v| f64::from(v * v)).sum::<f64>() / 3.0;
                count += 1.0;
            }
            squares.push(sum / count.max(1.0));
        }
        let share = self.forward.covered_share();
        let seen = Parameter { value: json!(share), ci95: None, unit: String::new() };
        Ok(BTreeMap::from([("rms".to_owned(), root(&squares, "")), ("covered_share".to_owned(), seen)]))
    }

    /// What `simulate` needs of the description besides the camera.
    ///
    /// # Errors
    /// Those of the device.
    pub(crate) fn description_parts(&mut self, theta: &Theta) -> Result<Parts> {
        let mut parts = Parts::default();
        let all: Vec<usize> = (0..self.evidence.frames.len()).collect();
        let theta = self.forward.settled(&all, theta)?.into_owned();
        if theta.room.radiance {
            let map = self.forward.map_of(&theta, Quality::Fit)?;
            for at in all {
                let surface = self.forward.surface(at, &theta);
                let size = [self.forward.intrinsics.width as usize, self.forward.intrinsics.height as usize];
                let factor = map.factor(&self.forward.description.grid, &surface, size);
                parts.factors.push((self.evidence.frames[at].index, factor));
            }
        }
        if !theta.room.poses.is_empty() {
            // The offset of the set-up is a table of its own in camera.toml.
            let mut plain = theta.clone();
            [P::RotX, P::RotY, P::RotZ].into_iter().for_each(|p| plain.set(p, 0.0));
            parts.trajectory = Some(self.forward.path(&plain));
            let length = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
            parts.late = Late::of(self.forward, &theta);
            let late = parts.late.as_ref().map(|l| &l.late_s);
            let off = |(at, pose): (usize, &[f64; 6])| PoseOff {
                time_s: self.forward.starts_s[at],
                rotation_rad: length(&pose[..3]),
                position_m: length(&pose[3..]),
                late_s: late.map(|l| l[at]),
            };
            parts.poses = theta.room.poses.iter().enumerate().map(off).collect();
        }
        Ok(parts)
    }
}
