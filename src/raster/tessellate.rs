//! Cutting triangles until their edges are short enough, without gaps: an edge is halved or not by a rule that depends
//! on nothing but the edge, so both triangles that share it agree.

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use crate::plane::three;
use crate::scene::{Draw, Vertex};

/// Triangles in the device's order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Corners, each once.
    pub vertices: Vec<Vertex>,
    /// Three a triangle.
    pub indices: Vec<u32>,
    /// Runs of triangles by texture.
    pub draws: Vec<Draw>,
}

impl Mesh {
    /// The same triangles in the same order, with equal vertices joined: each is then projected once.
    pub fn joined(vertices: impl Fn(u32) -> Vertex, indices: &[u32], draws: &[Draw]) -> Self {
        let mut mesh = Self { draws: draws.to_vec(), ..Self::default() };
        let mut places: HashMap<Vec<u8>, u32> = HashMap::new();
        for &index in indices {
            let vertex = vertices(index);
            let key = bytemuck::bytes_of(&vertex).to_vec();
            let next = mesh.vertices.len() as u32;
            let place = *places.entry(key).or_insert(next);
            if place == next {
                mesh.vertices.push(vertex);
            }
            mesh.indices.push(place);
        }
        mesh
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.indices.len() / 3
    }

    /// Halves every edge for which `long` holds, again and again, until none is left; `None` where that takes more than
    /// `most` triangles. `long` must not depend on the order of its arguments.
    pub fn split(&self, long: impl Fn(&Vertex, &Vertex) -> bool + Sync, most: usize) -> Option<Self> {
        /// An edge of a kilometre in pieces of a millimetre.
        const MOST_LEVELS: u32 = 20;
        let mut mesh = self.clone();
        // Vertices keep their numbers, so what is known of an edge holds in later rounds.
        let mut short = HashSet::new();
        for _ in 0..MOST_LEVELS {
            let next = mesh.split_once(&long, &mut short);
            if next.triangle_count() == mesh.triangle_count() {
                return Some(next);
            }
            if next.triangle_count() > most {
                return None;
            }
            mesh = next;
        }
        Some(mesh)
    }

    fn split_once(
        &self,
        long: &(impl Fn(&Vertex, &Vertex) -> bool + Sync),
        short: &mut HashSet<(u32, u32)>,
    ) -> Self {
        let mut next = Self { vertices: self.vertices.clone(), indices: Vec::new(), draws: Vec::new() };
        let ends = self.indices.chunks_exact(3).flat_map(|t| three(|i| edge(t, i)));
        let mut asked: Vec<(u32, u32)> = ends.filter(|ends| !short.contains(ends)).collect();
        asked.sort_unstable();
        asked.dedup();
        let is_long = |&(a, b): &(u32, u32)| long(&self.vertices[a as usize], &self.vertices[b as usize]);
        let verdicts: Vec<bool> = asked.par_iter().map(is_long).collect();
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        for (&ends, is_long) in asked.iter().zip(verdicts) {
            if is_long {
                middles.insert(ends, next.vertices.len() as u32);
                next.vertices.push(halfway(&self.vertices[ends.0 as usize], &self.vertices[ends.1 as usize]));
            } else {
                short.insert(ends);
            }
        }
        for draw in &self.draws {
            let first = next.indices.len() as u32;
            let range = draw.first_index as usize..(draw.first_index + draw.index_count) as usize;
            for corners in self.indices[range].chunks_exact(3) {
                let middle = three(|i| middles.get(&edge(corners, i)).copied());
                push_pieces(&mut next.indices, [corners[0], corners[1], corners[2]], middle);
            }
            let index_count = next.indices.len() as u32 - first;
            next.draws.push(Draw { first_index: first, index_count, texture: draw.texture });
        }
        next
    }
}

/// Edge i of a triangle, the same for both triangles that share it.
fn edge(corners: &[u32], i: usize) -> (u32, u32) {
    let (a, b) = (corners[i], corners[(i + 1) % 3]);
    (a.min(b), a.max(b))
}

/// The pieces of one triangle whose edge i, from corner i to the next, has a middle or not.
fn push_pieces(indices: &mut Vec<u32>, corners: [u32; 3], middle: [Option<u32>; 3]) {
    let count = middle.iter().flatten().count();
    // Turned so that a single middle lies on edge 0, and a single edge without one is edge 2.
    let turn = match count {
        1 => middle.iter().position(Option::is_some),
        2 => middle.iter().position(Option::is_none).map(|i| (i + 1) % 3),
        _ => None,
    };
    let turn = turn.unwrap_or(0);
    let [a, b, c] = three(|i| corners[(i + turn) % 3]);
    match three(|i| middle[(i + turn) % 3]) {
        [Some(ab), Some(bc), Some(ca)] => {
            indices.extend([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca]);
        }
        [Some(ab), Some(bc), None] => indices.extend([ab, b, bc, a, ab, bc, a, bc, c]),
        [Some(ab), None, None] => indices.extend([a, ab, c, ab, b, c]),
        _ => indices.extend([a, b, c]),
    }
}

