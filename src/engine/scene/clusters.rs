//! How far content moves, without asking every triangle of every frame.
//!
//! Neighbouring triangles of one object are boxed together once. For a pair of instants a box says in a few operations
//! whether it is in view and how far its content can move at most; only boxes that could raise what has been found are
//! opened, those that could raise it most first. The result is that of `reach.rs` to the bit.

use std::ops::Range;

use glam::{DMat3, DVec2, DVec3};

use super::reach::{Frustum, Move, Projection, Reach, moves, reach_of_triangle};
use crate::camera::{NEAR_M, Trajectory};
use crate::scene::{Object, Scene};

/// Triangles of a cluster, and clusters of a group. Small ones are flat, so that what is said of them is narrow.
const MOST: usize = 16;
/// What rounding may have taken from a bound: a share, and px.
const SLACK: f64 = 1e-9;

/// What is asked of [`Clusters::reach`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sought {
    /// Only how far content leads beyond the borders; the largest distance comes out too small.
    Beyond,
    All,
}

/// A box along the axes of an object.
#[derive(Clone, Copy)]
struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    const NONE: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    fn with(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Where a box inside this one lies along a Morton curve: places that are near on it are near in space.
    fn place_of(&self, inner: &Self) -> u64 {
        const STEPS: f64 = 1023.0;
        let size = (self.high - self.low).max(DVec3::splat(f64::MIN_POSITIVE));
        let at = ((0.5 * (inner.low + inner.high) - self.low) / size * STEPS).to_array().map(|v| v as u64);
        let bit = |b: u32| (0..3).map(move |axis| (at[axis] >> b & 1) << (3 * b + axis as u32));
        (0..10).flat_map(bit).sum()
    }
}

/// What is boxed together: a run of triangles, or of clusters.
struct Boxed {
    object: usize,
    bounds: Bounds,
    run: Range<usize>,
}

/// A scene's triangles by neighbourhood.
pub(crate) struct Clusters {
    /// Where triangles begin among the scene's indices; neighbours are near each other.
    triangles: Vec<u32>,
    groups: Vec<Boxed>,
    clusters: Vec<Boxed>,
}

impl Clusters {
    pub(crate) fn new(scene: &Scene) -> Self {
        let mut triangles: Vec<Boxed> =
            (0..scene.indices.len()).step_by(3).map(|first| triangle(scene, first)).collect();
        let mut wholes = vec![Bounds::NONE; scene.objects.len()];
        for t in &triangles {
            wholes[t.object] = wholes[t.object].with(t.bounds);
        }
        triangles.sort_by_cached_key(|t| (t.object, wholes[t.object].place_of(&t.bounds)));
        let order = triangles.iter().map(|t| t.run.start as u32).collect();
        let clusters = joined(&triangles);
        let groups = joined(&clusters);
        Self { triangles: order, groups, clusters }
    }

    /// What `reach` finds for these times; with [`Sought::Beyond`] only its `beyond_px`.
    pub(crate) fn reach(
        &self,
        scene: &Scene,
        path: &Trajectory,
        k: &Projection<'_>,
        (reference_s, times_s): (f64, &[f64]),
        sought: Sought,
    ) -> Reach {
        let mut best = Reach::default();
        for &time_s in times_s {
            let seen = Seen::new(&scene.objects, path, k, (reference_s, time_s));
            self.raise(scene, &seen, sought, &mut best);
        }
        best
    }

    /// Opens what could raise `best`. Returns how many clusters that were.
    fn raise(&self, scene: &Scene, seen: &Seen<'_>, sought: Sought, best: &mut Reach) -> usize {
        let could = |bound: &Reach, best: &Reach| {
            let beyond = (0..2).any(|i| bound.beyond_px[i] > best.beyond_px[i]);
            beyond || sought == Sought::All && bound.largest_px > best.largest_px
        };
        let mut waiting = Vec::new();
        for group in self.groups.iter().filter(|g| seen.bound(g).is_some_and(|b| could(&b, best))) {
            let clusters = self.clusters[group.run.clone()].iter();
            waiting.extend(clusters.filter_map(|c| Some((seen.bound(c)?, c))));
        }
        let most = |bound: &Reach| match sought {
            Sought::Beyond => bound.beyond_px[0].max(bound.beyond_px[1]),
            Sought::All => bound.largest_px,
        };
        waiting.sort_by(|a, b| most(&b.0).total_cmp(&most(&a.0)));
        let mut opened = 0;
        for (bound, cluster) in waiting {
            if could(&bound, best) {
                opened += 1;
                let triangles = &self.triangles[cluster.run.clone()];
                *best = best.merge(seen.open(scene, cluster.object, triangles));
            }
        }
        opened
    }
}

