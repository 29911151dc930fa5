//! What the pixels of a frame see where there is no scene: the points that depth and poses of the simulated frames put
//! there. Which object or material a point belongs to is not known; the direction that it faces is.

use glam::{DVec2, Vec3};

use super::grid::{Grid, NONE, Surface};
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::Theta;
use crate::diagnose::expect::pair::{Outside, depth_at};
use shutterbug::camera::Pose;

/// Distances that differ by more from pixel to pixel, as a part of them, belong to two surfaces.
const SAME_SURFACE: f32 = 0.05;

impl Forward {
    /// Cells that the pixels of a frame see.
    pub(crate) fn surface_of_pictures(
        &self,
        outside: &Outside,
        grid: &mut Grid,
        at: usize,
        theta: &Theta,
    ) -> Surface {
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        let (first_s, last_s) = self.trajectory.span_s();
        let pose = |j: usize| self.trajectory.pose_at(outside.sim.times_s[j].clamp(first_s, last_s));
        let poses: Vec<Pose> = (0..outside.sim.frames.len()).map(pose).collect();
        let sights = self.sights(outside, at, theta);
        let point = |i: usize| -> Option<(Vec3, f32)> {
            let (j, s, known) = sights[i];
            let depth = outside.sim.frames[j].depth.as_ref()?;
            let z = depth_at(depth, s);
            if !known || !z.is_finite() {
                return None;
            }
            let ray = self.intrinsics.ray(DVec2::new(f64::from(s.x), f64::from(s.y)));
            Some((poses[j].transform(ray * f64::from(z)).as_vec3(), z))
        };
        let points: Vec<Option<(Vec3, f32)>> = (0..w * h).map(point).collect();
        let (mut cell, mut local) = (vec![NONE; w * h], vec![[0.0; 3]; w * h]);
        let mut clean = vec![false; w * h];
        for i in 0..w * h {
            let Some((here, z)) = points[i] else { continue };
            let (x, y) = (i % w, i / w);
            let beside = [
                (x > 0).then(|| i - 1),
                (x + 1 < w).then(|| i + 1),
                (y > 0).then(|| i - w),
                (y + 1 < h).then(|| i + w),
            ];
            let near = |k: usize| {
                let (there, other) = points[beside[k]?]?;
                ((other - z).abs() < SAME_SURFACE * z).then_some(there)
            };
            let all = [0, 1, 2, 3].map(near);
            let along =
                |a: usize| Some(all[a + 1].or(all[a].map(|_| here))? - all[a].or(all[a + 1].map(|_| here))?);
            let normal = match (along(0), along(2)) {
                (Some(u), Some(v)) => u.cross(v),
                _ => Vec3::ZERO,
            };
            let group = grid.group_of(0, normal);
            (cell[i], local[i]) = grid.place(group, here);
            clean[i] = all.iter().all(Option::is_some);
        }
        Surface { cell, local, clean, mixed: Vec::new() }
    }
}
