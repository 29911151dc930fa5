//! What the placing of vertices in `--method exact` needs: the matrices of everything that moves alike, at equally
//! spaced times ("knots") between which they may be taken for linear.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec2, DVec4};

use crate::camera::{Intrinsics, NEAR_M, Pose, Trajectory};
use crate::scene::Scene;

/// Nine texels of `knots` in `exact_place.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct KnotRow {
    clip_from_object: [f32; 16],
    centred_from_object: [f32; 16],
    eye_m: [f32; 4],
}

/// Objects by what they move with: all that rest are one group.
#[derive(Clone, Debug)]
pub struct MotionGroups {
    of_object: Vec<u32>,
    trajectories: Vec<Option<Arc<Trajectory>>>,
}

impl MotionGroups {
    /// The groups of a scene; the first one rests.
    pub fn new(scene: &Scene) -> Self {
        let mut groups = Self { of_object: Vec::new(), trajectories: vec![None] };
        for object in &scene.objects {
            let same = |t: &Option<Arc<Trajectory>>| match (t, &object.trajectory) {
                (None, None) => true,
                (Some(a), Some(b)) => Arc::ptr_eq(a, b),
                _ => false,
            };
            let found = groups.trajectories.iter().position(same);
            groups.of_object.push(found.unwrap_or(groups.trajectories.len()) as u32);
            if found.is_none() {
                groups.trajectories.push(object.trajectory.clone());
            }
        }
        groups
    }

    /// Number of groups.
    pub fn count(&self) -> usize {
        self.trajectories.len()
    }

    /// Group of an object.
    pub fn of_object(&self, object: u32) -> u32 {
        self.of_object[object as usize]
    }

    /// Whether the group has a pose at that time.
    pub fn covers(&self, group: usize, time_s: f64) -> bool {
        self.trajectories[group].as_ref().is_none_or(|t| t.covers(time_s, time_s))
    }

    /// World from object of a group.
    pub fn world_from_object(&self, group: usize, time_s: f64) -> Pose {
        self.trajectories[group].as_ref().map_or(Pose::IDENTITY, |t| t.pose_at(time_s))
    }

    fn clip_from_object(&self, view: &View<'_>, group: usize, time_s: f64) -> DMat4 {
        let camera_from_world = view.path.pose_at(time_s).inverse();
        view.camera.clip_from_camera()
            * camera_from_world.then_from(&self.world_from_object(group, time_s)).matrix()
    }

    /// Rows of every group, group by group, and the camera that the centred matrices are relative to (that of the
    /// first time), m. All times lie inside the trajectories.
    pub fn knot_rows(&self, view: &View<'_>, times_s: &[f64]) -> (Vec<KnotRow>, [f32; 4]) {
        let origin_m = view.path.pose_at(times_s[0]).translation_m;
        let mut rows = Vec::with_capacity(self.count() * times_s.len());
        for group in 0..self.count() {
            for &time_s in times_s {
                let world = self.world_from_object(group, time_s).matrix();
                let eye_m = view.path.pose_at(time_s).translation_m - origin_m;
                rows.push(KnotRow {
                    clip_from_object: single(self.clip_from_object(view, group, time_s)),
                    centred_from_object: single(DMat4::from_translation(-origin_m) * world),
                    eye_m: eye_m.extend(0.0).as_vec4().to_array(),
                });
            }
        }
        (rows, origin_m.extend(0.0).as_vec4().to_array())
    }

    /// Equally spaced times over a span, so many that matrices linear between them are off by at most `error_px` in the
    /// picture, for what is farther than half a metre; at most `most`, at least 2 unless the span is empty.
    pub fn knot_times_s(&self, view: &View<'_>, span_s: (f64, f64), error_px: f64, most: usize) -> Vec<f64> {
        let (from_s, to_s) = span_s;
        if to_s <= from_s {
            return vec![from_s];
        }
        let mut segments = 4;
        loop {
            let times = spaced(from_s, to_s, segments);
            let worst =
                times.windows(2).map(|pair| self.chord_px(view, pair[0], pair[1])).fold(0.0, f64::max);
            if worst <= error_px || 2 * segments + 1 > most {
                return times;
            }
            segments *= 2;
        }
    }

    /// How far the mean of the matrices at two times projects from the matrix half way, px: the worst of nine places in
    /// the picture and two distances.
    fn chord_px(&self, view: &View<'_>, a_s: f64, b_s: f64) -> f64 {
        /// Nearer than this, errors are let grow: what passes the lens this close is a blur.
        const NEAREST_M: f64 = 0.5;
        let half = 0.5 * DVec2::new(f64::from(view.camera.width), f64::from(view.camera.height));
        let mut worst = 0.0_f64;
        for group in 0..self.count() {
            if group > 0 && self.trajectories[group].is_none() {
                continue;
            }
            let [a, b, middle] = [a_s, b_s, 0.5 * (a_s + b_s)].map(|t| self.clip_from_object(view, group, t));
            let mean = (a + b) * 0.5 * middle.inverse();
            for (x, y) in (0..9).map(|i| (f64::from(i % 3 - 1), f64::from(i / 3 - 1))) {
                for depth in [0.0, NEAR_M / NEAREST_M] {
                    let seen = mean * DVec4::new(x, y, depth, 1.0);
                    let off = (DVec2::new(seen.x, seen.y) / seen.w - DVec2::new(x, y)) * half;
                    worst = worst.max(off.length());
                }
            }
        }
        worst
    }
}

