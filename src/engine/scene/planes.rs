//! The sharp planes beside a frame: what the camera sees through its lens (as green light) at the frame's timestamp.

use bytemuck::{Pod, Zeroable};

use crate::assert_push_layout;
use crate::camera::{ScanOrder, Trajectory};
use crate::effects::Defocus;
use crate::engine::finish::Finish;
use crate::engine::flight::Room;
use crate::engine::frame::FrameRequest;
use crate::engine::scene::accumulate::{Accumulate, WeightedLines};
use crate::engine::scene::lens::Channel;
use crate::engine::scene::resolve::ResolveMotion;
use crate::engine::scene::{Stage, covered_span_s};
use crate::engine::slots::{FrameSlot, PlanesReadback, ReadTo};
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, ComputePipeline, Format, Image, ImageSpec, Recorder, RenderArea};
use crate::kernels::kernel;
use crate::raster::{Instant, RasterInput, RasterKind, RasterTarget};

/// Draws the planes into images of its own, and copies them into mapped buffers of the slot.
pub(crate) struct PlanesPass {
    inputs: Vec<(RasterInput, BindGroup)>,
    accumulate: Accumulate,
    resolve_motion: ResolveMotion,
    motion_group: BindGroup,
    target: RasterTarget,
    images: [Image; 3],
    /// Nearness into the radiance's alpha, for effects that depend on distance.
    nearness: (BindGroup, ComputePipeline),
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct NearnessPush {
    size: [u32; 2],
}
assert_push_layout!("defocus_depth.comp", NearnessPush { size });

/// The end of a frame: distances where the chain needs them, the chain, and the planes where they are delivered.
pub(crate) struct Ending<'a> {
    pass: Option<&'a PlanesPass>,
    delivered: Option<PlanesRow>,
    nearness: Option<PlanesRow>,
}

impl<'a> Ending<'a> {
    /// Writes what [`Self::record`] will draw; the rows belong to one submission.
    pub(crate) fn new(
        pass: Option<&'a PlanesPass>,
        stage: &Stage,
        slot: &mut FrameSlot,
        request: &FrameRequest,
        path: &Trajectory,
    ) -> Self {
        let row = |wanted: bool, slot: &mut FrameSlot, at: &FrameRequest| {
            pass.filter(|_| wanted).map(|p| p.write_inputs(stage, slot, at, path))
        };
        let delivered = row(request.planes, slot, request);
        // What is seen is seen around the middle of the frame, not at its timestamp.
        let mut middle = request.clone();
        middle.shutter.start_s = request.shutter.middle_s();
        let nearness = row(Defocus::needs_depth(&request.settings), slot, &middle);
        Self { pass, delivered, nearness }
    }

    /// Whether the radiance's alpha is written before the chain.
    pub(crate) fn needs_depth(&self) -> bool {
        self.nearness.is_some()
    }

    /// Records it behind what makes the radiance; `developed`: the chain is done already.
    pub(crate) fn record(
        &self,
        stage: &Stage,
        recorder: &mut Recorder<'_>,
        slot: usize,
        (finish, request, developed): (&Finish, &FrameRequest, bool),
        to: ReadTo<'_>,
    ) {
        if let (Some(pass), Some(row)) = (self.pass, self.nearness) {
            pass.draw(stage, recorder, slot, row);
            recorder.dispatch(
                &pass.nearness.1,
                &pass.nearness.0,
                &NearnessPush { size: pass.target.size },
                pass.target.size,
            );
        }
        if developed {
            finish.record_readback(recorder, request, (to.picture, to.radiance));
        } else {
            finish.record(recorder, request, (to.picture, to.radiance));
        }
        if let (Some(pass), Some(row), Some(to)) = (self.pass, self.delivered, to.planes) {
            pass.draw(stage, recorder, slot, row);
            pass.record_readback(recorder, to);
        }
    }
}

/// What [`PlanesPass::write_inputs`] put where.
#[derive(Clone, Copy)]
pub(crate) struct PlanesRow {
    row: (u32, u32),
    scale: f64,
    first_weight: u32,
}

