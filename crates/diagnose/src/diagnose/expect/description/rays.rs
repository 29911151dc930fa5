//! Which surface each pixel sees: rays against the scene's triangles, each at the time of its own line.

use glam::{Vec3, Vec3A};

use shutterbug::scene::Scene;

/// Most triangles of a leaf.
const LEAF: usize = 4;

/// A triangle, and the surface that it belongs to.
#[derive(Clone, Copy)]
struct Triangle {
    corner: Vec3,
    edges: [Vec3; 2],
    /// Its number in the scene.
    number: u32,
    /// Object and material in one number.
    surface: u32,
}

/// A box around triangles: of two boxes (`count` 0; the first is the next in the list, `start` the second), or of a run
/// of triangles.
#[derive(Clone, Copy)]
struct Node {
    low: Vec3A,
    high: Vec3A,
    start: u32,
    count: u32,
    /// Along which two boxes lie side by side.
    axis: u8,
}

/// Object and material in one number.
fn surface_of(scene: &Scene, object: u32, material: u32) -> u32 {
    object * scene.materials.len() as u32 + material
}

/// The material of a surface.
pub(super) fn material_of(scene: &Scene, surface: u32) -> u32 {
    surface % scene.materials.len().max(1) as u32
}

/// Triangles that move together: what rests, or one object, in its own coordinates.
pub(crate) struct Body {
    /// The object whose pose is theirs; nothing for what rests.
    pub object: Option<usize>,
    triangles: Vec<Triangle>,
    nodes: Vec<Node>,
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// Along the ray, in lengths of its direction.
    pub t: f32,
    /// In the body's coordinates, m.
    pub at: Vec3,
    /// Normal, towards where the ray comes from; not of unit length.
    pub normal: Vec3,
    /// Object and material in one number.
    pub surface: u32,
    /// The triangle: its place in this body, and its number in the scene.
    pub triangle: [u32; 2],
    /// Its barycentric coordinates there.
    pub corners: [f32; 3],
}

impl Body {
    /// All bodies of a scene, what rests first.
    pub(crate) fn all(scene: &Scene) -> Vec<Self> {
        let moving = |o: usize| scene.objects.get(o).is_some_and(|o| o.trajectory.is_some());
        let own = (0..scene.objects.len()).filter(|&o| moving(o)).map(Some);
        std::iter::once(None).chain(own).map(|object| Self::of(scene, object, moving)).collect()
    }

    fn of(scene: &Scene, object: Option<usize>, moving: impl Fn(usize) -> bool) -> Self {
        let mut triangles = Vec::new();
        for (number, three) in scene.indices.chunks_exact(3).enumerate() {
            let v = [0, 1, 2].map(|i| scene.vertices[three[i] as usize]);
            let whose = v[0].object as usize;
            if object.map_or(moving(whose), |o| o != whose) {
                continue;
            }
            let [a, b, c] = v.map(|v| Vec3::from(v.position_m));
            let surface = surface_of(scene, v[0].object, v[0].material);
            triangles.push(Triangle { corner: a, edges: [b - a, c - a], number: number as u32, surface });
        }
        let mut body = Self { object, nodes: Vec::new(), triangles };
        if !body.triangles.is_empty() {
            body.split(0, body.triangles.len());
        }
        body
    }

