//! Attachments of one kind with the pipelines that draw into them.

use std::mem::offset_of;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::geometry::PLACED_FORMAT;
use super::kind::{RasterKind, constants};
use super::raster_place::{Placed, PlacedInput};
use super::scene_buffers::VertexRow;
use super::{Geometry, LensPush, SamplePlan, SceneBuffers};
use crate::assert_push_layout;
use crate::camera::{ExtendedLens, NEAR_M};
use crate::error::Result;
use crate::gpu::{
    Attachments, BindGroup, Bound, Buffer, Context, DrawBatch, DrawCall, GraphicsPipeline, GraphicsSpec,
    Recorder, RenderArea, VertexFormat,
};
use crate::scene::Draw;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    instant: u32,
    object_count: u32,
    motion_scale_px: [f32; 2],
    lens: LensPush,
}
assert_push_layout!("raster_color_motion.vert", Push { instant, object_count, motion_scale_px, lens });
assert_push_layout!("raster_color_motion.frag", Push { instant, object_count, motion_scale_px, lens });
assert_push_layout!("raster_path.frag", Push { instant, object_count, motion_scale_px, lens });

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ExactPush {
    near_m: f32,
}
assert_push_layout!("raster_exact.vert", ExactPush { near_m });

const VERTEX_FORMAT: VertexFormat = VertexFormat {
    stride: size_of::<VertexRow>() as u32,
    attributes: &[
        (offset_of!(VertexRow, vertex.position_m) as u32, 3),
        (offset_of!(VertexRow, vertex.object) as u32, 0),
        (offset_of!(VertexRow, vertex.normal) as u32, 3),
        (offset_of!(VertexRow, vertex.material) as u32, 0),
        (offset_of!(VertexRow, vertex.uv) as u32, 2),
    ],
};

/// Attachments and pipelines.
pub struct RasterTarget {
    /// What is drawn.
    pub kind: RasterKind,
    /// Delivered size, px: the attachments are `grid` times larger.
    pub size: [u32; 2],
    /// Samples a pixel.
    pub plan: SamplePlan,
    /// The images.
    pub attachments: Attachments,
    /// By texture and gloss: `2 * glossy + textured`; one where nothing is coloured.
    pipelines: Vec<GraphicsPipeline>,
    /// Set 1 by texture.
    textures: Vec<BindGroup>,
    /// The faster way to the same picture, where there is one.
    placed: Option<Placed>,
}

/// What is drawn, through which lens.
#[derive(Clone, Copy)]
pub struct Drawn<'a> {
    /// The scene.
    pub scene: &'a SceneBuffers,
    /// Its triangles where they were cut; `object` of a vertex is the object's number.
    pub geometry: Option<&'a Geometry>,
    /// The lens and a magnification about (cx, cy); `None`: the pinhole.
    pub lens: Option<(&'a ExtendedLens, f64)>,
}

/// Set 0 of a target: the instants of one frame in flight.
pub struct RasterInput {
    group: BindGroup,
    placed: Option<PlacedInput>,
}

impl RasterTarget {
    /// Attachments of `size` delivered pixels, and pipelines for the scene.
    ///
    /// # Errors
    /// Out of memory; larger than the device allows.
    pub fn new(
        context: &Arc<Context>,
        scene: &SceneBuffers,
        kind: RasterKind,
        size: [u32; 2],
        plan: SamplePlan,
    ) -> Result<Self> {
        let texels = size.map(|s| s * plan.grid);
        let name = format!("{kind:?}");
        let attachments = Attachments::new(context, &name, texels, plan.msaa, kind.formats())?;
        let (vertex, fragment) = kind.shaders();
        let format = if kind == RasterKind::Exact { PLACED_FORMAT } else { VERTEX_FORMAT };
        let pipeline = |(textured, glossy): &(bool, bool)| {
            let constants = constants(scene, kind, *textured, *glossy);
            let spec = GraphicsSpec { vertex, fragment, constants, format, samples: plan.msaa };
            GraphicsPipeline::new(context, &attachments, &spec)
        };
        let pipelines = kind.variants().iter().map(pipeline).collect::<Result<Vec<_>>>()?;
        let mut textures = Vec::new();
        if kind.has_color() {
            for image in &scene.textures {
                textures
                    .push(pipelines[0].bind(1, &[("kd_texture", Bound::Sampled(image, &scene.sampler))])?);
            }
        }
        let placed = Placed::new(context, scene, kind, &attachments, plan.msaa)?;
        Ok(Self { kind, size, plan, attachments, pipelines, textures, placed })
    }

