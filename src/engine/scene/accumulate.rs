//! Adds one picture to the lines whose exposure covers its instant, with its weight. Twin: `reference/accumulate.rs`.

use bytemuck::{Pod, Zeroable};

use crate::assert_push_layout;
use crate::camera::ScanOrder;
use crate::engine::scene::Stage;
use crate::engine::scene::resolve::resolve_constants;
use crate::engine::slots::FrameSlot;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, ComputePipeline, Image, Recorder, Sampler};
use crate::kernels::kernel;
use crate::raster::RasterTarget;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct AccumulatePush {
    pub(crate) origin: [u32; 2],
    pub(crate) size: [u32; 2],
    pub(crate) picture: [u32; 2],
    pub(crate) grid: [i32; 2],
    pub(crate) scan_order: u32,
    pub(crate) first_line: u32,
    pub(crate) first_weight: u32,
}
assert_push_layout!(
    "accumulate_ms.comp",
    AccumulatePush { origin, size, picture, grid, scan_order, first_line, first_weight }
);

/// The pass that adds one render to the radiance.
pub(crate) struct Accumulate {
    kernel: ComputePipeline,
    sampler: Sampler,
}

impl Accumulate {
    pub(crate) fn new(stage: &Stage) -> Result<Self> {
        let multisampled = const { kernel("accumulate_ms.comp") };
        let plain = const { kernel("accumulate.comp") };
        let kernel = if stage.plan.msaa > 1 { multisampled } else { plain };
        let kernel = ComputePipeline::specialized(&stage.context, kernel, &resolve_constants(stage.plan))?;
        Ok(Self { kernel, sampler: Sampler::new(&stage.context, false)? })
    }

    /// Binds the colour of a target, the sum, and the weights of a slot.
    pub(crate) fn bind(&self, target: &RasterTarget, sum: &Image, slot: &FrameSlot) -> Result<BindGroup> {
        self.kernel.bind(&[
            ("color_samples", Bound::Sampled(&target.attachments.colors()[0], &self.sampler)),
            ("radiance", Bound::Storage(sum)),
            ("Weights", Bound::Buffer(&slot.inputs.weights)),
        ])
    }

    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, group: &BindGroup, push: &AccumulatePush) {
        recorder.dispatch(&self.kernel, group, push, push.size);
    }
}

/// Lines that see an instant, in scan order, and where their weights stand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightedLines {
    pub(crate) first_line: u32,
    pub(crate) line_count: u32,
    pub(crate) first_weight: u32,
}

impl WeightedLines {
    /// The rectangle of the lines, and the kernel's push constants for it.
    pub(crate) fn push(&self, scan_order: ScanOrder, picture: [u32; 2], grid: u32) -> AccumulatePush {
        let axis = usize::from(scan_order.lines_are_rows());
        let reversed = matches!(scan_order, ScanOrder::BottomToTop | ScanOrder::RightToLeft);
        let (mut origin, mut size) = ([0, 0], picture);
        origin[axis] = match reversed {
            true => picture[axis] - self.first_line - self.line_count,
            false => self.first_line,
        };
        size[axis] = self.line_count;
        AccumulatePush {
            origin,
            size,
            picture,
            grid: [grid as i32; 2],
            scan_order: scan_order as u32,
            first_line: self.first_line,
            first_weight: self.first_weight,
        }
    }
}