fn triangle(scene: &Scene, first: usize) -> Boxed {
    let corners = [0, 1, 2].map(|c| &scene.vertices[scene.indices[first + c] as usize]);
    let at = corners.map(|v| DVec3::from_array(v.position_m.map(f64::from)));
    let bounds = Bounds { low: at[0].min(at[1]).min(at[2]), high: at[0].max(at[1]).max(at[2]) };
    Boxed { object: corners[0].object as usize, bounds, run: first..first + 3 }
}

/// Runs of parts that belong to one object.
fn joined(parts: &[Boxed]) -> Vec<Boxed> {
    let mut all: Vec<Boxed> = Vec::new();
    for (i, part) in parts.iter().enumerate() {
        match all.last_mut().filter(|last| last.object == part.object && last.run.len() < MOST) {
            Some(last) => {
                last.bounds = last.bounds.with(part.bounds);
                last.run.end = i + 1;
            }
            None => all.push(Boxed { object: part.object, bounds: part.bounds, run: i..i + 1 }),
        }
    }
    all
}

/// A camera's view of the objects at two instants.
struct Seen<'a> {
    k: &'a Projection<'a>,
    frustum: Frustum,
    moves: Vec<Move>,
}

/// Where an affine function of a box lies.
struct Span {
    low: DVec3,
    high: DVec3,
}

impl Span {
    fn new(linear: DMat3, middle: DVec3, half: DVec3) -> Self {
        let reach = DVec3::from_array([0, 1, 2].map(|row| linear.row(row).abs().dot(half)));
        Self { low: middle - reach, high: middle + reach }
    }
}

impl<'a> Seen<'a> {
    fn new(
        objects: &[Object],
        path: &Trajectory,
        k: &'a Projection<'a>,
        (reference_s, time_s): (f64, f64),
    ) -> Self {
        Self { k, frustum: Frustum::new(k), moves: moves(objects, path, reference_s, time_s) }
    }

    fn open(&self, scene: &Scene, object: usize, triangles: &[u32]) -> Reach {
        let (motion, frustum) = (&self.moves[object], &self.frustum);
        let of = |&first: &u32| reach_of_triangle((scene, first as usize), motion, self.k, frustum);
        triangles.iter().map(of).fold(Reach::default(), Reach::merge)
    }

    /// What the reach of the content is at most; none where nothing of it is in view.
    fn bound(&self, boxed: &Boxed) -> Option<Reach> {
        let Move { seen, moved } = &self.moves[boxed.object];
        let (middle, half) =
            (0.5 * (boxed.bounds.low + boxed.bounds.high), 0.5 * (boxed.bounds.high - boxed.bounds.low));
        let linear = DMat3::from_mat4(*seen);
        let at = seen.transform_point3(middle);
        let inside =
            |&(n, d): &(DVec3, f64)| n.dot(at) + d + (linear.transpose() * n).abs().dot(half) >= -SLACK;
        if !self.frustum.planes().iter().all(inside) {
            return None;
        }
        const FAR: Reach = Reach { beyond_px: [f64::INFINITY; 2], largest_px: f64::INFINITY };
        let now = Span::new(linear, at, half);
        let later = DMat3::from_mat4(*moved) * linear;
        let then_at = moved.transform_point3(at);
        let then = Span::new(later, then_at, half);
        // Of a lens the frustum is only a bound, and what passes the camera has no place.
        if self.k.lens.is_some() || then.low.z < NEAR_M {
            return Some(FAR);
        }
        let change = Span::new(later - linear, then_at - at, half);
        Some(self.bound_of(&now, &then, &change))
    }

    /// The same from where the content is, where it is at the reference instant, and the difference of the two.
    fn bound_of(&self, now: &Span, then: &Span, change: &Span) -> Reach {
        let k = self.k.intrinsics;
        let (f, c) = (DVec2::new(k.fx, k.fy), DVec2::new(k.cx, k.cy));
        let nearest = now.low.z.max(NEAR_M);
        let mut bound = Reach::default();
        let mut squared = 0.0;
        for i in 0..2 {
            let size = f64::from([k.width, k.height][i]);
            // Ratios are largest and smallest at the nearest or the farthest depth.
            let least = f[i] * (then.low[i] / then.low.z).min(then.low[i] / then.high.z) + c[i];
            let most = f[i] * (then.high[i] / then.low.z).max(then.high[i] / then.high.z) + c[i];
            // x'/z' - x/z is (dx - dz x/z) / z', and what is in view has an x/z between the picture's borders.
            let slopes = [
                (now.low[i] / nearest).min(now.low[i] / now.high.z).max(-c[i] / f[i]),
                (now.high[i] / nearest).max(now.high[i] / now.high.z).min((size - c[i]) / f[i]),
            ];
            let terms = [change.low.z, change.high.z].map(|dz| slopes.map(|slope| dz * slope));
            let (low, high) = terms
                .as_flattened()
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &t| (l.min(t), h.max(t)));
            let farthest = (change.high[i] - low).abs().max((change.low[i] - high).abs());
            let moved_px = f[i] * farthest / then.low.z;
            squared += moved_px.powi(2);
            // What is in view leaves it by no more than it moves.
            let beyond = (-least).max(most - size).max(0.0).min(moved_px);
            bound.beyond_px[i] = beyond * (1.0 + SLACK) + SLACK;
        }
        bound.largest_px = squared.sqrt() * (1.0 + SLACK) + SLACK;
        bound
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use glam::DQuat;
    use proptest::prelude::*;

