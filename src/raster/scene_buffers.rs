//! The scene in the device's memory, uploaded once.

use std::sync::Arc;
use std::time::Duration;

use bytemuck::{Pod, Zeroable};

use crate::assert_element_layout;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Context, Format, Image, ImageSpec, Location, Sampler, Slot, Usage};
use crate::scene::{Draw, MAX_LIGHTS, Material, PointLight, Scene, Shading, Vertex};

/// `FIXED_LIGHTS` of `raster_lights.glsl`.
const FIXED_LIGHTS: usize = 8;
/// An upload that takes longer than this is stuck.
const UPLOAD_LIMIT: Duration = Duration::from_secs(120);

/// `Material` of `raster_vert.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MaterialRow {
    kd: [f32; 4],
    ks_ns: [f32; 4],
}
assert_element_layout!("raster_color.vert", "Materials", MaterialRow { kd, ks_ns });

/// `Light` of `raster_lights.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LightRow {
    position_m: [f32; 4],
    color: [f32; 4],
    attenuation: [f32; 4],
}
assert_element_layout!("raster_color.frag", "Lights", LightRow { position_m, color, attenuation });

/// Vertices, indices, materials, lights and textures.
pub struct SceneBuffers {
    /// Rows of [`VertexRow`].
    pub(super) vertices: Buffer,
    pub(super) indices: Buffer,
    pub(super) materials: Buffer,
    pub(super) lights: Buffer,
    /// The scene's textures, then a white one for what has none.
    pub(super) textures: Vec<Image>,
    pub(super) sampler: Sampler,
    pub(super) draws: Vec<Draw>,
    /// Whether something of a draw has a specular colour.
    pub(super) glossy: Vec<bool>,
    pub(super) vertex_count: u32,
    pub(super) light_count: u32,
    /// Specialization constants of `raster_lights.glsl`.
    pub(super) fixed_lights: Vec<u32>,
    pub(super) lit: bool,
}

impl SceneBuffers {
    /// Uploads a scene and waits for it.
    ///
    /// # Errors
    /// Out of memory, too many lights.
    pub fn new(context: &Arc<Context>, scene: &Scene) -> Result<Self> {
        let lights: &[PointLight] = match &scene.shading {
            Shading::Lit(lights) => lights,
            Shading::Unlit => &[],
        };
        if lights.len() > MAX_LIGHTS {
            let why = "the shader's table of lights".to_owned();
            let (value, limit) = (lights.len() as u64, MAX_LIGHTS as u64);
            return Err(Error::Limit { what: "number of point lights", value, limit, why });
        }
        let mut uploader = Uploader { context, staging: Vec::new() };
        let rows = vertex_rows(&scene.vertices);
        let vertices: &[u8] = bytemuck::cast_slice(&rows);
        let indices: &[u8] = bytemuck::cast_slice(&scene.indices);
        let buffers = Self {
            vertices: uploader.buffer("vertices", vertices, Usage::VertexTexels)?,
            indices: uploader.buffer("indices", indices, Usage::Index)?,
            materials: uploader.buffer("materials", &material_bytes(scene), Usage::StorageTexels)?,
            lights: uploader.buffer("lights", &light_bytes(lights), Usage::Uniform)?,
            textures: uploader.textures(scene)?,
            sampler: Sampler::new(context, true)?,
            draws: scene.draws.clone(),
            glossy: scene.draws.iter().map(|draw| shines(scene, draw)).collect(),
            vertex_count: scene.vertices.len() as u32,
            light_count: lights.len() as u32,
            fixed_lights: fixed_lights(lights),
            lit: matches!(scene.shading, Shading::Lit(_)),
        };
        uploader.run(&buffers)?;
        Ok(buffers)
    }

    /// Place in `textures` of what a draw samples.
    pub(super) fn texture_index(&self, draw: &Draw) -> usize {
        draw.texture.unwrap_or(self.textures.len() - 1)
    }
}

/// Staging buffers, in the order: the four buffers, then the textures.
struct Uploader<'a> {
    context: &'a Arc<Context>,
    staging: Vec<Buffer>,
}

