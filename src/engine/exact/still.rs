//! Frames of `--method exact` without exposure time: each pixel is the mean of its samples.

use bytemuck::{Pod, Zeroable};

use super::Input;
use crate::assert_push_layout;
use crate::engine::flight::Room;
use crate::engine::scene::Stage;
use crate::engine::scene::resolve::resolve_constants;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, ComputePipeline, Recorder, Sampler};
use crate::kernels::kernel;
use crate::raster::{RasterKind, RasterTarget};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct StillPush {
    size: [u32; 2],
    margin_px: [i32; 2],
    grid: [i32; 2],
}
assert_push_layout!("exact_still_ms.comp", StillPush { size, margin_px, grid });

/// Images and kernel.
pub(super) struct Still {
    pub(super) inputs: Vec<Input>,
    group: BindGroup,
    kernel: ComputePipeline,
    pub(super) target: RasterTarget,
    _sampler: Sampler,
}

impl Still {
    pub(super) fn new(stage: &Stage, room: &mut Room<'_>, group_count: usize) -> Result<Self> {
        let context = &stage.context;
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let target = RasterTarget::new(context, &stage.buffers, RasterKind::Exact, size, stage.plan)?;
        room.prepare(target.attachments.images())?;
        let multisampled = const { kernel("exact_still_ms.comp") };
        let plain = const { kernel("exact_still.comp") };
        let kernel = if stage.plan.msaa > 1 { multisampled } else { plain };
        let kernel = ComputePipeline::specialized(context, kernel, &resolve_constants(stage.plan))?;
        let sampler = Sampler::new(context, false)?;
        let group = kernel.bind(&[
            ("color_samples", Bound::Sampled(&target.attachments.colors()[0], &sampler)),
            ("radiance", Bound::Storage(room.radiance)),
        ])?;
        let inputs =
            room.slots.iter().map(|_| Input::new(stage, &target, group_count)).collect::<Result<_>>()?;
        Ok(Self { inputs, group, kernel, target, _sampler: sampler })
    }

    pub(super) fn record(&self, stage: &Stage, recorder: &mut Recorder<'_>) {
        let size = self.target.size;
        let push = StillPush { size, margin_px: [0; 2], grid: [stage.plan.grid as i32; 2] };
        recorder.mark("resolve");
        recorder.dispatch(&self.kernel, &self.group, &push, size);
    }
}