    /// Puts the triangles of a run into boxes, halved by number along the longest side.
    fn split(&mut self, from: usize, to: usize) -> u32 {
        let (mut low, mut high) = (Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY));
        for t in &self.triangles[from..to] {
            for p in [t.corner, t.corner + t.edges[0], t.corner + t.edges[1]] {
                (low, high) = (low.min(p), high.max(p));
            }
        }
        let at = self.nodes.len();
        let (start, count) = (from as u32, (to - from) as u32);
        self.nodes.push(Node { low: low.into(), high: high.into(), start, count, axis: 0 });
        if to - from > LEAF {
            let size = high - low;
            let axis = if size.x >= size.y.max(size.z) {
                0
            } else if size.y >= size.z {
                1
            } else {
                2
            };
            let centre = |t: &Triangle| 3.0 * t.corner[axis] + t.edges[0][axis] + t.edges[1][axis];
            let middle = (from + to) / 2;
            self.triangles[from..to]
                .select_nth_unstable_by((to - from) / 2, |a, b| centre(a).total_cmp(&centre(b)));
            self.split(from, middle);
            let second = self.split(middle, to);
            (self.nodes[at].start, self.nodes[at].count, self.nodes[at].axis) = (second, 0, axis as u8);
        }
        at as u32
    }

    /// The first triangle that a ray meets before `most` lengths of its direction. `guess`: one that it may well meet.
    pub(crate) fn meet(&self, from: Vec3, along: Vec3, most: f32, guess: Option<u32>) -> Option<Hit> {
        let (origin, inverse) = (Vec3A::from(from), Vec3A::from(along.recip()));
        let (mut best, mut found): (f32, Option<(usize, [f32; 2])>) = (most, None);
        if let Some(i) = guess.map(|i| i as usize).filter(|&i| i < self.triangles.len())
            && let Some((t, at)) = self.triangles[i].meet(from, along)
            && t < best
        {
            (best, found) = (t, Some((i, at)));
        }
        let mut stack = [0u32; 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let at = stack[depth];
            let node = &self.nodes[at as usize];
            let (a, b) = ((node.low - origin) * inverse, (node.high - origin) * inverse);
            let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
            if enter > leave.min(best) {
                continue;
            }
            if node.count == 0 {
                let pair = (node.start, at + 1);
                // The nearer one on top.
                let back = along[usize::from(node.axis)] < 0.0;
                (stack[depth], stack[depth + 1]) = if back { (pair.1, pair.0) } else { pair };
                depth += 2;
                continue;
            }
            for i in node.start..node.start + node.count {
                if let Some((t, at)) = self.triangles[i as usize].meet(from, along)
                    && t < best
                {
                    (best, found) = (t, Some((i as usize, at)));
                }
            }
        }
        let (place, at) = found?;
        Some(self.hit(place, best, at, from, along))
    }

    /// Where a ray meets one triangle, whatever may lie before it.
    pub(crate) fn meet_one(&self, place: u32, from: Vec3, along: Vec3) -> Option<Hit> {
        let (t, at) = self.triangles[place as usize].meet(from, along)?;
        Some(self.hit(place as usize, t, at, from, along))
    }

    fn hit(&self, place: usize, t: f32, [u, v]: [f32; 2], from: Vec3, along: Vec3) -> Hit {
        let triangle = &self.triangles[place];
        let normal = triangle.edges[0].cross(triangle.edges[1]);
        let normal = if normal.dot(along) > 0.0 { -normal } else { normal };
        let corners = [1.0 - u - v, u, v];
        let number = [place as u32, triangle.number];
        Hit { t, at: from + t * along, normal, surface: triangle.surface, triangle: number, corners }
    }
}

impl Triangle {
    /// Where a ray meets it, in lengths of its direction, and between its corners (Möller and Trumbore 1997).
    fn meet(&self, from: Vec3, along: Vec3) -> Option<(f32, [f32; 2])> {
        let across = along.cross(self.edges[1]);
        let det = self.edges[0].dot(across);
        if det == 0.0 {
            return None;
        }
        let (inverse, to) = (1.0 / det, from - self.corner);
        let u = to.dot(across) * inverse;
        let up = to.cross(self.edges[0]);
        let v = along.dot(up) * inverse;
        let t = self.edges[1].dot(up) * inverse;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-4).then_some((t, [u, v]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::scene::SceneBuilder;

    fn random(i: u32) -> f32 {
        shutterbug::chain::rng::random_uniform([i, 7], 0, 3, [1, 2])[0] * 2.0 - 1.0
    }

    #[test]
    fn boxes_find_the_triangle_that_trying_all_finds() {
        let mut scene = SceneBuilder::new();
        for i in 0..60 {
            let p = |k: u32| [random(9 * i + k), random(9 * i + k + 1), 3.0 + random(9 * i + k + 2)];
            scene = scene.triangle([p(0), p(3), p(6)]);
        }
        let body = &Body::all(&scene.build())[0];
        let mut met = 0;
        for i in 0..500 {
            let along = Vec3::new(0.5 * random(7000 + 2 * i), 0.5 * random(7001 + 2 * i), 1.0);
            let all = body.triangles.iter().filter_map(|t| t.meet(Vec3::ZERO, along)).map(|h| h.0);
            let nearest = all.fold(f32::INFINITY, f32::min);
            for guess in [None, Some(i % 60)] {
                let found = body.meet(Vec3::ZERO, along, f32::INFINITY, guess).map_or(f32::INFINITY, |h| h.t);
                assert_eq!(found, nearest, "ray {i}");
            }
            met += u32::from(nearest.is_finite());
        }
        assert!((50..450).contains(&met), "control: {met} rays meet anything");
    }
}
