//! `--method exact`: the shutter in the vertex stage (each vertex projected at the time of the line it lands on), so that
//! one render has the right time in every line, and nothing is resampled.

mod cut;

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::Stage;
use super::finish::{Finish, prepare};
use super::frame::FrameRequest;
use super::planes::PlanesPass;
use super::slots::FrameSlot;
use crate::assert_push_layout;
use crate::camera::{Intrinsics, ScanOrder, ShutterTiming, Trajectory};
use crate::error::Result;
use crate::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Context, Image, Location, Recorder, RenderArea, Sampler, Usage,
};
use crate::kernels::kernel;
use crate::raster::{
    ExactPush, Geometry, KnotRow, Mesh, MotionGroups, RasterInput, RasterKind, RasterTarget, View,
};

/// Most knots of a frame.
const MAX_KNOTS: usize = 129;
/// Error of matrices taken for linear between knots, px.
const KNOT_ERROR_PX: f64 = 0.01;
/// Lines beyond the picture whose time is still extended, as a share of all: vertices there are ends of edges that
/// cross the border, and a time that stopped at the border would bend those edges inside.
const LINES_BEYOND: f64 = 0.25;

/// How the method renders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactOptions {
    /// Largest distance between a drawn edge and the curve that the shutter makes of it, px. Triangles are cut for it.
    pub chord_px: f64,
    /// Most triangles that cutting may make (the distance above is doubled until they suffice).
    pub most_triangles: u32,
}