/// Whose picture it is.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The camera, margin included.
    pub camera: &'a Intrinsics,
    /// Its poses.
    pub path: &'a Trajectory,
}

/// Six texels of `relatives` in `exact_paths.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct RelativeRow {
    begin: [[f32; 4]; 3],
    end: [[f32; 4]; 3],
}

/// Where the points of a line's picture, taken at the middle of its exposure, are at its begin and end (of the parabola
/// that is nearest to their way): matrices from `(ndc x, ndc y, depth, 1)` with the rasterizer's depth to clip space.
/// What rests in the world moves with the camera alone; what moves by itself, with both. `exposures_s` holds begin,
/// middle and end of equally spaced lines in scan order; the rows are those of `line_count` lines, linear in between,
/// in the picture's order (the reverse of the scan's if `reversed`), and within a line group by group.
pub fn relative_rows(
    groups: &MotionGroups,
    view: &View<'_>,
    exposures_s: &[[f64; 3]],
    (line_count, reversed): (usize, bool),
) -> Vec<RelativeRow> {
    let mut rows = vec![RelativeRow::default(); groups.count() * line_count];
    for group in 0..groups.count() {
        let known = exposures_s.iter().map(|exposure_s| fitted(groups, view, group, exposure_s));
        let known: Vec<[DMat4; 2]> = known.collect();
        for line in 0..line_count {
            let at = line as f64 / (line_count.max(2) - 1) as f64 * (known.len() - 1) as f64;
            let before = (at as usize).min(known.len().max(2) - 2);
            let after = (before + 1).min(known.len() - 1);
            let weight = at - before as f64;
            let [begin, end] = [0, 1].map(|i| known[before][i] * (1.0 - weight) + known[after][i] * weight);
            let picture_line = if reversed { line_count - 1 - line } else { line };
            rows[picture_line * groups.count() + group] = RelativeRow { begin: xyw(begin), end: xyw(end) };
        }
    }
    rows
}

/// Matrices from clip space at the middle of an exposure to that at its begin and end, such that the parabola through
/// them is nearest to the way over all of the exposure: a camera that shakes within it is not where it was at the ends.
fn fitted(
    groups: &MotionGroups,
    view: &View<'_>,
    group: usize,
    &[begin_s, middle_s, end_s]: &[f64; 3],
) -> [DMat4; 2] {
    /// Instants that are looked at.
    const COUNT: usize = 10;
    let from_clip = groups.clip_from_object(view, group, middle_s).inverse();
    let (mut linear, mut square) = (DMat4::ZERO, DMat4::ZERO);
    let (mut taus2, mut taus4) = (0.0, 0.0);
    for i in 0..COUNT {
        let tau = (i as f64 + 0.5) / COUNT as f64 - 0.5;
        let half_s = if tau < 0.0 { middle_s - begin_s } else { end_s - middle_s };
        let moved = groups.clip_from_object(view, group, middle_s + 2.0 * tau * half_s) * from_clip;
        // Nothing has moved at the middle, so no constant is fitted.
        let way = moved - DMat4::IDENTITY;
        (linear, square) = (linear + way * tau, square + way * (tau * tau));
        (taus2, taus4) = (taus2 + tau * tau, taus4 + tau.powi(4));
    }
    let (linear, square) = (linear * (0.5 / taus2), square * (0.25 / taus4));
    [DMat4::IDENTITY + square - linear, DMat4::IDENTITY + square + linear]
}

/// Rows x, y and w of the matrices that take a point of the picture at `from_s`, `(ndc x, ndc y, depth, 1)`, to clip
/// space at each of `to_s`: where what rests in the world is then.
pub fn moved_rows(view: &View<'_>, from_s: f64, to_s: &[f64]) -> Vec<[[f32; 4]; 3]> {
    let now = view.path.pose_at(from_s);
    let mut rows = Vec::with_capacity(to_s.len());
    rows.extend(to_s.iter().map(|&time_s| moved_row(view.camera, &view.path.pose_at(time_s).relative(&now))));
    rows
}

/// The same of one transform from the camera's frame at the picture's instant to that at another one.
pub fn moved_row(camera: &Intrinsics, then_from_now: &Pose) -> [[f32; 4]; 3] {
    let clip = camera.clip_from_camera();
    xyw(clip * then_from_now.matrix() * clip.inverse())
}

fn xyw(matrix: DMat4) -> [[f32; 4]; 3] {
    [0, 1, 3].map(|i| matrix.row(i).as_vec4().to_array())
}

/// `segments + 1` times, the last one exact.
pub fn spaced(from_s: f64, to_s: f64, segments: usize) -> Vec<f64> {
    let step_s = (to_s - from_s) / segments as f64;
    (0..=segments).map(|i| if i == segments { to_s } else { from_s + step_s * i as f64 }).collect()
}

fn single(matrix: DMat4) -> [f32; 16] {
    matrix.as_mat4().to_cols_array()
}
