//! From loose triangles to the layout that the rasterizers read: corners shared, triangles in runs by texture.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::{Draw, Material, Object, Scene, Shading, Texture, Vertex};

/// Collects triangles and lays them out.
#[derive(Default)]
pub(super) struct Assembler {
    vertices: Vec<Vertex>,
    /// A vertex's bits to its place: two corners are one vertex only if every attribute is the same.
    places: HashMap<[u32; VERTEX_WORDS], u32>,
    indices: Vec<u32>,
}

const VERTEX_WORDS: usize = size_of::<Vertex>() / size_of::<u32>();

impl Assembler {
    /// Adds one triangle. All three corners carry the same material.
    ///
    /// # Panics
    /// With more than `u32::MAX` different vertices: callers limit their input far below that.
    pub(super) fn triangle(&mut self, corners: [Vertex; 3]) {
        for corner in corners {
            let place = match self.places.entry(key(&corner)) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(free) => {
                    let place =
                        u32::try_from(self.vertices.len()).expect("callers limit the number of corners");
                    self.vertices.push(corner);
                    *free.insert(place)
                }
            };
            self.indices.push(place);
        }
    }

    /// Number of indices so far, three a triangle.
    pub(super) fn index_count(&self) -> usize {
        self.indices.len()
    }

    /// The finished scene (unlit): triangles sorted by their material's texture, untextured first, then in the order of
    /// `textures`, matt before glossy; within a run in the order in which they were added. Runs without a triangle are
    /// left out.
    pub(super) fn finish(
        self,
        materials: Vec<Material>,
        textures: Vec<Texture>,
        objects: Vec<Object>,
    ) -> Scene {
        let run_of = |first: u32| {
            let material = &materials[self.vertices[first as usize].material as usize];
            2 * material.texture.map_or(0, |texture| texture + 1) + usize::from(material.is_glossy())
        };
        let mut runs: Vec<Vec<u32>> = vec![Vec::new(); 2 * (textures.len() + 1)];
        for triangle in self.indices.chunks_exact(3) {
            runs[run_of(triangle[0])].extend_from_slice(triangle);
        }
        let mut indices = Vec::with_capacity(self.indices.len());
        let mut draws = Vec::new();
        for (run, triangles) in runs.iter().enumerate().filter(|(_, triangles)| !triangles.is_empty()) {
            draws.push(Draw {
                first_index: indices.len() as u32,
                index_count: triangles.len() as u32,
                texture: (run / 2).checked_sub(1),
            });
            indices.extend_from_slice(triangles);
        }
        let vertices = self.vertices;
        Scene { vertices, indices, draws, materials, textures, objects, shading: Shading::Unlit }
    }
}

/// The vertex's bits, with minus zero taken as zero so that a flipped face shares its neighbour's corners.
fn key(vertex: &Vertex) -> [u32; VERTEX_WORDS] {
    const MINUS_ZERO: f32 = -0.0;
    let mut canonical = *vertex;
    let floats = canonical.position_m.iter_mut().chain(&mut canonical.normal).chain(&mut canonical.uv);
    for value in floats.filter(|v| v.to_bits() == MINUS_ZERO.to_bits()) {
        *value = 0.0;
    }
    bytemuck::cast(canonical)
}

/// Unit normal of the triangle, right-handed (counter-clockwise seen from where it points); `None` if it has no area.
pub(super) fn face_normal([a, b, c]: [[f32; 3]; 3]) -> Option<[f32; 3]> {
    // In f64 no f32 product overflows, and the difference of two f32 loses nothing that matters.
    let [a, b, c] = [a, b, c].map(|p| glam::DVec3::from_array(p.map(f64::from)));
    let normal = (b - a).cross(c - a).try_normalize()?;
    Some(normal.as_vec3().to_array())
}
