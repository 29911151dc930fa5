//! Frames from outside through the warp of `--method fast`: colour and depth of one instant, and the camera's poses over the
//! frame. Lens, shutter and blur are one reading of the colour; silhouettes are kept apart by depth.

use super::Stage;
use super::fast_depth::turns_only;
use super::fast_pass::{FastBinding, FastGather, FastImages, FastKind, FastTiming, MOVED_BYTES};
use super::finish::prepare;
use super::lens::Merge;
use super::outside_frame::{MAX_BODIES, OutsideBodies, OutsideFrame};
use super::outside_lens::{MarginNeed, OutsideLens};
use super::slots::FrameSlot;
use crate::camera::{Intrinsics, Trajectory};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Context, Format, Image, ImageSpec, Location, Recorder, Usage};
use crate::raster::moved_row;
use std::sync::Arc;

/// How the camera moves over one frame, and what it sees.
pub(super) struct WarpPlan {
    timing: FastTiming,
    /// Whether it only turns, before what rests.
    turns: bool,
    /// Matrices over the frame, of what rests and then of each body.
    rows: Vec<[[f32; 4]; 3]>,
    /// Ids in rising order, then the number of each.
    numbers: Vec<u32>,
}

impl WarpPlan {
    /// `camera` has the frame's margin.
    ///
    /// # Errors
    /// Poses that do not cover the frame and the colour's instant; a margin that is too small for them.
    pub(super) fn new(
        (nominal, lens): (&Intrinsics, Option<&OutsideLens>),
        frame: &OutsideFrame<'_>,
        (path, bodies): (&Trajectory, Option<&OutsideBodies<'_>>),
        (nearest_m, repeat_border): (f64, bool),
    ) -> Result<Self> {
        let shutter = &frame.request.shutter;
        check_spans(path, "", frame)?;
        let bodies = bodies.map_or(&[][..], |b| &b.paths);
        bodies.iter().try_for_each(|(id, own)| check_spans(own, &format!(", body {id}"), frame))?;
        let needed = MarginNeed { nominal, lens, nearest_m }.of_frame(path, frame.color_time_s, shutter)?;
        let given = frame.margin_px;
        if !repeat_border && (needed[0] > given[0] || needed[1] > given[1]) {
            return Err(Error::MarginTooSmall { needed_px: needed, given_px: given });
        }
        let camera = nominal.with_margin(given);
        let (timing, times_s) = FastTiming::spaced(*shutter);
        let now = path.pose_at(frame.color_time_s);
        let mut rows = Vec::with_capacity(times_s.len() * (bodies.len() + 1));
        rows.extend(times_s.iter().map(|&t| moved_row(&camera, &path.pose_at(t).relative(&now))));
        for (_, own) in bodies {
            let body_from_camera = own.pose_at(frame.color_time_s).relative(&now);
            let moved = |&t: &f64| path.pose_at(t).relative(&own.pose_at(t)).then_from(&body_from_camera);
            rows.extend(times_s.iter().map(|t| moved_row(&camera, &moved(t))));
        }
        let turns = bodies.is_empty() && turns_only(&camera, path, frame.color_time_s, &times_s);
        let numbers = bodies.iter().map(|(id, _)| *id).chain(1..=bodies.len() as u32).collect();
        Ok(Self { timing, turns, rows, numbers })
    }

    /// How many bodies move by themselves.
    pub(super) fn body_count(&self) -> u32 {
        self.numbers.len() as u32 / 2
    }
}

fn check_spans(path: &Trajectory, whose: &str, frame: &OutsideFrame<'_>) -> Result<()> {
    let (index, shutter) = (frame.request.index, &frame.request.shutter);
    path.require(shutter.start_s, shutter.end_s(), &format!("frame {index}{whose}"))?;
    path.require(frame.color_time_s, frame.color_time_s, &format!("the colour of frame {index}{whose}"))
}

/// Everything that such frames need beside what all frames from outside need.
pub(super) struct OutsideWarp {
    lens: Option<OutsideLens>,
    size: [u32; 2],
    /// Colour that is filtered, for frames with an exposure.
    pub(super) half: Image,
    pub(super) inverse_depth: Image,
    /// Bound by the warps, kept alive here; by colour.
    _tables: Vec<[Image; 2]>,
    moved: Vec<Buffer>,
    /// Ids and numbers of bodies, by frame in flight.
    pub(super) numbers: Vec<Buffer>,
    /// Whether there may be bodies.
    bodies: bool,
    /// Of a camera that passes what it sees, and of one that only turns.
    warps: [FastGather; 2],
    /// By frame in flight, warp and colour.
    bindings: Vec<[Vec<FastBinding>; 2]>,
    merge: Option<Merge>,
}

impl OutsideWarp {
    /// For pictures of `color`'s size; nothing may be in flight.
    pub(super) fn new(
        stage: &Stage,
        slots: &mut [FrameSlot],
        (margin_px, lens, bodies): ([u32; 2], Option<OutsideLens>, bool),
        (color, radiance): (&Image, &Image),
    ) -> Result<Self> {
        let context = &stage.context;
        let wider = color.spec().size;
        let half = Image::new(context, "outside half color", ImageSpec::storage(wider, Format::Rgba16f))?;
        let spec = ImageSpec::storage(wider, Format::Rg32f);
        let inverse_depth = Image::new(context, "outside inverse depth", spec)?;
        prepare(&mut slots[0].gpu, [&half, &inverse_depth])?;
        let tables = match &lens {
            Some(lens) => tables(stage, &mut slots[0], lens, margin_px)?,
            None => Vec::new(),
        };
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let warp = |one_surface: bool| {
            let lens = lens.is_some();
            let kind = FastKind { one_surface, from_depth: true, bodies: bodies && !one_surface, lens };
            FastGather::new(context, size, (1, 1), 1, kind)
        };
        let warps = [warp(false)?, warp(true)?];
        let moved = slots.iter().map(|_| moved_buffer(context, bodies)).collect::<Result<Vec<_>>>()?;
        let numbers = slots.iter().map(|_| numbers_buffer(context)).collect::<Result<Vec<_>>>()?;
        let bind = |warp: &FastGather, moved: &Buffer, lens: Option<[&Image; 2]>| {
            warp.bind(&FastImages {
                color,
                filtered: &half,
                paths: Vec::new(),
                moved: Some(moved),
                inverse_depth: &inverse_depth,
                lens,
                radiance,
            })
        };
        let bind_all = |warp: &FastGather, moved: &Buffer| match tables.is_empty() {
            true => Ok(vec![bind(warp, moved, None)?]),
            false => tables.iter().map(|t| bind(warp, moved, Some(t.each_ref()))).collect(),
        };
        let both = |moved| Ok([bind_all(&warps[0], moved)?, bind_all(&warps[1], moved)?]);
        let bindings = moved.iter().map(both).collect::<Result<Vec<_>>>()?;
        let merge = (tables.len() > 1).then(|| Merge::new(stage, slots, radiance)).transpose()?;
        Ok(Self {
            lens,
            size,
            half,
            inverse_depth,
            _tables: tables,
            moved,
            numbers,
            bodies,
            warps,
            bindings,
            merge,
        })
    }

