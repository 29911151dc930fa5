//! How far a picture has to reach beyond its borders, and how far its content moves: the paper's extended field of view
//! (Fig. 3), computed from the motion.
//!
//! Every triangle is clipped to what the camera sees at an instant; the corners of what remains are points of the
//! scene whose place in the picture at that instant and at the reference instant is known exactly.

use glam::{DMat4, DVec2, DVec3};
use rayon::prelude::*;

use crate::camera::{ExtendedLens, Intrinsics, NEAR_M, Trajectory};
use crate::engine::frame::FrameRequest;
use crate::engine::scene::{Stage, camera_path, check_coverage};
use crate::scene::Scene;

/// Px beyond the computed margin: bilinear reading and the chord's deviation from the path.
const MARGIN_GUARD_PX: f64 = 4.0;
/// Motion differences deviate from the true path under acceleration: so much more is rendered.
const MARGIN_FACTOR: f64 = 1.15;

/// Result of [`reach`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reach {
    /// How far beyond the left or right border, and the upper or lower one, content lies at the reference instant that
    /// is in view at one of the others, px. Zero where nothing leaves.
    pub beyond_px: [f64; 2],
    /// Largest distance between the two places of any visible point, px; infinite where one passes the camera.
    pub largest_px: f64,
}

impl Reach {
    fn merge(self, other: Self) -> Self {
        let [x, y] = self.beyond_px;
        Self {
            beyond_px: [x.max(other.beyond_px[0]), y.max(other.beyond_px[1])],
            largest_px: self.largest_px.max(other.largest_px),
        }
    }
}

/// Compares where visible points are at each of `times_s` with where they are at `reference_s`. All times lie inside
/// the trajectories.
pub fn reach(
    scene: &Scene,
    path: &Trajectory,
    intrinsics: &Intrinsics,
    reference_s: f64,
    times_s: &[f64],
) -> Reach {
    reach_through(scene, path, &Projection { intrinsics, lens: None }, reference_s, times_s)
}

/// The same for a stage, through its lens.
pub(crate) fn reach_of(stage: &Stage, path: &Trajectory, reference_s: f64, times_s: &[f64]) -> Reach {
    let lens = stage.lens.as_ref().map(|l| &l.extended);
    let projection = Projection { intrinsics: &stage.intrinsics, lens };
    reach_through(&stage.scene, path, &projection, reference_s, times_s)
}

fn reach_through(
    scene: &Scene,
    path: &Trajectory,
    projection: &Projection<'_>,
    reference_s: f64,
    times_s: &[f64],
) -> Reach {
    let one = |&time_s: &f64| reach_at(scene, path, projection, reference_s, time_s);
    times_s.par_iter().map(one).reduce(Reach::default, Reach::merge)
}

/// Where a camera point falls on the sensor.
struct Projection<'a> {
    intrinsics: &'a Intrinsics,
    lens: Option<&'a ExtendedLens>,
}

impl Projection<'_> {
    /// px; the point lies in front of the camera.
    fn of(&self, p: DVec3) -> DVec2 {
        match self.lens {
            Some(lens) => lens.project(p).expect("in front of the camera"),
            None => {
                let k = self.intrinsics;
                DVec2::new(k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy)
            }
        }
    }

    fn size(&self) -> DVec2 {
        DVec2::new(f64::from(self.intrinsics.width), f64::from(self.intrinsics.height))
    }

    fn beyond(&self, at: DVec2) -> DVec2 {
        (-at).max(at - self.size()).max(DVec2::ZERO)
    }
}

fn reach_at(scene: &Scene, path: &Trajectory, k: &Projection<'_>, reference_s: f64, time_s: f64) -> Reach {
    let camera_at = |t: f64| path.pose_at(t).inverse().matrix();
    let (now, then) = (camera_at(time_s), camera_at(reference_s));
    // Per object: camera at `time_s` from object, and camera at the reference from camera at `time_s`.
    let matrices: Vec<_> = scene
        .objects
        .iter()
        .map(|object| {
            let camera_from_object = now * object.world_from_object(time_s).matrix();
            let moved = then * object.world_from_object(reference_s).matrix() * camera_from_object.inverse();
            (camera_from_object, moved)
        })
        .collect();
    let frustum = Frustum::new(k);
    let mut reach = Reach::default();
    for corners in scene.indices.chunks_exact(3) {
        let vertex = |i: u32| &scene.vertices[i as usize];
        let (camera_from_object, moved) = &matrices[vertex(corners[0]).object as usize];
        let point = |i: u32| {
            let [x, y, z] = vertex(i).position_m.map(f64::from);
            camera_from_object.transform_point3(DVec3::new(x, y, z))
        };
        let triangle = [point(corners[0]), point(corners[1]), point(corners[2])];
        frustum.clip(&triangle, |seen| reach = reach.merge(reach_of_point(k, moved, seen)));
    }
    reach
}

