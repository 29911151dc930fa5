//! Vertices that a kernel has placed (`raster_place.comp`), and the pipelines that draw them.

use std::mem::offset_of;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::SceneBuffers;
use super::kind::{RasterKind, constants};
use crate::error::Result;
use crate::gpu::{
    Attachments, BindGroup, Bound, Buffer, ComputePipeline, Context, DrawCall, GraphicsPipeline,
    GraphicsSpec, Location, Recorder, Usage, VertexFormat,
};
use crate::kernels::{Kernel, kernel};
use crate::{assert_element_layout, assert_push_layout};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct RasterPlacePush {
    instant: u32,
    object_count: u32,
    vertex_count: u32,
}
assert_push_layout!("raster_place.comp", RasterPlacePush { instant, object_count, vertex_count });

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PlacedVertex {
    clip_xyw: [f32; 3],
    position_m: [f32; 3],
    normal: [f32; 3],
    uv: [f32; 2],
    kd: [f32; 3],
    ks_ns: [f32; 4],
    clip_from: [f32; 3],
    clip_to: [f32; 3],
}
assert_element_layout!(
    "raster_place.comp",
    "PlacedVertices",
    PlacedVertex { clip_xyw, position_m, normal, uv, kd, ks_ns, clip_from, clip_to }
);

const STRIDE: u32 = size_of::<PlacedVertex>() as u32;
const COLOR: VertexFormat = VertexFormat {
    stride: STRIDE,
    attributes: &[
        (offset_of!(PlacedVertex, clip_xyw) as u32, 3),
        (offset_of!(PlacedVertex, position_m) as u32, 3),
        (offset_of!(PlacedVertex, normal) as u32, 3),
        (offset_of!(PlacedVertex, uv) as u32, 2),
        (offset_of!(PlacedVertex, kd) as u32, 3),
        (offset_of!(PlacedVertex, ks_ns) as u32, 4),
        (offset_of!(PlacedVertex, clip_from) as u32, 3),
        (offset_of!(PlacedVertex, clip_to) as u32, 3),
    ],
};
/// The motion's part is not fetched where it is not drawn.
const COLOR_ONLY: VertexFormat = VertexFormat { stride: STRIDE, attributes: COLOR.attributes.split_at(6).0 };
const MOTION: VertexFormat = VertexFormat {
    stride: STRIDE,
    attributes: &[
        (offset_of!(PlacedVertex, clip_xyw) as u32, 3),
        (offset_of!(PlacedVertex, clip_from) as u32, 3),
        (offset_of!(PlacedVertex, clip_to) as u32, 3),
    ],
};

/// Kernel, its output, and pipelines.
pub(super) struct Placed {
    pub(super) buffer: Buffer,
    kernel: ComputePipeline,
    /// By texture and gloss: `2 * glossy + textured`; one where nothing is coloured.
    pipelines: Vec<GraphicsPipeline>,
    textures: Vec<BindGroup>,
}

/// What a frame in flight binds.
pub(super) struct PlacedInput {
    place: BindGroup,
    /// Motion alone binds nothing.
    raster: Option<BindGroup>,
}

fn shaders(kind: RasterKind) -> Option<(&'static Kernel, &'static Kernel, VertexFormat)> {
    let (vertex, fragment, format) = match kind {
        RasterKind::Color => {
            (const { kernel("raster_placed_color.vert") }, const { kernel("raster_color.frag") }, COLOR_ONLY)
        }
        RasterKind::ColorMotion => (
            const { kernel("raster_placed_color_motion.vert") },
            const { kernel("raster_color_motion.frag") },
            COLOR,
        ),
        RasterKind::Motion => {
            (const { kernel("raster_placed_motion.vert") }, const { kernel("raster_motion.frag") }, MOTION)
        }
        RasterKind::Path => {
            (const { kernel("raster_placed_path.vert") }, const { kernel("raster_path.frag") }, MOTION)
        }
        RasterKind::Exact => return None,
    };
    Some((vertex, fragment, format))
}

