//! The order in which triangles are drawn: small objects first, what has most of the scene's surface last. Walls and
//! floors are then shaded only where nothing stands in front of them. Runs share a texture and whether they shine.

use crate::scene::{Draw, Scene};

/// An object with more than this share of the scene's surface is drawn after all others.
const LARGE_SHARE: f64 = 0.05;

/// Triangles in the order of drawing.
pub(super) struct Ordered {
    pub(super) indices: Vec<u32>,
    pub(super) draws: Vec<Draw>,
    /// By draw: whether a material of it has a specular colour.
    pub(super) glossy: Vec<bool>,
}

impl Ordered {
    pub(super) fn new(scene: &Scene) -> Self {
        let ranks = ranks(scene);
        let key = |corners: &[u32]| {
            let vertex = &scene.vertices[corners[0] as usize];
            let material = &scene.materials[vertex.material as usize];
            // Untextured before the first texture, as in the scene.
            let texture = material.texture.map_or(0, |t| t + 1);
            (ranks[vertex.object as usize], texture, material.ks != [0.0; 3])
        };
        let mut triangles: Vec<_> = scene.indices.chunks_exact(3).map(|c| (key(c), c)).collect();
        triangles.sort_by_key(|t| t.0);
        let mut ordered = Self { indices: Vec::new(), draws: Vec::new(), glossy: Vec::new() };
        for run in triangles.chunk_by(|a, b| a.0 == b.0) {
            let (_, texture, glossy) = run[0].0;
            ordered.draws.push(Draw {
                first_index: ordered.indices.len() as u32,
                index_count: 3 * run.len() as u32,
                texture: texture.checked_sub(1),
            });
            ordered.glossy.push(glossy);
            ordered.indices.extend(run.iter().flat_map(|(_, corners)| corners.iter()));
        }
        ordered
    }
}

/// By object: 0, or its place among the large ones, the largest last.
fn ranks(scene: &Scene) -> Vec<usize> {
    let mut areas = vec![0.0; scene.objects.len()];
    for corners in scene.indices.chunks_exact(3) {
        let at = |i: u32| glam::Vec3::from(scene.vertices[i as usize].position_m).as_dvec3();
        let [a, b, c] = [0, 1, 2].map(|i| at(corners[i]));
        areas[scene.vertices[corners[0] as usize].object as usize] += 0.5 * (b - a).cross(c - a).length();
    }
    let total: f64 = areas.iter().sum();
    let mut large: Vec<usize> = (0..areas.len()).filter(|&o| areas[o] > LARGE_SHARE * total).collect();
    large.sort_by(|a, b| areas[*a].total_cmp(&areas[*b]));
    let mut ranks = vec![0; areas.len()];
    large.into_iter().enumerate().for_each(|(place, object)| ranks[object] = place + 1);
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SceneBuilder;

    #[test]
    fn every_triangle_is_drawn_once_and_the_largest_object_last() {
        let scene = SceneBuilder::new()
            .cuboid([-9.0; 3], [9.0; 3])
            .object("crate")
            .cuboid([0.0; 3], [1.0; 3])
            .build();
        let ordered = Ordered::new(&scene);
        let triangles = |indices: &[u32]| {
            let mut all: Vec<Vec<u32>> = indices.chunks_exact(3).map(<[u32]>::to_vec).collect();
            all.sort();
            all
        };
        assert_eq!(triangles(&ordered.indices), triangles(&scene.indices));
        assert_eq!(ordered.draws.iter().map(|d| d.index_count as usize).sum::<usize>(), scene.indices.len());
        let object = |i: u32| scene.vertices[i as usize].object;
        let (first, last) = (ordered.indices[0], *ordered.indices.last().expect("triangles"));
        assert_ne!(object(first), object(last));
        // Control: in the scene's own order the room comes first.
        assert_eq!(object(scene.indices[0]), object(last));
    }
}