/// Symmetric in its arguments, to the bit.
fn halfway(a: &Vertex, b: &Vertex) -> Vertex {
    let mean3 = |a: [f32; 3], b: [f32; 3]| three(|i| 0.5 * (a[i] + b[i]));
    Vertex {
        position_m: mean3(a.position_m, b.position_m),
        object: a.object,
        normal: mean3(a.normal, b.normal),
        material: a.material,
        uv: [0, 1].map(|i| 0.5 * (a.uv[i] + b.uv[i])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vertex(x: f32, y: f32) -> Vertex {
        Vertex { position_m: [x, y, 0.0], object: 0, normal: [0.0, 0.0, 1.0], material: 0, uv: [x, y] }
    }

    fn length(a: &Vertex, b: &Vertex) -> f32 {
        (0..3).map(|i| (a.position_m[i] - b.position_m[i]).powi(2)).sum::<f32>().sqrt()
    }

    /// A fan of very different triangles in the unit square.
    fn fan() -> Mesh {
        let rim = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.07], [1.0, 1.0], [0.3, 1.0], [0.0, 1.0]];
        let corners: Vec<Vertex> = (0..rim.len())
            .flat_map(|i| [[0.31, 0.52], rim[i], rim[(i + 1) % rim.len()]])
            .map(|[x, y]| vertex(x, y))
            .collect();
        let indices: Vec<u32> = (0..corners.len() as u32).collect();
        let draws = [Draw { first_index: 0, index_count: indices.len() as u32, texture: None }];
        Mesh::joined(|i| corners[i as usize], &indices, &draws)
    }

    fn area(mesh: &Mesh) -> f64 {
        let at = |i: u32| mesh.vertices[i as usize].position_m.map(f64::from);
        let one = |t: &[u32]| {
            let [a, b, c] = [at(t[0]), at(t[1]), at(t[2])];
            0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
        };
        mesh.indices.chunks_exact(3).map(one).sum()
    }

    /// Edges that only one triangle has and that do not lie on the square's border: gaps.
    fn open_edges(mesh: &Mesh) -> usize {
        let mut count: HashMap<(u32, u32), u32> = HashMap::new();
        for t in mesh.indices.chunks_exact(3) {
            for i in 0..3 {
                let (a, b) = (t[i], t[(i + 1) % 3]);
                *count.entry((a.min(b), a.max(b))).or_default() += 1;
            }
        }
        let border = |&(a, b): &(u32, u32)| {
            let (a, b) = (mesh.vertices[a as usize].position_m, mesh.vertices[b as usize].position_m);
            (0..2).any(|axis| a[axis] == b[axis] && (a[axis] == 0.0 || a[axis] == 1.0))
        };
        count.iter().filter(|(edge, n)| **n != 2 && !border(edge)).count()
    }

    #[test]
    fn pieces_are_small_cover_the_same_and_leave_no_gap() {
        let fan = fan();
        assert_eq!(fan.vertices.len(), 7, "joined");
        let fine = fan.split(|a, b| length(a, b) > 0.11, 100_000).expect("few");
        assert!(fine.triangle_count() > 100, "{}", fine.triangle_count());
        for t in fine.indices.chunks_exact(3) {
            for i in 0..3 {
                let [a, b] = [t[i], t[(i + 1) % 3]].map(|i| &fine.vertices[i as usize]);
                assert!(length(a, b) <= 0.11);
                assert_eq!(a.uv[0], a.position_m[0], "attributes are interpolated too");
            }
        }
        assert!((area(&fine) - 1.0).abs() < 1e-5, "the pieces cover {}", area(&fine));
        assert_eq!(open_edges(&fine), 0);
        // Control: without a piece there is a gap.
        let mut torn = fine.clone();
        torn.indices.drain(60..63);
        assert!(open_edges(&torn) > 0 && area(&torn) < 1.0 - 1e-5);
    }

    #[test]
    fn too_many_pieces_are_refused_and_nothing_long_changes_nothing() {
        assert_eq!(fan().split(|a, b| length(a, b) > 1e-3, 1000), None);
        assert_eq!(fan().split(|_, _| false, 10), Some(fan()));
    }
}
