//! How far a picture's content moves, and how far beyond the borders that leads.
//!
//! Every triangle is clipped to what the camera sees at an instant; the corners of what remains are points of the
//! scene whose place in the picture at that instant and at the reference instant is known exactly. `clusters.rs` finds
//! the same and leaves out most of the triangles.

use glam::{DMat4, DVec2, DVec3, Vec3};

use crate::camera::{ExtendedLens, Intrinsics, NEAR_M, Trajectory};
use crate::scene::{Object, Scene};

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
    pub(crate) fn merge(self, other: Self) -> Self {
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
    let k = Projection { intrinsics, lens: None };
    let at = |&time_s: &f64| reach_at(scene, path, &k, reference_s, time_s);
    times_s.iter().map(at).fold(Reach::default(), Reach::merge)
}

/// Where a camera point falls on the sensor.
pub(crate) struct Projection<'a> {
    pub(crate) intrinsics: &'a Intrinsics,
    pub(crate) lens: Option<&'a ExtendedLens>,
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
    let moves = moves(&scene.objects, path, reference_s, time_s);
    let frustum = Frustum::new(k);
    let mut reach = Reach::default();
    for first in (0..scene.indices.len()).step_by(3) {
        let object = scene.vertices[scene.indices[first] as usize].object;
        reach = reach.merge(reach_of_triangle((scene, first), &moves[object as usize], k, &frustum));
    }
    reach
}

/// An object's motion as a camera sees it.
pub(crate) struct Move {
    /// Camera at the instant from object.
    pub(crate) seen: DMat4,
    /// Camera at the reference instant from camera at the instant, for what belongs to the object.
    pub(crate) moved: DMat4,
}

/// Of every object, between two instants.
pub(crate) fn moves(objects: &[Object], path: &Trajectory, reference_s: f64, time_s: f64) -> Vec<Move> {
    let camera_at = |t: f64| path.pose_at(t).inverse().matrix();
    let (now, then) = (camera_at(time_s), camera_at(reference_s));
    let of = |object: &Object| {
        let seen = now * object.world_from_object(time_s).matrix();
        Move { seen, moved: then * object.world_from_object(reference_s).matrix() * seen.inverse() }
    };
    objects.iter().map(of).collect()
}

/// Of what is visible of the triangle whose corners begin at this index.
pub(crate) fn reach_of_triangle(
    (scene, first): (&Scene, usize),
    motion: &Move,
    k: &Projection<'_>,
    frustum: &Frustum,
) -> Reach {
    let mut triangle = [DVec3::ZERO; 3];
    for (point, &i) in triangle.iter_mut().zip(&scene.indices[first..first + 3]) {
        let position_m = Vec3::from_array(scene.vertices[i as usize].position_m);
        *point = motion.seen.transform_point3(position_m.as_dvec3());
    }
    let mut reach = Reach::default();
    frustum.clip(&triangle, |seen| reach = reach.merge(reach_of_point(k, &motion.moved, seen)));
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

/// The visible pyramid in the camera's frame, as planes `dot(n, p) + d >= 0`.
pub(crate) struct Frustum([(DVec3, f64); 5]);

impl Frustum {
    pub(crate) fn new(projection: &Projection<'_>) -> Self {
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

    /// The planes.
    pub(crate) fn planes(&self) -> &[(DVec3, f64); 5] {
        &self.0
    }

    /// Calls `f` for every corner of the visible part (Sutherland-Hodgman).
    fn clip(&self, triangle: &[DVec3; 3], mut f: impl FnMut(DVec3)) {
        // A bit for each plane: corners beyond one, and all of them beyond it.
        let (mut any, mut all) = (0_u8, !0_u8);
        for p in triangle {
            let mut beyond = 0;
            for (plane, (n, d)) in self.0.iter().enumerate() {
                beyond |= u8::from(n.dot(*p) + d < 0.0) << plane;
            }
            any |= beyond;
            all &= beyond;
        }
        if any == 0 {
            triangle.iter().for_each(|p| f(*p));
            return;
        }
        if all != 0 {
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