impl PlanesPass {
    pub(crate) fn new(stage: &Stage, room: &mut Room<'_>) -> Result<Self> {
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let context = &stage.context;
        let target = RasterTarget::new(context, &stage.buffers, RasterKind::ColorMotion, size, stage.plan)?;
        let color = Image::new(context, "plane color", ImageSpec::storage(size, Format::Rgba32f))?;
        let array = ImageSpec { array: true, ..ImageSpec::storage(size, Format::Rg32f) };
        let motion = Image::new(context, "plane motion", array)?;
        let depth = Image::new(context, "plane depth", ImageSpec::storage(size, Format::R32f))?;
        room.prepare(target.attachments.images().chain([&color, &motion, &depth]))?;
        let accumulate = Accumulate::new(stage)?;
        let resolve_motion = ResolveMotion::new(stage, stage.plan)?;
        let motion_group = resolve_motion.bind(&target, &motion, &depth)?;
        let bind = |slot: &FrameSlot| {
            let input = target.bind(&stage.buffers, &slot.inputs.instants, &slot.inputs.cameras)?;
            Ok((input, accumulate.bind(&target, &color, slot)?))
        };
        let inputs = room.slots.iter().map(bind).collect::<Result<Vec<_>>>()?;
        for slot in room.slots.iter_mut() {
            slot.planes = Some(PlanesReadback::new(context, size)?);
        }
        let kernel = ComputePipeline::new(context, const { kernel("defocus_depth.comp") })?;
        let group =
            kernel.bind(&[("depth", Bound::Storage(&depth)), ("radiance", Bound::Storage(room.radiance))])?;
        let (images, nearness) = ([color, motion, depth], (group, kernel));
        Ok(Self { inputs, accumulate, resolve_motion, motion_group, target, images, nearness })
    }

    /// The instant is the timestamp; motion leads to the next frame's (or as far as there are poses, scaled).
    pub(crate) fn write_inputs(
        &self,
        stage: &Stage,
        slot: &mut FrameSlot,
        request: &FrameRequest,
        path: &Trajectory,
    ) -> PlanesRow {
        let (time_s, interval_s) = (request.shutter.start_s, request.frame_interval_s);
        // A camera that rests during each frame still moves between frames, but then its motion is not known.
        let (first_s, last_s) = covered_span_s(stage, path);
        let (mut from_s, mut to_s) = (time_s, (time_s + interval_s).min(last_s));
        if to_s <= from_s {
            (from_s, to_s) = ((time_s - interval_s).max(first_s), time_s);
        }
        let scale = if to_s > from_s { interval_s / (to_s - from_s) } else { 0.0 };
        let instant = Instant { time_s, motion_from_s: from_s, motion_to_s: to_s };
        let row = slot.inputs.add((path, &stage.scene.objects), &stage.intrinsics, &instant);
        let first_weight = slot.inputs.add_weights(&vec![1.0; self.target.size[1] as usize]);
        PlanesRow { row, scale, first_weight }
    }

    fn record_readback(&self, recorder: &mut Recorder<'_>, to: &PlanesReadback) {
        let ([color, motion, depth], size) = (&self.images, self.target.size);
        for (image, buffer) in [(color, &to.color), (motion, &to.motion), (depth, &to.depth)] {
            recorder.copy_image_to_buffer(image, [0, 0], size, buffer);
        }
        recorder.barrier();
    }

    fn draw(&self, stage: &Stage, recorder: &mut Recorder<'_>, slot: usize, row: PlanesRow) {
        let ([color, ..], size) = (&self.images, self.target.size);
        let (input, group) = &self.inputs[slot];
        let area = RenderArea { x: 0, y: 0, width: size[0], height: size[1] };
        recorder.mark("planes");
        recorder.clear(color);
        self.target.draw(recorder, &stage.drawn(Channel::GREEN), input, row.row, row.scale, area);
        let lines = WeightedLines { first_line: 0, line_count: size[1], first_weight: row.first_weight };
        self.accumulate.record(recorder, group, &lines.push(ScanOrder::TopToBottom, size, stage.plan.grid));
        self.resolve_motion.record(recorder, &self.motion_group, &self.target, 0);
    }
}
