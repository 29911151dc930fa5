//! Rasterizers with lights in a storage buffer, vertices by the vertex stage: one that a user would otherwise write,
//! with no variant for what does not shine, and one with our fragment shader but for the lights.

use std::mem::offset_of;
use std::sync::Arc;
use std::time::Duration;

use bytemuck::{Pod, Zeroable};
use shutterbug::error::Result;
use shutterbug::gpu::{
    Attachments, BindGroup, Bound, Buffer, Context, DrawBatch, DrawCall, Format, GraphicsPipeline,
    GraphicsSpec, Image, ImageSpec, Location, Recorder, RenderArea, Sampler, Slot, Usage, VertexFormat,
};
use shutterbug::kernels::kernel;
use shutterbug::raster::LensPush;
use shutterbug::scene::{Draw, Scene, Shading, Vertex};

use crate::peer_kernels;

const LIMIT: Duration = Duration::from_secs(60);
const FORMAT: VertexFormat = VertexFormat {
    stride: size_of::<Vertex>() as u32,
    attributes: &[
        (offset_of!(Vertex, position_m) as u32, 3),
        (offset_of!(Vertex, object) as u32, 0),
        (offset_of!(Vertex, normal) as u32, 3),
        (offset_of!(Vertex, material) as u32, 0),
        (offset_of!(Vertex, uv) as u32, 2),
    ],
};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    instant: u32,
    object_count: u32,
    motion_scale_px: [f32; 2],
    lens: LensPush,
}

/// Whose fragment shader a peer has.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Shading16 {
    /// `raster_storage_lights.frag`.
    Plain,
    /// Ours but for the lights.
    Ours,
}

/// Attachments of four samples a pixel, pipelines, and the scene in buffers of its own.
pub struct Peer {
    pub attachments: Attachments,
    /// By texture and gloss: `2 * glossy + textured`.
    pipelines: Vec<GraphicsPipeline>,
    group: BindGroup,
    textures: Vec<BindGroup>,
    vertices: Buffer,
    indices: Buffer,
    /// Runs of triangles, and whether they shine.
    draws: Vec<(Draw, bool)>,
    /// Kept for the groups.
    _bound: (Vec<Image>, [Buffer; 2], Sampler),
}

impl Peer {
    /// `inputs`: the rows of instants and the cameras beside them.
    pub fn new(
        context: &Arc<Context>,
        scene: &Scene,
        size: [u32; 2],
        shading: Shading16,
        [instants, cameras]: [&Buffer; 2],
    ) -> Result<Self> {
        let attachments = Attachments::new(context, "peer", size, 4, &[Format::Rgba16f])?;
        let lights = lights(scene);
        let pipeline = |variant: u32| {
            let (textured, glossy, count) = (variant & 1, variant >> 1, lights.len() as u32 / 12);
            let (file, constants) = match shading {
                Shading16::Plain => ("raster_storage_lights.frag", vec![count, textured]),
                Shading16::Ours => ("raster_our_lights_in_storage.frag", vec![1, textured, count, 0, glossy]),
            };
            let (vertex, fragment) = (kernel("raster_color.vert"), peer_kernels::find(file));
            let spec = GraphicsSpec { vertex, fragment, constants, format: FORMAT, samples: 4 };
            GraphicsPipeline::new(context, &attachments, &spec)
        };
        let pipelines = (0..4).map(pipeline).collect::<Result<Vec<_>>>()?;
        let mut slot = Slot::new(context, "peer")?;
        let mut up = |name, bytes: &[u8], usage| uploaded(context, &mut slot, name, bytes, usage);
        let materials: Vec<[f32; 8]> = scene
            .materials
            .iter()
            .map(|m| [m.kd[0], m.kd[1], m.kd[2], 0.0, m.ks[0], m.ks[1], m.ks[2], m.ns])
            .collect();
        let materials = up("peer materials", bytemuck::cast_slice(&materials), Usage::Storage)?;
        let lights = up("peer lights", bytemuck::cast_slice(&lights), Usage::Storage)?;
        let vertices = up("peer vertices", bytemuck::cast_slice(&scene.vertices), Usage::Vertex)?;
        let indices = up("peer indices", bytemuck::cast_slice(&scene.indices), Usage::Index)?;
        let sampler = Sampler::new(context, true)?;
        let images = images(context, &mut slot, scene)?;
        let texture = |image| pipelines[0].bind(1, &[("kd_texture", Bound::Sampled(image, &sampler))]);
        let textures = images.iter().map(texture).collect::<Result<Vec<_>>>()?;
        let group = pipelines[0].bind(
            0,
            &[
                ("Instants", Bound::Buffer(instants)),
                ("cameras", Bound::Buffer(cameras)),
                ("Materials", Bound::Buffer(&materials)),
                ("Lights", Bound::Buffer(&lights)),
            ],
        )?;
        let shines = |d: &Draw| {
            let range = d.first_index as usize..(d.first_index + d.index_count) as usize;
            let material = |i: &u32| scene.vertices[*i as usize].material as usize;
            scene.indices[range].iter().any(|i| scene.materials[material(i)].is_glossy())
        };
        let draws = scene.draws.iter().map(|d| (*d, shines(d))).collect();
        let bound = (images, [materials, lights], sampler);
        Ok(Self { attachments, pipelines, group, textures, vertices, indices, draws, _bound: bound })
    }