    use super::super::reach::reach;
    use super::*;
    use crate::camera::{Intrinsics, Pose};
    use crate::scene::Vertex;

    const K: Intrinsics = Intrinsics { width: 320, height: 240, fx: 250.0, fy: 240.0, cx: 150.0, cy: 130.0 };

    /// Patches of 8x8 triangles each, some of an object that moves, before the camera, beside it and behind it.
    fn scene(patches: &[[f32; 4]], moving: Arc<Trajectory>) -> Scene {
        let mut scene = Scene::default();
        for (i, &[x, y, z, side]) in patches.iter().enumerate() {
            let object = u32::from(i % 2 == 1);
            for (a, b) in (0..8).flat_map(|a| (0..8).map(move |b| (a, b))) {
                let corner = |da: f32, db: f32| {
                    let (u, v) = (side * (a as f32 + da), side * (b as f32 + db));
                    let position_m = [x + u, y + v, z + 0.3 * u];
                    Vertex { position_m, object, normal: [0.0, 0.0, -1.0], material: 0, uv: [0.0; 2] }
                };
                scene.indices.extend((0..3).map(|n| scene.vertices.len() as u32 + n));
                scene.vertices.extend([corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)]);
            }
        }
        let named = |name: &str, trajectory| Object { name: name.to_owned(), trajectory };
        scene.objects = vec![named("still", None), named("moving", Some(moving))];
        scene
    }

    fn path([x, y, z]: [f64; 3], [turn, tilt]: [f64; 2]) -> Trajectory {
        let turned = DQuat::from_rotation_y(turn) * DQuat::from_rotation_x(tilt);
        let pose = Pose { rotation: turned, translation_m: DVec3::new(x, y, z) };
        Trajectory::new(Path::new("drawn"), vec![0.0, 1.0], vec![Pose::IDENTITY, pose])
            .expect("times increase")
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]
        #[test]
        fn clusters_find_what_all_triangles_say(
            patches in prop::collection::vec(
                [-8.0_f32..8.0, -6.0_f32..6.0, -3.0_f32..20.0, 0.02_f32..0.5], 1..20),
            by in [-0.5..0.5, -0.5..0.5, -1.0..3.0_f64],
            turned in [-0.3..0.3, -0.3..0.3_f64],
            object in [-1.0..1.0, -1.0..1.0, -1.0..1.0_f64],
            still in any::<bool>(),
        ) {
            let camera = if still { path([0.0; 3], [0.0; 2]) } else { path(by, turned) };
            let scene = scene(&patches, Arc::new(path(object, [0.1, -0.2])));
            let (clusters, times) = (Clusters::new(&scene), [0.0, 0.3, 0.7, 1.0]);
            let k = Projection { intrinsics: &K, lens: None };
            let found = |sought| clusters.reach(&scene, &camera, &k, (0.4, &times), sought);
            let all = reach(&scene, &camera, &K, 0.4, &times);
            prop_assert_eq!(found(Sought::All), all);
            prop_assert_eq!(found(Sought::Beyond).beyond_px, all.beyond_px);
        }
    }

    /// A wall of patches before a camera that turns: nearly all of them need not be opened.
    #[test]
    fn few_clusters_are_opened() {
        let places = (0..1600).map(|i| [(i % 40) as f32 - 20.0, (i / 40) as f32 - 20.0, 15.0, 0.1]);
        let still = Arc::new(Trajectory::fixed(Pose::IDENTITY));
        let scene = scene(&places.collect::<Vec<_>>(), still);
        let clusters = Clusters::new(&scene);
        let (camera, k) = (path([0.0; 3], [0.02, 0.01]), Projection { intrinsics: &K, lens: None });
        let seen = Seen::new(&scene.objects, &camera, &k, (0.0, 1.0));
        for sought in [Sought::Beyond, Sought::All] {
            let mut best = Reach::default();
            let opened = clusters.raise(&scene, &seen, sought, &mut best);
            assert!(best.beyond_px[0] > 1.0 && best.beyond_px[1] > 1.0, "control: content leaves: {best:?}");
            let of = clusters.clusters.len();
            println!("{sought:?}: {opened} of {of} clusters opened");
            assert!(opened * 10 < of, "{sought:?}: {opened} of {of}");
        }
    }
}
