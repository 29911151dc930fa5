//! What the camera looks at: triangles, materials, textures, lights, and objects that move on their own.

mod assemble;
mod build;
mod load;

use std::path::PathBuf;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::camera::{Pose, Trajectory};

pub use build::SceneBuilder;
pub use load::load_obj;

/// One corner of a triangle, as the vertex shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Vertex {
    /// Position in world coordinates, or in object coordinates where the object has a trajectory, m.
    pub position_m: [f32; 3],
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// Unit normal in the same space as the position.
    pub normal: [f32; 3],
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Texture coordinates: u to the right, v up, repeating; v = 0 is the picture's lower edge.
    pub uv: [f32; 2],
}

/// Surface of a face. Colours are linear.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the MTL file.
    pub name: String,
    /// Diffuse colour; under unlit shading the radiance itself.
    pub kd: [f32; 3],
    /// Specular colour.
    pub ks: [f32; 3],
    /// Specular exponent.
    pub ns: f32,
    /// Index into [`Scene::textures`]; the texture multiplies `kd`.
    pub texture: Option<usize>,
}

impl Material {
    /// Whether it has a specular colour.
    pub fn is_glossy(&self) -> bool {
        self.ks != [0.0; 3]
    }
}

impl Default for Material {
    /// Nameless, white, matt (no specular colour, exponent 1), untextured.
    fn default() -> Self {
        Self { name: String::new(), kd: [1.0; 3], ks: [0.0; 3], ns: 1.0, texture: None }
    }
}

/// An 8-bit sRGB picture, top row first, shape `[height, width, 4]`. Decoded to linear before it is interpolated.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// The file it was read from.
    pub path: PathBuf,
    /// Columns, px.
    pub width: u32,
    /// Rows, px.
    pub height: u32,
    /// RGBA values, alpha 255.
    pub rgba: Vec<u8>,
}

/// A named part of the scene.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name in the OBJ file (`o`).
    pub name: String,
    /// Pose over time (object to world); `None`: its vertices are world coordinates and it rests.
    pub trajectory: Option<Arc<Trajectory>>,
}

impl Object {
    /// Object to world at a time inside the trajectory, if there is one.
    pub fn world_from_object(&self, time_s: f64) -> Pose {
        self.trajectory.as_ref().map_or(Pose::IDENTITY, |t| t.pose_at(time_s))
    }
}

/// A run of triangles that are drawn together because they share a texture. A scene that is read or built keeps glossy
/// materials apart from matt ones too, which are then drawn without specular terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draw {
    /// First of the indices in [`Scene::indices`].
    pub first_index: u32,
    /// Their number, three a triangle.
    pub index_count: u32,
    /// Index into [`Scene::textures`].
    pub texture: Option<usize>,
}

/// Most point lights of a scene: `MAX_LIGHTS` of `raster_lights.glsl`.
pub const MAX_LIGHTS: usize = 64;

/// A point light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Position in world coordinates, m.
    pub position_m: [f32; 3],
    /// Linear colour.
    pub color: [f32; 3],
    /// Constant, linear (1/m) and quadratic (1/m^2) term of the divisor.
    pub attenuation: [f32; 3],
}

/// How a surface's radiance comes about.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Shading {
    /// `kd` (times the texture) is the radiance, the same from both sides.
    #[default]
    Unlit,
    /// Point lights, Blinn-Phong evaluated per fragment, from both sides.
    Lit(Vec<PointLight>),
}

/// Everything that can be seen.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Corners of all triangles.
    pub vertices: Vec<Vertex>,
    /// Three indices into `vertices` a triangle, sorted so that each entry of `draws` is one run.
    pub indices: Vec<u32>,
    /// Runs of triangles by texture, the untextured ones first, and by gloss.
    pub draws: Vec<Draw>,
    /// At least one.
    pub materials: Vec<Material>,
    /// Textures that materials refer to.
    pub textures: Vec<Texture>,
    /// At least one.
    pub objects: Vec<Object>,
    /// Lights, if any.
    pub shading: Shading,
}

impl Scene {
    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.indices.len() / 3
    }
}
