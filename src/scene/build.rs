//! Scenes made in code: for tests, examples and programs that have their geometry already.

use std::sync::Arc;

use super::assemble::{Assembler, face_normal};
use super::{Material, Object, PointLight, Scene, Shading, Texture, Vertex};
use crate::camera::Trajectory;

/// Builds a [`Scene`] call by call: geometry belongs to the object and the material that were named last.
///
/// Positions are metres, in object coordinates where the object has a trajectory, else in world coordinates. Colours
/// are linear. Normals are those of the faces (right-handed: counter-clockwise seen from outside). Geometry before any
/// [`object`](Self::object) belongs to a resting object named `""`, before any material to a white one.
///
/// ```
/// use shutterbug::scene::SceneBuilder;
/// let scene = SceneBuilder::new()
///     .object("bar", None)
///     .material([0.8, 0.2, 0.1])
///     .quad([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 2.0, 1.0], [0.0, 2.0, 1.0]])
///     .build();
/// assert_eq!((scene.triangle_count(), scene.vertices.len()), (2, 4));
/// ```
#[derive(Default)]
pub struct SceneBuilder {
    triangles: Assembler,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    objects: Vec<Object>,
    shading: Shading,
}

impl SceneBuilder {
    /// An empty scene, unlit.
    pub fn new() -> Self {
        Self::default()
    }

    /// Starts an object; `trajectory` is its pose over time, object to world (`None`: it rests and its vertices are
    /// world coordinates).
    pub fn object(mut self, name: &str, trajectory: Option<Trajectory>) -> Self {
        self.objects.push(Object { name: name.to_owned(), trajectory: trajectory.map(Arc::new) });
        self
    }

    /// Starts a matt, untextured material of linear diffuse colour `kd`.
    pub fn material(self, kd: [f32; 3]) -> Self {
        self.material_like(Material { kd, ..Material::default() })
    }

    /// Starts any material; an empty name becomes `material<index>`.
    ///
    /// # Panics
    /// If it refers to a texture that [`texture`](Self::texture) has not added yet.
    pub fn material_like(mut self, mut material: Material) -> Self {
        let known = self.textures.len();
        assert!(material.texture.is_none_or(|t| t < known), "texture {:?} of {known}", material.texture);
        if material.name.is_empty() {
            material.name = format!("material{}", self.materials.len());
        }
        self.materials.push(material);
        self
    }

    /// Adds a texture and starts a material that shows it (`kd` times texture).
    ///
    /// # Panics
    /// If `rgba` does not hold `width * height * 4` bytes, or none.
    pub fn texture(mut self, kd: [f32; 3], texture: Texture) -> Self {
        let expected = texture.width as usize * texture.height as usize * 4;
        assert!(expected > 0 && texture.rgba.len() == expected, "{} bytes of {expected}", texture.rgba.len());
        self.textures.push(texture);
        let texture = Some(self.textures.len() - 1);
        self.material_like(Material { kd, texture, ..Material::default() })
    }

    /// Adds a triangle, texture coordinates 0. One without area gets the normal +z.
    pub fn triangle(self, points_m: [[f32; 3]; 3]) -> Self {
        self.triangle_uv(points_m, [[0.0; 2]; 3])
    }

    /// Adds a triangle with texture coordinates (v up).
    pub fn triangle_uv(mut self, points_m: [[f32; 3]; 3], uv: [[f32; 2]; 3]) -> Self {
        let normal = face_normal(points_m).unwrap_or([0.0, 0.0, 1.0]);
        let (object, material) = self.current();
        let corner = |i: usize| Vertex { position_m: points_m[i], object, normal, material, uv: uv[i] };
        self.triangles.triangle([corner(0), corner(1), corner(2)]);
        self
    }

