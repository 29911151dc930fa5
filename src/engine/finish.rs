//! Radiance to the delivered picture in host memory: the last pass of every method.

use std::collections::BTreeMap;

use super::Stage;
use super::frame::FrameRequest;
use super::slots::FrameSlot;
use crate::assert_push_layout;
use crate::chain::rng::seed_words;
use crate::effects::PaperNoise;
use crate::error::Result;
use crate::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Format, Image, ImageSpec, Location, Recorder, Slot, Usage,
};
use crate::kernels::kernel;
use crate::reference::develop::Push as DevelopPush;

assert_push_layout!(
    "develop.comp",
    DevelopPush { size, seed, frame, flags, padding, static_sigma, color_sigma, edge_sigma }
);

/// The radiance image and the kernel that develops it.
pub(super) struct Finish {
    /// By the parts of the noise that are on: what is off is compiled out.
    develop: BTreeMap<u32, (ComputePipeline, BindGroup)>,
    pixels: Buffer,
    radiance: Image,
}

impl Finish {
    pub(super) fn new(stage: &Stage, slots: &mut [FrameSlot]) -> Result<Self> {
        let size = [stage.intrinsics.width, stage.intrinsics.height];
        let context = &stage.context;
        let radiance = Image::new(context, "radiance", ImageSpec::storage(size, Format::Rgba32f))?;
        let bytes = u64::from(size[0]) * u64::from(size[1]) * 4;
        let pixels = Buffer::new(context, "pixels", bytes, Usage::Storage, Location::Device)?;
        let first = slots.first_mut().expect("at least one slot");
        prepare(&mut first.gpu, [&radiance])?;
        Ok(Self { develop: BTreeMap::new(), pixels, radiance })
    }

    /// Where the methods write.
    pub(super) fn radiance(&self) -> &Image {
        &self.radiance
    }

    /// Makes the kernel for the noise that a frame has; steady after the first frame of a kind.
    pub(super) fn fit(&mut self, stage: &Stage, request: &FrameRequest) -> Result<()> {
        let parts = PaperNoise::sigma(&request.settings).parts();
        if self.develop.contains_key(&parts) {
            return Ok(());
        }
        let kernel = const { kernel("develop.comp") };
        let develop = ComputePipeline::specialized(&stage.context, kernel, &[parts])?;
        let group = develop
            .bind(&[("radiance", Bound::Storage(&self.radiance)), ("Pixels", Bound::Buffer(&self.pixels))])?;
        self.develop.insert(parts, (develop, group));
        Ok(())
    }

    /// Records noise, encoding and readback.
    pub(super) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        request: &FrameRequest,
        readback: (&Buffer, &Buffer),
    ) {
        let size = self.radiance.spec().size;
        let (picture, radiance) = readback;
        let sigma = PaperNoise::sigma(&request.settings);
        let push = DevelopPush {
            size,
            seed: seed_words(request.seed),
            frame: request.index,
            flags: 0,
            padding: [0; 2],
            static_sigma: sigma.static_sigma,
            color_sigma: sigma.color_sigma,
            edge_sigma: sigma.edge_sigma,
        };
        recorder.mark("develop");
        let (develop, group) = &self.develop[&sigma.parts()];
        recorder.dispatch(develop, group, &push, size);
        recorder.mark("readback");
        recorder.copy_buffer(&self.pixels, picture, self.pixels.bytes());
        if request.statistics {
            recorder.copy_image_to_buffer(&self.radiance, [0, 0], size, radiance);
        }
        recorder.barrier();
    }
}

/// Brings new images into their layout, at once.
pub(super) fn prepare<'i>(slot: &mut Slot, images: impl IntoIterator<Item = &'i Image>) -> Result<()> {
    let mut recorder = slot.begin()?;
    recorder.prepare(images);
    recorder.finish();
    slot.submit()?;
    slot.wait(std::time::Duration::from_secs(60))
}