    /// Binds the rows of `instants` (made by [`super::instant_rows`]) and the camera positions beside them.
    ///
    /// # Errors
    /// Out of memory.
    pub fn bind(&self, scene: &SceneBuffers, instants: &Buffer, cameras: &Buffer) -> Result<RasterInput> {
        let all = [
            ("Instants", Bound::Buffer(instants)),
            ("cameras", Bound::Buffer(cameras)),
            ("Materials", Bound::Buffer(&scene.materials)),
            ("Lights", Bound::Buffer(&scene.lights)),
        ];
        let placed = self.placed.as_ref().map(|p| p.bind(scene, &all, instants)).transpose()?.flatten();
        Ok(RasterInput { group: self.pipelines[0].bind(0, &all)?, placed })
    }

    /// Binds what [`RasterKind::Exact`] needs beside placed vertices: the camera that they are centred on.
    ///
    /// # Errors
    /// Out of memory.
    pub fn bind_exact(&self, scene: &SceneBuffers, camera: &Buffer) -> Result<RasterInput> {
        let all = [("cameras", Bound::Buffer(camera)), ("Lights", Bound::Buffer(&scene.lights))];
        Ok(RasterInput { group: self.pipelines[0].bind(0, &all)?, placed: None })
    }

    /// Draws [`RasterKind::Exact`]: vertices as [`super::Place`] left them. `area` is in delivered pixels.
    pub fn draw_exact(
        &self,
        recorder: &mut Recorder<'_>,
        (scene, geometry): (&SceneBuffers, &Geometry),
        input: &RasterInput,
        area: RenderArea,
    ) {
        let draws = self.draw_calls(scene, input, &geometry.draws);
        let push = ExactPush { near_m: NEAR_M as f32 };
        let batch =
            DrawBatch { vertices: &geometry.placed, indices: &geometry.indices, push: &push, draws: &draws };
        recorder.draw(&self.attachments, self.texels(area), &batch);
    }

    /// A rectangle of delivered pixels in texels of the attachments.
    fn texels(&self, area: RenderArea) -> RenderArea {
        let grid = self.plan.grid;
        RenderArea {
            x: area.x * grid,
            y: area.y * grid,
            width: area.width * grid,
            height: area.height * grid,
        }
    }

    /// Draws row `instant` of the bound instants. `area` is in delivered pixels; `motion_scale` turns px over the
    /// motion's span into px per frame interval.
    pub fn draw(
        &self,
        recorder: &mut Recorder<'_>,
        drawn: &Drawn<'_>,
        input: &RasterInput,
        (instant, object_count): (u32, u32),
        motion_scale: f64,
        area: RenderArea,
    ) {
        let scale = |side: u32| (0.5 * f64::from(side) * motion_scale) as f32;
        let lens = drawn.lens.map_or(LensPush::NONE, |(lens, by)| LensPush::new(lens, self.size, by));
        let push = Push { instant, object_count, motion_scale_px: self.size.map(scale), lens };
        let scene = drawn.scene;
        let pinhole = drawn.lens.is_none() && drawn.geometry.is_none();
        if let (true, Some(placed), Some(input)) = (pinhole, &self.placed, &input.placed) {
            placed.record(recorder, scene, input, (instant, object_count));
            let draws = placed.draw_calls(scene, input);
            let batch =
                DrawBatch { vertices: &placed.buffer, indices: &scene.indices, push: &push, draws: &draws };
            return recorder.draw(&self.attachments, self.texels(area), &batch);
        }
        let (vertices, indices, runs) = match drawn.geometry {
            Some(cut) => (&cut.vertices, &cut.indices, &cut.draws),
            None => (&scene.vertices, &scene.indices, &scene.draws),
        };
        let draws = self.draw_calls(scene, input, runs);
        let batch = DrawBatch { vertices, indices, push: &push, draws: &draws };
        recorder.draw(&self.attachments, self.texels(area), &batch);
    }

    fn draw_calls<'a>(
        &'a self,
        scene: &SceneBuffers,
        input: &'a RasterInput,
        draws: &[Draw],
    ) -> Vec<DrawCall<'a>> {
        if !self.kind.has_color() {
            let (pipeline, groups) = (&self.pipelines[0], vec![&input.group]);
            let index_count = draws.iter().map(|d| d.index_count).sum();
            return vec![DrawCall { pipeline, groups, first_index: 0, index_count }];
        }
        // Cutting keeps the runs and their order.
        let calls = draws.iter().zip(&scene.glossy).map(|(draw, glossy)| DrawCall {
            pipeline: &self.pipelines[2 * usize::from(*glossy) + usize::from(draw.texture.is_some())],
            groups: vec![&input.group, &self.textures[scene.texture_index(draw)]],
            first_index: draw.first_index,
            index_count: draw.index_count,
        });
        calls.collect()
    }
}
