//! From the samples of a target to one value a pixel: colour, or motion and depth of the nearest sample. Twin:
//! `reference/resolve.rs`.

use bytemuck::{Pod, Zeroable};

use crate::assert_push_layout;
use crate::camera::NEAR_M;
use crate::engine::scene::Stage;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, ComputePipeline, Image, Recorder, Sampler};
use crate::kernels::kernel;
use crate::raster::{RasterTarget, SamplePlan};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct ResolveColorPush {
    pub(crate) size: [u32; 2],
    pub(crate) grid: [i32; 2],
}
assert_push_layout!("resolve_color_ms.comp", ResolveColorPush { size, grid });

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct ResolveMotionPush {
    pub(crate) size: [u32; 2],
    pub(crate) grid: [i32; 2],
    pub(crate) layer: u32,
    pub(crate) near_m: f32,
}
assert_push_layout!("resolve_motion_ms.comp", ResolveMotionPush { size, grid, layer, near_m });

/// Specialization constants of the kernels that include `resolve.glsl`.
pub(crate) fn resolve_constants(plan: SamplePlan) -> [u32; 14] {
    let mut constants = [0; 14];
    (constants[12], constants[13]) = (plan.grid, plan.msaa);
    constants
}

/// Resolves motion and depth of a target's nearest samples.
pub(crate) struct ResolveMotion {
    kernel: ComputePipeline,
    sampler: Sampler,
}

impl ResolveMotion {
    pub(crate) fn new(stage: &Stage, plan: SamplePlan) -> Result<Self> {
        let multisampled = const { kernel("resolve_motion_ms.comp") };
        let plain = const { kernel("resolve_motion.comp") };
        let kernel = if plan.msaa > 1 { multisampled } else { plain };
        let kernel = ComputePipeline::specialized(&stage.context, kernel, &resolve_constants(plan))?;
        Ok(Self { kernel, sampler: Sampler::new(&stage.context, false)? })
    }

    pub(crate) fn bind(&self, target: &RasterTarget, motion: &Image, depth: &Image) -> Result<BindGroup> {
        let samples = target.attachments.colors().last().expect("a target has a colour image");
        self.kernel.bind(&[
            ("motion_samples", Bound::Sampled(samples, &self.sampler)),
            ("depth_samples", Bound::Sampled(target.attachments.depth(), &self.sampler)),
            ("motion", Bound::Storage(motion)),
            ("depth", Bound::Storage(depth)),
        ])
    }

    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        group: &BindGroup,
        target: &RasterTarget,
        layer: u32,
    ) {
        let push = ResolveMotionPush {
            size: target.size,
            grid: [target.plan.grid as i32; 2],
            layer,
            near_m: NEAR_M as f32,
        };
        recorder.dispatch(&self.kernel, group, &push, target.size);
    }
}