/// Reach of one visible point, given in the camera's frame.
fn reach_of_point(k: &Projection<'_>, moved: &DMat4, seen: DVec3) -> Reach {
    let then = moved.transform_point3(seen);
    if then.z < NEAR_M {
        return Reach { beyond_px: k.size().to_array(), largest_px: f64::INFINITY };
    }
    let (at, now) = (k.of(then), k.of(seen));
    // Of what the lens shows, the frustum is only a bound: its corners may lie outside of the picture.
    let beyond = (k.beyond(at) - k.beyond(now)).max(DVec2::ZERO);
    Reach { beyond_px: beyond.to_array(), largest_px: (at - now).length() }
}

/// The margin that a frame's motion asks for around a picture of the instant `reference_s`, px; at most the picture's
/// own size.
pub(crate) fn needed_px(stage: &Stage, request: &FrameRequest, reference_s: f64) -> [u32; 2] {
    let shutter = &request.shutter;
    if shutter.end_s() <= shutter.start_s || check_coverage(stage, request).is_err() {
        return [0, 0];
    }
    let path = camera_path(stage, request);
    let quarter_s = 0.25 * (shutter.end_s() - shutter.start_s);
    let times: Vec<_> =
        (0..=4).map(|i| (shutter.start_s + quarter_s * f64::from(i)).min(shutter.end_s())).collect();
    let reach = reach_of(stage, &path, reference_s, &times);
    let size = [stage.intrinsics.width, stage.intrinsics.height];
    let needed = reach.beyond_px.map(|px| (px * MARGIN_FACTOR + MARGIN_GUARD_PX).ceil() as u32);
    [needed[0].min(size[0]), needed[1].min(size[1])]
}

/// Whether a margin is as wide as what is needed.
pub(crate) fn holds(have: [u32; 2], needed: [u32; 2]) -> bool {
    needed[0] <= have[0] && needed[1] <= have[1]
}

/// What holds both.
pub(crate) fn larger(a: [u32; 2], b: [u32; 2]) -> [u32; 2] {
    [a[0].max(b[0]), a[1].max(b[1])]
}

/// The visible pyramid in the camera's frame, as planes `dot(n, p) + d >= 0`.
struct Frustum([(DVec3, f64); 5]);

impl Frustum {
    fn new(projection: &Projection<'_>) -> Self {
        let k = projection.intrinsics;
        let (low, high) =
            projection.lens.map_or((DVec2::ZERO, projection.size()), |l| l.lens().ideal_bounds_px());
        // u = fx x/z + cx >= low is fx x + (cx - low) z >= 0, and so on.
        Self([
            (DVec3::Z, -NEAR_M),
            (DVec3::new(k.fx, 0.0, k.cx - low.x), 0.0),
            (DVec3::new(-k.fx, 0.0, high.x - k.cx), 0.0),
            (DVec3::new(0.0, k.fy, k.cy - low.y), 0.0),
            (DVec3::new(0.0, -k.fy, high.y - k.cy), 0.0),
        ])
    }

    /// Calls `f` for every corner of the visible part (Sutherland-Hodgman).
    fn clip(&self, triangle: &[DVec3; 3], mut f: impl FnMut(DVec3)) {
        let outside = |p: &DVec3| self.0.map(|(n, d)| n.dot(*p) + d < 0.0);
        let codes = triangle.each_ref().map(outside);
        if codes.iter().all(|c| !c.contains(&true)) {
            triangle.iter().for_each(|p| f(*p));
            return;
        }
        if (0..5).any(|plane| codes.iter().all(|c| c[plane])) {
            return;
        }
        let mut polygon = triangle.to_vec();
        for &(n, d) in &self.0 {
            let mut kept = Vec::with_capacity(polygon.len() + 1);
            for (i, &p) in polygon.iter().enumerate() {
                let next = polygon[(i + 1) % polygon.len()];
                let (a, b) = (n.dot(p) + d, n.dot(next) + d);
                if a >= 0.0 {
                    kept.push(p);
                }
                if (a >= 0.0) != (b >= 0.0) {
                    kept.push(p + (next - p) * (a / (a - b)));
                }
            }
            polygon = kept;
        }
        polygon.into_iter().for_each(f);
    }
}
