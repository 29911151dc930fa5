//! Frames from outside of several pictures: the mean of what each picture shows of a pixel, by how near it is in time, whether it
//! saw the place at all, and how sharply it is read there. Twin: `reference/outside_blend.rs`.

use super::Stage;
use super::finish::prepare;
use super::slots::FrameSlot;
use crate::assert_push_layout;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, ComputePipeline, Format, Image, ImageSpec, Recorder};
use crate::kernels::kernel;
use crate::reference::outside_blend::Push;

assert_push_layout!("outside_blend.comp", Push { size, place });

/// Sums pictures up.
pub(super) struct Blend {
    kernel: ComputePipeline,
    group: BindGroup,
    /// What one picture shows.
    pub(super) warped: Image,
    size: [u32; 2],
}

impl Blend {
    /// Into that image; nothing may be in flight.
    pub(super) fn new(stage: &Stage, slots: &mut [FrameSlot], radiance: &Image) -> Result<Self> {
        let size = radiance.spec().size;
        let spec = ImageSpec::storage(size, Format::Rgba32f);
        let warped = Image::new(&stage.context, "outside warped", spec)?;
        prepare(&mut slots[0].gpu, [&warped])?;
        let kernel = ComputePipeline::new(&stage.context, const { kernel("outside_blend.comp") })?;
        let bound = [("warped", Bound::Storage(&warped)), ("radiance", Bound::Storage(radiance))];
        let group = kernel.bind(&bound)?;
        Ok(Self { kernel, group, warped, size })
    }

    /// Adds picture `k` of `count`.
    pub(super) fn record(&self, recorder: &mut Recorder<'_>, k: usize, count: usize) {
        recorder.mark("outside_blend");
        let place = u32::from(k == 0) | u32::from(k + 1 == count) << 1;
        recorder.dispatch(&self.kernel, &self.group, &Push { size: self.size, place }, self.size);
    }
}