    /// Whether frames with this lens, and with bodies or without, are made by it.
    pub(super) fn fits(&self, lens: Option<&OutsideLens>, bodies: bool) -> bool {
        self.lens.as_ref() == lens && self.bodies == bodies
    }

    /// Says how the camera moves in a frame whose slot is not in flight.
    pub(super) fn write(&mut self, slot: usize, plan: &WarpPlan) {
        self.moved[slot].write(0, plan.rows.as_slice());
        if !plan.numbers.is_empty() {
            self.numbers[slot].write(0, plan.numbers.as_slice());
        }
    }

    pub(super) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        slot: usize,
        plan: &WarpPlan,
        (margin_px, max_samples): ([u32; 2], u32),
    ) {
        let turns = usize::from(plan.turns);
        let (warp, bindings) = (&self.warps[turns], &self.bindings[slot][turns]);
        let Some(merge) = &self.merge else {
            warp.record(recorder, &bindings[0], margin_px, &plan.timing, max_samples);
            return;
        };
        for channel in [0, 2, 1] {
            warp.record(recorder, &bindings[channel], margin_px, &plan.timing, max_samples);
            merge.record(recorder, self.size, channel as u32);
        }
    }
}

fn moved_buffer(context: &Arc<Context>, bodies: bool) -> Result<Buffer> {
    let count = if bodies { MAX_BODIES as u64 + 1 } else { 1 };
    Buffer::new(context, "outside moved", count * MOVED_BYTES, Usage::Texels, Location::Upload)
}

fn numbers_buffer(context: &Arc<Context>) -> Result<Buffer> {
    Buffer::new(context, "outside bodies", 8 * MAX_BODIES as u64, Usage::Storage, Location::Upload)
}

/// The lens's two tables by colour, on the device.
fn tables(
    stage: &Stage,
    slot: &mut FrameSlot,
    lens: &OutsideLens,
    margin_px: [u32; 2],
) -> Result<Vec<[Image; 2]>> {
    let context = &stage.context;
    let nominal = stage.intrinsics;
    let wider = nominal.with_margin(margin_px);
    let sizes = [[nominal.width, nominal.height], [wider.width, wider.height]];
    let rays = lens.rays()?;
    let mut made = Vec::new();
    for scale in lens.scales() {
        let mut upload = |values: &[[f32; 2]], size: [u32; 2]| {
            let image = Image::new(context, "outside lens", ImageSpec::storage(size, Format::Rg32f))?;
            let bytes = size_of_val(values) as u64;
            let mut staging = Buffer::new(context, "outside lens", bytes, Usage::Transfer, Location::Upload)?;
            staging.write(0, values);
            let mut recorder = slot.gpu.begin()?;
            recorder.prepare([&image]);
            recorder.copy_buffer_to_image(&staging, &image);
            recorder.barrier();
            recorder.finish();
            slot.gpu.submit()?;
            let done = slot.gpu.wait(std::time::Duration::from_secs(60));
            if done.is_err() {
                // Image and buffer are dropped now.
                slot.gpu.let_go();
            }
            done.map(|()| image)
        };
        let [ideal, sensed] = rays.tables(&wider, scale);
        made.push([upload(&ideal, sizes[0])?, upload(&sensed, sizes[1])?]);
    }
    Ok(made)
}