impl Placed {
    /// `None` for a kind that has its own placing, and for scenes whose vertices the device's buffers do not hold.
    pub(super) fn new(
        context: &Arc<Context>,
        scene: &SceneBuffers,
        kind: RasterKind,
        attachments: &Attachments,
        samples: u32,
    ) -> Result<Option<Self>> {
        let Some((vertex, fragment, format)) = shaders(kind) else { return Ok(None) };
        let bytes = u64::from(scene.vertex_count) * u64::from(STRIDE);
        let readable = scene.vertices.has_texels() && scene.materials.has_texels();
        if !readable || bytes > context.info().max_storage_buffer_bytes {
            return Ok(None);
        }
        let pipeline = |(textured, glossy): &(bool, bool)| {
            let constants = constants(scene, kind, *textured, *glossy);
            GraphicsPipeline::new(
                context,
                attachments,
                &GraphicsSpec { vertex, fragment, constants, format, samples },
            )
        };
        let pipelines = kind.variants().iter().map(pipeline).collect::<Result<Vec<_>>>()?;
        let texture = |image| pipelines[0].bind(1, &[("kd_texture", Bound::Sampled(image, &scene.sampler))]);
        let textures = match kind.has_color() {
            true => scene.textures.iter().map(texture).collect::<Result<Vec<_>>>()?,
            false => Vec::new(),
        };
        let color = kind.has_color();
        let motion = !matches!(kind, RasterKind::Color);
        let kernel = ComputePipeline::specialized(
            context,
            const { kernel("raster_place.comp") },
            &[color.into(), motion.into()],
        )?;
        let buffer = Buffer::new(context, "placed vertices", bytes, Usage::StorageVertex, Location::Device)?;
        Ok(Some(Self { buffer, kernel, pipelines, textures }))
    }

    /// `all`: what the raster binds; `instants`: the rows to place at. `None` where their texels cannot be fetched.
    pub(super) fn bind(
        &self,
        scene: &SceneBuffers,
        all: &[(&str, Bound<'_>)],
        instants: &Buffer,
    ) -> Result<Option<PlacedInput>> {
        if !instants.has_texels() {
            return Ok(None);
        }
        let place = self.kernel.bind(&[
            ("vertices", Bound::Buffer(&scene.vertices)),
            ("instants", Bound::Buffer(instants)),
            ("materials", Bound::Buffer(&scene.materials)),
            ("PlacedVertices", Bound::Buffer(&self.buffer)),
        ])?;
        let raster = (!self.textures.is_empty()).then(|| self.pipelines[0].bind(0, all)).transpose()?;
        Ok(Some(PlacedInput { place, raster }))
    }

    /// Places all vertices for a row of instants.
    pub(super) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        scene: &SceneBuffers,
        input: &PlacedInput,
        (instant, object_count): (u32, u32),
    ) {
        let push = RasterPlacePush { instant, object_count, vertex_count: scene.vertex_count };
        recorder.dispatch(&self.kernel, &input.place, &push, [scene.vertex_count, 1]);
    }

    /// The draws of the scene.
    pub(super) fn draw_calls<'a>(
        &'a self,
        scene: &SceneBuffers,
        input: &'a PlacedInput,
    ) -> Vec<DrawCall<'a>> {
        let Some(raster) = &input.raster else {
            let index_count = scene.draws.iter().map(|d| d.index_count).sum();
            return vec![DrawCall {
                pipeline: &self.pipelines[0],
                groups: Vec::new(),
                first_index: 0,
                index_count,
            }];
        };
        let calls = scene.draws.iter().zip(&scene.glossy).map(|(draw, glossy)| DrawCall {
            pipeline: &self.pipelines[2 * usize::from(*glossy) + usize::from(draw.texture.is_some())],
            groups: vec![raster, &self.textures[scene.texture_index(draw)]],
            first_index: draw.first_index,
            index_count: draw.index_count,
        });
        calls.collect()
    }
}
