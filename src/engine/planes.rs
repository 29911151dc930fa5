//! The sharp planes beside a frame: what the camera sees through its lens (as green light) at the frame's timestamp.

use super::Stage;
use super::accumulation::{Accumulate, WeightedLines};
use super::finish::prepare;
use super::frame::{FrameRequest, Planes, covered_span_s};
use super::lens::Channel;
use super::paper::ResolveMotion;
use super::slots::FrameSlot;
use crate::camera::{ScanOrder, Trajectory};
use crate::error::Result;
use crate::gpu::{BindGroup, Buffer, Format, Image, ImageSpec, Location, Recorder, RenderArea, Usage};
use crate::plane::Plane;
use crate::raster::{Instant, RasterInput, RasterKind, RasterTarget};

/// Draws the planes into images of its own, and copies them into mapped buffers of the slot.
pub(super) struct PlanesPass {
    readback: Vec<Readback>,
    inputs: Vec<(RasterInput, BindGroup)>,
    accumulate: Accumulate,
    resolve_motion: ResolveMotion,
    motion_group: BindGroup,
    target: RasterTarget,
    images: [Image; 3],
}

struct Readback {
    color: Buffer,
    motion: Buffer,
    depth: Buffer,
}

/// What [`PlanesPass::write_inputs`] put where.
#[derive(Clone, Copy)]
pub(super) struct PlanesRow {
    row: (u32, u32),
    scale: f64,
    first_weight: u32,
}

impl PlanesPass {
    pub(super) fn new(stage: &Stage, slots: &mut [FrameSlot]) -> Result<Self> {
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let context = &stage.context;
        let target = RasterTarget::new(context, &stage.buffers, RasterKind::ColorMotion, size, stage.plan)?;
        let color = Image::new(context, "plane color", ImageSpec::storage(size, Format::Rgba32f))?;
        let array = ImageSpec { array: true, ..ImageSpec::storage(size, Format::Rg32f) };
        let motion = Image::new(context, "plane motion", array)?;
        let depth = Image::new(context, "plane depth", ImageSpec::storage(size, Format::R32f))?;
        prepare(&mut slots[0].gpu, target.attachments.images().chain([&color, &motion, &depth]))?;
        let accumulate = Accumulate::new(stage)?;
        let resolve_motion = ResolveMotion::new(stage, stage.plan)?;
        let motion_group = resolve_motion.bind(&target, &motion, &depth)?;
        let bind = |slot: &FrameSlot| {
            let input = target.bind(&stage.buffers, &slot.inputs.instants, &slot.inputs.cameras)?;
            Ok((input, accumulate.bind(&target, &color, slot)?))
        };
        let inputs = slots.iter().map(bind).collect::<Result<Vec<_>>>()?;
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let buffer = |name: &str, format: Format| {
            Buffer::new(context, name, pixels * format.texel_bytes(), Usage::Transfer, Location::Readback)
        };
        let one = |_: &FrameSlot| {
            Ok(Readback {
                color: buffer("plane color", Format::Rgba32f)?,
                motion: buffer("plane motion", Format::Rg32f)?,
                depth: buffer("plane depth", Format::R32f)?,
            })
        };
        let readback = slots.iter().map(one).collect::<Result<Vec<_>>>()?;
        let images = [color, motion, depth];
        Ok(Self { readback, inputs, accumulate, resolve_motion, motion_group, target, images })
    }

    /// The instant is the timestamp; motion leads to the next frame's (or as far as there are poses, scaled).
    pub(super) fn write_inputs(
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
        let row = slot.inputs.add(stage, path, &stage.intrinsics, &instant);
        let first_weight = slot.inputs.add_weights(&vec![1.0; self.target.size[1] as usize]);
        PlanesRow { row, scale, first_weight }
    }

    pub(super) fn record(&self, stage: &Stage, recorder: &mut Recorder<'_>, slot: usize, row: PlanesRow) {
        let ([color, motion, depth], size) = (&self.images, self.target.size);
        let (input, group) = &self.inputs[slot];
        let area = RenderArea { x: 0, y: 0, width: size[0], height: size[1] };
        recorder.mark("planes");
        recorder.clear(color);
        self.target.draw(recorder, &stage.drawn(Channel::GREEN), input, row.row, row.scale, area);
        let lines = WeightedLines { first_line: 0, line_count: size[1], first_weight: row.first_weight };
        self.accumulate.record(recorder, group, &lines.push(ScanOrder::TopToBottom, size, stage.plan.grid));
        self.resolve_motion.record(recorder, &self.motion_group, &self.target, 0);
        let to = &self.readback[slot];
        for (image, buffer) in [(color, &to.color), (motion, &to.motion), (depth, &to.depth)] {
            recorder.copy_image_to_buffer(image, [0, 0], size, buffer);
        }
        recorder.barrier();
    }

    /// The planes of a finished frame.
    pub(super) fn read(&self, slot: usize) -> Planes {
        let from = &self.readback[slot];
        let [width, height] = self.target.size.map(|s| s as usize);
        let plane = |buffer: &Buffer, channels: usize| {
            let values: &[f32] = bytemuck::cast_slice(buffer.mapped());
            Plane { width, height, channels, data: values[..width * height * channels].to_vec() }
        };
        Planes {
            color: plane(&from.color, 4),
            motion_px: plane(&from.motion, 2),
            depth_m: plane(&from.depth, 1),
        }
    }
}