impl Default for ExactOptions {
    fn default() -> Self {
        Self { chord_px: 0.1, most_triangles: 400_000 }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct StillPush {
    size: [u32; 2],
    margin_px: [i32; 2],
    grid: [i32; 2],
}
assert_push_layout!("exact_still_ms.comp", StillPush { size, margin_px, grid });

/// The method.
pub(super) struct Exact {
    inputs: Vec<Input>,
    still_group: BindGroup,
    still: ComputePipeline,
    _sampler: Sampler,
    target: RasterTarget,
    whole: Geometry,
    /// Triangles cut for readouts up to this long, s.
    cut: Option<(f64, Geometry)>,
    mesh: Mesh,
    groups: MotionGroups,
    frames: Vec<(f64, f64)>,
    options: ExactOptions,
}

/// What a frame in flight has of its own.
struct Input {
    raster: RasterInput,
    knots: Buffer,
    camera: Buffer,
}

impl Input {
    fn new(stage: &Stage, target: &RasterTarget, groups: usize) -> Result<Self> {
        let context: &Arc<Context> = &stage.context;
        let upload = |name: &str, bytes: usize| {
            Buffer::new(context, name, bytes as u64, Usage::Storage, Location::Upload)
        };
        let knots = upload("knots", groups * MAX_KNOTS * size_of::<KnotRow>())?;
        let camera = upload("exact camera", 16)?;
        Ok(Self { raster: target.bind_knots(&stage.buffers, &knots, &camera)?, knots, camera })
    }
}

impl Exact {
    pub(super) fn new(
        stage: &Stage,
        options: &ExactOptions,
        slots: &mut [FrameSlot],
        radiance: &Image,
        expected: &[FrameRequest],
    ) -> Result<Self> {
        let context = &stage.context;
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let target = RasterTarget::new(context, &stage.buffers, RasterKind::Exact, size, stage.plan)?;
        prepare(&mut slots[0].gpu, target.attachments.images())?;
        let multisampled = const { kernel("exact_still_ms.comp") };
        let plain = const { kernel("exact_still.comp") };
        let kernel = if stage.plan.msaa > 1 { multisampled } else { plain };
        let still = ComputePipeline::new(context, kernel)?;
        let sampler = Sampler::new(context, false)?;
        let still_group = still.bind(&[
            ("color_samples", Bound::Sampled(&target.attachments.colors()[0], &sampler)),
            ("radiance", Bound::Storage(radiance)),
        ])?;
        let groups = MotionGroups::new(&stage.scene);
        let inputs =
            slots.iter().map(|_| Input::new(stage, &target, groups.count())).collect::<Result<_>>()?;
        let scene = &stage.scene;
        let vertex = |i: u32| {
            let vertex = scene.vertices[i as usize];
            crate::scene::Vertex { object: groups.of_object(vertex.object), ..vertex }
        };
        let mesh = Mesh::joined(vertex, &scene.indices, &scene.draws);
        let whole = Geometry::new(context, &mesh)?;
        let frames = expected.iter().map(|r| (r.shutter.start_s, r.shutter.end_s())).collect();
        let mut exact = Self {
            inputs,
            still_group,
            still,
            _sampler: sampler,
            target,
            whole,
            cut: None,
            mesh,
            groups,
            frames,
            options: *options,
        };
        if let Some(longest) = expected.iter().max_by(|a, b| readout_s(a).total_cmp(&readout_s(b))) {
            exact.fit(stage, longest)?;
        }
        Ok(exact)
    }

    /// Whether triangles must be cut more finely for a frame: nothing may be in flight when [`Self::fit`] does so.
    pub(super) fn needs_fit(&self, request: &FrameRequest) -> bool {
        let readout_s = readout_s(request);
        readout_s > 0.0 && self.cut.as_ref().is_none_or(|(cut_s, _)| readout_s > cut_s * (1.0 + 1e-9))
    }

    /// See [`Self::needs_fit`].
    pub(super) fn fit(&mut self, stage: &Stage, request: &FrameRequest) -> Result<()> {
        if !self.needs_fit(request) {
            return Ok(());
        }
        if self.frames.is_empty() {
            self.frames.push((request.shutter.start_s, request.shutter.end_s()));
        }
        let readout_s = readout_s(request);
        let limits = (self.options.chord_px, self.options.most_triangles as usize);
        let (mesh, chord_px) = cut::cut(stage, &self.groups, &self.mesh, &self.frames, readout_s, limits);
        let (from, to) = (self.mesh.triangle_count(), mesh.triangle_count());
        tracing::info!(
            "{from} triangles cut into {to} for a readout of {readout_s} s: {chord_px} px at most"
        );
        self.cut = Some((readout_s, Geometry::new(&stage.context, &mesh)?));
        Ok(())
    }

    pub(super) fn submit(
        &mut self,
        stage: &Stage,
        slot: &mut FrameSlot,
        request: &FrameRequest,
        path: &Trajectory,
        (finish, planes): (&Finish, Option<&PlanesPass>),
    ) -> Result<()> {
        let shutter = &request.shutter;
        let camera = stage.intrinsics;
        let view = View { camera: &camera, path };
        let rolls = shutter.readout_time_s > 0.0 && shutter.line_count > 1;
        let times = if rolls {
            self.groups.knot_times_s(&view, (shutter.start_s, shutter.end_s()), KNOT_ERROR_PX, MAX_KNOTS)
        } else {
            vec![shutter.middle_s()]
        };
        let push = raster_push(&camera, shutter, times.len());
        let (rows, eye) = self.groups.knot_rows(&view, &times);
        let input = &mut self.inputs[slot.index];
        input.knots.write(0, &rows);
        input.camera.write(0, &[eye]);
        let plane_row =
            planes.filter(|_| request.planes).map(|p| (p, p.write_inputs(stage, slot, request, path)));
        let index = slot.index;
        let mut recorder = slot.gpu.begin()?;
        recorder.mark("raster");
        let area = RenderArea { x: 0, y: 0, width: camera.width, height: camera.height };
        let geometry = match &self.cut {
            Some((_, cut)) if rolls => cut,
            _ => &self.whole,
        };
        self.target.draw_exact(
            &mut recorder,
            (&stage.buffers, geometry),
            &self.inputs[index].raster,
            &push,
            area,
        );
        recorder.mark("resolve");
        self.resolve(stage, &mut recorder);
        finish.record(&mut recorder, request, (&slot.picture, &slot.radiance));
        if let Some((planes, row)) = plane_row {
            planes.record(stage, &mut recorder, index, row);
        }
        recorder.finish();
        slot.gpu.submit()
    }

    fn resolve(&self, stage: &Stage, recorder: &mut Recorder<'_>) {
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let push = StillPush { size, margin_px: [0; 2], grid: [stage.plan.grid as i32; 2] };
        recorder.dispatch(&self.still, &self.still_group, &push, size);
    }
}

fn readout_s(request: &FrameRequest) -> f64 {
    request.shutter.readout_time_s
}

/// Where the vertex stage finds the time of a line: the middle of its exposure, in places among knots that are spread
/// from the first line's start to the last line's end. Line l of the picture covers [l, l + 1) px in scan order, and its
/// time belongs to its middle.
fn raster_push(camera: &Intrinsics, shutter: &ShutterTiming, knot_count: usize) -> ExactPush {
    let span_s = shutter.end_s() - shutter.start_s;
    if knot_count < 2 {
        return ExactPush {
            knot_count: 1,
            place_low: 0.0,
            place_high: 0.0,
            place_offset: 0.0,
            place_from_ndc: [0.0; 2],
        };
    }
    let per_s = (knot_count - 1) as f64 / span_s;
    let lines = f64::from(shutter.line_count);
    let delay_s = shutter.line_delay_s();
    let place = |line: f64| per_s * (0.5 * shutter.exposure_time_s + delay_s * (line - 0.5));
    let rows = shutter.scan_order.lines_are_rows();
    let side = f64::from(if rows { camera.height } else { camera.width });
    let reversed = matches!(shutter.scan_order, ScanOrder::BottomToTop | ScanOrder::RightToLeft);
    let per_ndc = per_s * delay_s * 0.5 * side * if reversed { -1.0 } else { 1.0 };
    let beyond = 0.5 * (side - lines) + LINES_BEYOND * lines;
    ExactPush {
        knot_count: knot_count as u32,
        place_low: place(-beyond) as f32,
        place_high: place(lines + beyond) as f32,
        // The margin is the same on both sides, so the middle of the attachment is that of the picture.
        place_offset: place(0.5 * lines) as f32,
        place_from_ndc: if rows { [0.0, per_ndc as f32] } else { [per_ndc as f32, 0.0] },
    }
}
