//! The paper's gather for speed (`paper_fast_*.comp`), and where the pixel chain behind it acts on single pixels alone,
//! gather and chain in one kernel. Twin: `reference/paper_fast.rs`.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::assert_push_layout;
use crate::chain::rng::seed_words;
use crate::engine::finish::Finish;
use crate::engine::paper::kernels::GatherKernel;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, ComputePipeline, Context, Image, Recorder, Sampler};
use crate::kernels::POINTWISE;
use crate::reference::paper_gather::Push as GatherPush;

/// Places of the specialization constants of `paper_fast.glsl`; effects have those below.
const TAPS_PER_PX: usize = 40;
const UNROLL: usize = 41;
const DEVELOP: usize = 42;
const MOTION_COUNT: usize = 44;
const _: () = assert!(POINTWISE.len() < TAPS_PER_PX, "effects and gather have constants of their own");

/// Push constants of `paper_fast`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct FastPush {
    size: [u32; 2],
    margin_px: [i32; 2],
    start_s: f32,
    readout_time_s: f32,
    exposure_time_s: f32,
    frame_interval_s: f32,
    first_motion_s: f32,
    motion_step_s: f32,
    motion_count: u32,
    scan_order: u32,
    max_samples: u32,
    pixel_time: u32,
    seed: [u32; 2],
    frame: u32,
    flags: u32,
    slot: u32,
}
assert_push_layout!(
    "paper_fast_sampler.comp",
    FastPush {
        size,
        margin_px,
        start_s,
        readout_time_s,
        exposure_time_s,
        frame_interval_s,
        first_motion_s,
        motion_step_s,
        motion_count,
        scan_order,
        max_samples,
        pixel_time,
        seed,
        frame,
        flags,
        slot
    }
);

impl FastPush {
    fn new(g: &GatherPush, frame: u32, seed: u64) -> Self {
        Self {
            size: g.size,
            margin_px: g.margin_px,
            start_s: g.start_s,
            readout_time_s: g.readout_time_s,
            exposure_time_s: g.exposure_time_s,
            frame_interval_s: g.frame_interval_s,
            first_motion_s: g.first_motion_s,
            motion_step_s: g.motion_step_s,
            motion_count: g.motion_count,
            scan_order: g.scan_order,
            max_samples: g.max_samples,
            pixel_time: g.pixel_time,
            seed: seed_words(seed),
            frame,
            flags: 0,
            slot: 0,
        }
    }

    /// Shutter and blur over one second, two motion images at its ends.
    pub(super) fn trial(size: [u32; 2], margin: u32) -> Self {
        let gather = GatherPush {
            size,
            margin_px: [margin as i32; 2],
            start_s: -0.5,
            readout_time_s: 1.0,
            exposure_time_s: 1.0,
            frame_interval_s: 1.0,
            first_motion_s: -0.5,
            motion_step_s: 1.0,
            motion_count: 2,
            scan_order: 0,
            max_samples: 240,
            pixel_time: 0,
        };
        Self::new(&gather, 0, 0)
    }
}

/// Specialization constants for this number of motion images. `effects`: variants of the pixel chain, if it runs in the
/// same kernel.
pub(super) fn constants(kernel: &GatherKernel, motion_count: u32, effects: Option<&[u32]>) -> Vec<u32> {
    let mut constants = vec![0; MOTION_COUNT + 1];
    if let Some(variants) = effects {
        constants[1..=variants.len()].copy_from_slice(variants);
        constants[DEVELOP] = 1;
    }
    constants[TAPS_PER_PX] = kernel.taps_per_px.to_bits();
    constants[UNROLL] = kernel.unroll;
    constants[MOTION_COUNT] = motion_count;
    constants
}

/// Pipelines by number of motion images and by the pixel chain that they run too.
type Key = (u32, Option<Vec<u32>>);

/// The pass.
pub(super) struct PaperFast {
    made: BTreeMap<Key, (ComputePipeline, Vec<BindGroup>)>,
    sampler: Sampler,
    kernel: GatherKernel,
    context: Arc<Context>,
}

impl PaperFast {
    pub(super) fn new(context: &Arc<Context>, kernel: GatherKernel) -> Result<Self> {
        let sampler =
            if kernel.linear { Sampler::in_texels(context)? } else { Sampler::new(context, false)? };
        Ok(Self { made: BTreeMap::new(), sampler, kernel, context: context.clone() })
    }

    /// Drops the bindings, because their images are replaced.
    pub(super) fn forget(&mut self) {
        self.made.clear();
    }

    /// Makes what a frame needs, if it is not there: steady after the first frame of a kind. Returns what to record;
    /// with `fuse` and a chain that allows it, that is everything up to the pixels.
    pub(super) fn fit(
        &mut self,
        [color, motion]: [&Image; 2],
        finish: &Finish,
        motion_count: u32,
        fuse: bool,
    ) -> Result<Fitted> {
        let effects = finish.sole_pointwise().filter(|_| fuse).map(<[u32]>::to_vec);
        let key = (motion_count, effects);
        if !self.made.contains_key(&key) {
            let constants = constants(&self.kernel, motion_count, key.1.as_deref());
            let pipeline = ComputePipeline::specialized(&self.context, self.kernel.shader, &constants)?;
            let radiance = finish.radiance();
            let own = [
                ("color", Bound::Sampled(color, &self.sampler)),
                ("motion", Bound::Storage(motion)),
                ("radiance", Bound::Storage(radiance)),
                ("source", Bound::Storage(radiance)),
                ("original", Bound::Storage(radiance)),
                ("target", Bound::Storage(radiance)),
            ];
            let bind = |index| pipeline.bind(&[&own[..], &finish.chain_buffers(index)[..]].concat());
            let groups = (0..finish.slot_count()).map(bind).collect::<Result<Vec<_>>>()?;
            self.made.insert(key.clone(), (pipeline, groups));
        }
        Ok(Fitted { key })
    }

    pub(super) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        fitted: &Fitted,
        index: usize,
        push: &GatherPush,
        (frame, seed): (u32, u64),
    ) {
        let (pipeline, groups) = &self.made[&fitted.key];
        recorder.dispatch(pipeline, &groups[index], &FastPush::new(push, frame, seed), push.size);
    }
}

/// What [`PaperFast::record`] runs.
pub(super) struct Fitted {
    key: Key,
}

impl Fitted {
    /// Whether the pixel chain is run too.
    pub(super) fn develops(&self) -> bool {
        self.key.1.is_some()
    }
}