    /// Adds a plane quad, corners in order around it; it shows the whole texture, its lower left corner at the first
    /// point and its lower right at the second.
    pub fn quad(self, points_m: [[f32; 3]; 4]) -> Self {
        self.quad_uv(points_m, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    }

    /// Adds a plane quad with texture coordinates (v up).
    pub fn quad_uv(self, p: [[f32; 3]; 4], uv: [[f32; 2]; 4]) -> Self {
        self.triangle_uv([p[0], p[1], p[2]], [uv[0], uv[1], uv[2]])
            .triangle_uv([p[0], p[2], p[3]], [uv[0], uv[2], uv[3]])
    }

    /// Adds the six outward faces of an axis-aligned box from `min_m` to `max_m`; each shows the whole texture.
    pub fn cuboid(mut self, min_m: [f32; 3], max_m: [f32; 3]) -> Self {
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |level: f32, at_u: f32, at_v: f32| {
                let mut point = [0.0; 3];
                (point[axis], point[u], point[v]) = (level, at_u, at_v);
                point
            };
            let face = |level: f32| {
                [
                    corner(level, min_m[u], min_m[v]),
                    corner(level, max_m[u], min_m[v]),
                    corner(level, max_m[u], max_m[v]),
                    corner(level, min_m[u], max_m[v]),
                ]
            };
            let [a, b, c, d] = face(min_m[axis]);
            self = self.quad(face(max_m[axis])).quad([a, d, c, b]);
        }
        self
    }

    /// Lights the scene by point lights instead of showing `kd` as it is.
    pub fn lights(mut self, lights: Vec<PointLight>) -> Self {
        self.shading = Shading::Lit(lights);
        self
    }

    /// The scene. It has at least one object and one material, even without a triangle.
    pub fn build(mut self) -> Scene {
        self.current();
        let scene = self.triangles.finish(self.materials, self.textures, self.objects);
        Scene { shading: self.shading, ..scene }
    }

    /// Indices of the object and the material that geometry belongs to now.
    fn current(&mut self) -> (u32, u32) {
        if self.objects.is_empty() {
            self.objects.push(Object { name: String::new(), trajectory: None });
        }
        if self.materials.is_empty() {
            self.materials.push(Material { name: "material0".to_owned(), ..Material::default() });
        }
        (self.objects.len() as u32 - 1, self.materials.len() as u32 - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Draw;

    fn checker() -> Texture {
        Texture { path: "checker".into(), width: 2, height: 1, rgba: vec![0, 0, 0, 255, 255, 255, 255, 255] }
    }

    #[test]
    fn untextured_triangles_come_first_and_keep_their_order() {
        let at = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
        let scene = SceneBuilder::new()
            .texture([1.0; 3], checker())
            .triangle(at(0.0))
            .material([0.1; 3])
            .triangle(at(10.0))
            .triangle(at(20.0))
            .texture([1.0; 3], checker())
            .triangle(at(30.0))
            .build();
        let draw = |first_index, index_count, texture| Draw { first_index, index_count, texture };
        assert_eq!(scene.draws, [draw(0, 6, None), draw(6, 3, Some(0)), draw(9, 3, Some(1))]);
        let firsts: Vec<f32> =
            scene.indices.chunks(3).map(|t| scene.vertices[t[0] as usize].position_m[0]).collect();
        assert_eq!(firsts, [10.0, 20.0, 0.0, 30.0]);
    }

    #[test]
    fn corners_are_shared_only_within_object_and_material() {
        let p = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let count = |b: SceneBuilder| b.quad(p).build().vertices.len();
        assert_eq!(count(SceneBuilder::new().quad(p)), 4);
        assert_eq!(count(SceneBuilder::new().quad(p).object("b", None)), 8);
        assert_eq!(count(SceneBuilder::new().quad(p).material([0.5; 3])), 8);
    }

    #[test]
    fn a_cuboid_is_closed_and_faces_outward() {
        let scene = SceneBuilder::new().cuboid([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]).build();
        assert_eq!((scene.triangle_count(), scene.vertices.len()), (12, 24));
        // Gauss: one third of the flux of position through the faces is the volume, 1 * 2 * 3.
        let mut volume = 0.0;
        for t in scene.indices.chunks(3) {
            let [a, b, c] =
                [t[0], t[1], t[2]].map(|i| glam::Vec3::from(scene.vertices[i as usize].position_m));
            volume += a.dot(b.cross(c)) / 6.0;
            let normal = glam::Vec3::from(scene.vertices[t[0] as usize].normal);
            assert!(normal.dot(a - glam::Vec3::new(1.5, 3.0, 4.5)) > 0.0, "inward: {normal}");
        }
        assert!((volume - 6.0).abs() < 1e-4, "volume {volume}");
    }

    #[test]
    fn an_empty_scene_still_has_an_object_and_a_material() {
        let scene = SceneBuilder::new().build();
        assert_eq!((scene.objects.len(), scene.materials.len(), scene.draws.len()), (1, 1, 0));
    }
}
