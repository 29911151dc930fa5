//! Displacements for `--method fast` where only the camera moves: they follow from the picture's depth and the camera's
//! matrices, so no triangle is drawn for them.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::assert_push_layout;
use crate::camera::{Intrinsics, Trajectory};
use crate::engine::fast::pass::{FastBinding, FastGather, FastImages, FastKind, FastTiming, MOVED_BYTES};
use crate::engine::flight::Room;
use crate::error::Result;
use crate::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Context, Format, Image, ImageSpec, Location, Recorder,
    Sampler, Usage,
};
use crate::kernels::kernel;
use crate::raster::{RasterTarget, View, moved_rows};

/// What is nearer does not decide whether the camera only turns, m.
const NEAREST_M: f64 = 0.25;
/// Movement of what is so near that is not seen, px.
const MIN_MOTION_PX: f64 = 0.05;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct DepthPush {
    size: [u32; 2],
    depth_texels: u32,
}
assert_push_layout!("fast_depth.comp", DepthPush { size, depth_texels });
assert_push_layout!("fast_depth_ms.comp", DepthPush { size, depth_texels });

/// Kernels: of a camera that passes what it sees, and of one that only turns.
pub(super) struct DepthKernels {
    depth: ComputePipeline,
    sampler: Sampler,
    warps: [FastGather; 2],
    /// Texels a px of the depth, for either.
    scales: [u32; 2],
}

impl DepthKernels {
    /// A warp to `size` px along paths of 2 `path_images` knots; depth has `msaa` samples a texel.
    pub(super) fn new(
        context: &Arc<Context>,
        size: [u32; 2],
        (path_images, path_scale): (usize, u32),
        (color_scale, msaa): (u32, u32),
    ) -> Result<Self> {
        let multisampled = const { kernel("fast_depth_ms.comp") };
        let plain = const { kernel("fast_depth.comp") };
        let kernel = if msaa > 1 { multisampled } else { plain };
        let warp = |scale: u32, one_surface: bool| {
            let kind = FastKind { one_surface, from_depth: true, ..FastKind::default() };
            FastGather::new(context, size, (path_images, scale), color_scale, kind)
        };
        Ok(Self {
            depth: ComputePipeline::new(context, kernel)?,
            sampler: Sampler::new(context, false)?,
            warps: [warp(path_scale, false)?, warp(1, true)?],
            scales: [path_scale, 1],
        })
    }
}

/// Depth of what the picture shows, and what each frame in flight says of its knots.
pub(super) struct DepthPaths {
    moved: Vec<Buffer>,
    /// As the kernels' warps.
    warps: [Depth; 2],
}

struct Depth {
    group: BindGroup,
    /// By frame in flight.
    bindings: Vec<FastBinding>,
    inverse_depth: Image,
    depth_texels: u32,
}

impl DepthPaths {
    /// For a picture that is resolved to `color` (without and with an exposure).
    pub(super) fn new(
        kernels: &DepthKernels,
        room: &mut Room<'_>,
        picture: &RasterTarget,
        color: &[Image; 2],
    ) -> Result<Self> {
        let context = room.context;
        let moved = room
            .slots
            .iter()
            .map(|_| Buffer::new(context, "moved", MOVED_BYTES, Usage::Texels, Location::Upload))
            .collect::<Result<Vec<_>>>()?;
        let mut warp = |i: usize| -> Result<Depth> {
            let scale = kernels.scales[i];
            let spec = ImageSpec::storage(picture.size.map(|s| s * scale), Format::R32f);
            let inverse_depth = Image::new(context, "inverse depth", spec)?;
            room.prepare([&inverse_depth])?;
            let group = kernels.depth.bind(&[
                ("depth_samples", Bound::Sampled(picture.attachments.depth(), &kernels.sampler)),
                ("inverse_depth", Bound::Storage(&inverse_depth)),
            ])?;
            let bind = |moved: &Buffer| {
                kernels.warps[i].bind(&FastImages {
                    color: &color[0],
                    filtered: &color[1],
                    paths: Vec::new(),
                    moved: Some(moved),
                    inverse_depth: &inverse_depth,
                    lens: None,
                    radiance: room.radiance,
                })
            };
            let bindings = moved.iter().map(bind).collect::<Result<Vec<_>>>()?;
            Ok(Depth { group, bindings, inverse_depth, depth_texels: picture.plan.grid / scale })
        };
        let warps = [warp(0)?, warp(1)?];
        Ok(Self { moved, warps })
    }

    /// Depth of what the picture shows; `turns`: as [`turns_only`] says.
    pub(super) fn inverse_depth(&self, turns: bool) -> &Image {
        &self.warps[usize::from(turns)].inverse_depth
    }

    /// Says when the picture of a frame in flight is taken, and when the knots are.
    pub(super) fn write(&mut self, slot: usize, view: &View<'_>, reference_s: f64, knots_s: &[f64]) {
        self.moved[slot].write(0, &moved_rows(view, reference_s, knots_s));
    }

    /// Records depth and warp; `turns`: as [`turns_only`] says.
    pub(super) fn record(
        &self,
        kernels: &DepthKernels,
        recorder: &mut Recorder<'_>,
        (slot, turns): (usize, bool),
        margin_px: [u32; 2],
        (timing, max_samples): (&FastTiming, u32),
    ) {
        let (own, warp) = (&self.warps[usize::from(turns)], &kernels.warps[usize::from(turns)]);
        let size = own.inverse_depth.spec().size;
        let push = DepthPush { size, depth_texels: own.depth_texels };
        recorder.mark("motion");
        recorder.dispatch(&kernels.depth, &own.group, &push, size);
        warp.record(recorder, &own.bindings[slot], margin_px, timing, max_samples);
    }
}

/// Whether the camera only turns: nothing that it passes moves against what is behind it, as far as can be seen.
pub(crate) fn turns_only(k: &Intrinsics, path: &Trajectory, reference_s: f64, knots_s: &[f64]) -> bool {
    let at_m = |time_s: f64| path.pose_at(time_s).translation_m;
    let farthest_m = knots_s.iter().map(|&t| (at_m(t) - at_m(reference_s)).length()).fold(0.0, f64::max);
    farthest_m * k.fx.max(k.fy) < MIN_MOTION_PX * NEAREST_M
}