    /// Draws a row of the instants.
    pub fn draw(&self, recorder: &mut Recorder<'_>, (instant, object_count): (u32, u32), area: RenderArea) {
        let push = Push { instant, object_count, motion_scale_px: [0.0; 2], lens: LensPush::NONE };
        let white = self.textures.len() - 1;
        let call = |(draw, shines): &(Draw, bool)| DrawCall {
            pipeline: &self.pipelines[2 * usize::from(*shines) + usize::from(draw.texture.is_some())],
            groups: vec![&self.group, &self.textures[draw.texture.unwrap_or(white)]],
            first_index: draw.first_index,
            index_count: draw.index_count,
        };
        let draws: Vec<_> = self.draws.iter().map(call).collect();
        let batch =
            DrawBatch { vertices: &self.vertices, indices: &self.indices, push: &push, draws: &draws };
        recorder.draw(&self.attachments, area, &batch);
    }
}

/// Twelve floats a light, as the shader reads them.
fn lights(scene: &Scene) -> Vec<f32> {
    let Shading::Lit(lights) = &scene.shading else { return vec![0.0; 12] };
    let row = |l: &shutterbug::scene::PointLight| {
        [l.position_m, l.color, l.attenuation].map(|[x, y, z]| [x, y, z, 0.0]).concat()
    };
    lights.iter().flat_map(row).collect()
}

fn uploaded(
    context: &Arc<Context>,
    slot: &mut Slot,
    name: &str,
    bytes: &[u8],
    usage: Usage,
) -> Result<Buffer> {
    let to = Buffer::new(context, name, bytes.len() as u64, usage, Location::Device)?;
    let mut from = Buffer::new(context, name, bytes.len() as u64, Usage::Transfer, Location::Upload)?;
    from.write(0, bytes);
    // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
    #[allow(unsafe_code)]
    let mut recorder = unsafe { slot.begin_unchecked() }?;
    recorder.copy_buffer(&from, &to, bytes.len() as u64);
    recorder.barrier();
    recorder.finish();
    slot.submit()?;
    slot.wait(LIMIT)?;
    Ok(to)
}

/// The scene's textures, then a white one.
fn images(context: &Arc<Context>, slot: &mut Slot, scene: &Scene) -> Result<Vec<Image>> {
    let all = scene.textures.iter().map(|t| (t.rgba.as_slice(), [t.width, t.height]));
    all.chain([(&[255u8; 4][..], [1, 1])])
        .map(|(bytes, size)| {
            let spec = ImageSpec { storage: false, ..ImageSpec::storage(size, Format::Rgba8Srgb) };
            let image = Image::new(context, "peer texture", spec)?;
            let mut from =
                Buffer::new(context, "texture", bytes.len() as u64, Usage::Transfer, Location::Upload)?;
            from.write(0, bytes);
            // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
            #[allow(unsafe_code)]
            let mut recorder = unsafe { slot.begin_unchecked() }?;
            recorder.prepare([&image]);
            recorder.copy_buffer_to_image(&from, &image);
            recorder.barrier();
            recorder.finish();
            slot.submit()?;
            slot.wait(LIMIT)?;
            Ok(image)
        })
        .collect()
}