impl Uploader<'_> {
    fn stage(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let mut staging =
            Buffer::new(self.context, name, bytes.len() as u64, Usage::Transfer, Location::Upload)?;
        staging.write(0, bytes);
        self.staging.push(staging);
        Ok(())
    }

    fn buffer(&mut self, name: &str, bytes: &[u8], usage: Usage) -> Result<Buffer> {
        self.stage(name, bytes)?;
        Buffer::new(self.context, name, bytes.len() as u64, usage, Location::Device)
    }

    fn textures(&mut self, scene: &Scene) -> Result<Vec<Image>> {
        let mut images = Vec::new();
        for texture in &scene.textures {
            self.stage("texture", &texture.rgba)?;
            images.push(self.texture(&texture.path.display().to_string(), [texture.width, texture.height])?);
        }
        self.stage("white", &[255; 4])?;
        images.push(self.texture("white", [1, 1])?);
        Ok(images)
    }

    fn texture(&self, name: &str, size: [u32; 2]) -> Result<Image> {
        let spec = ImageSpec { storage: false, ..ImageSpec::storage(size, Format::Rgba8Srgb) };
        Image::new(self.context, name, spec)
    }

    fn run(self, to: &SceneBuffers) -> Result<()> {
        let mut slot = Slot::new(self.context, "upload")?;
        let mut recorder = slot.begin()?;
        recorder.prepare(&to.textures);
        let (buffers, textures) = self.staging.split_at(4);
        let all = [&to.vertices, &to.indices, &to.materials, &to.lights];
        for (from, to) in buffers.iter().zip(all) {
            recorder.copy_buffer(from, to, from.bytes().min(to.bytes()));
        }
        for (from, to) in textures.iter().zip(&to.textures) {
            recorder.copy_buffer_to_image(from, to);
        }
        recorder.barrier();
        recorder.finish();
        slot.submit()?;
        slot.wait(UPLOAD_LIMIT)
    }
}

/// A vertex in the device's memory: three texels of four words for the kernels that place vertices.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct VertexRow {
    pub(super) vertex: Vertex,
    unused: [u32; 2],
}
const _: () = assert!(size_of::<VertexRow>() == 48);

pub(super) fn vertex_rows(vertices: &[Vertex]) -> Vec<VertexRow> {
    vertices.iter().map(|v| VertexRow { vertex: *v, unused: [0; 2] }).collect()
}

/// Whether a material of a draw has a specular colour.
fn shines(scene: &Scene, draw: &Draw) -> bool {
    let range = draw.first_index as usize..(draw.first_index + draw.index_count) as usize;
    scene.indices[range]
        .iter()
        .any(|i| scene.materials[scene.vertices[*i as usize].material as usize].is_glossy())
}

fn material_bytes(scene: &Scene) -> Vec<u8> {
    let row = |m: &Material| {
        let [r, g, b] = m.ks;
        MaterialRow { kd: four(m.kd), ks_ns: [r, g, b, m.ns] }
    };
    bytemuck::cast_slice(&scene.materials.iter().map(row).collect::<Vec<_>>()).to_vec()
}

fn light_bytes(lights: &[PointLight]) -> Vec<u8> {
    let row = |l: &PointLight| LightRow {
        position_m: four(l.position_m),
        color: four(l.color),
        attenuation: four(l.attenuation),
    };
    let mut rows: Vec<LightRow> = lights.iter().map(row).collect();
    rows.resize(MAX_LIGHTS, LightRow::zeroed());
    bytemuck::cast_slice(&rows).to_vec()
}

fn four([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 0.0]
}

/// The bits of the first lights, in the order of the constants in `raster_lights.glsl`.
fn fixed_lights(lights: &[PointLight]) -> Vec<u32> {
    let all = lights.iter().take(FIXED_LIGHTS).flat_map(|l| [l.position_m, l.color, l.attenuation]);
    all.flatten().map(f32::to_bits).collect()
}
