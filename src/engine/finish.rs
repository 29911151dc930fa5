//! Radiance to the delivered picture in host memory: the last pass of every method.

use bytemuck::{Pod, Zeroable};

use super::Stage;
use super::frame::FrameRequest;
use super::slots::FrameSlot;
use crate::assert_push_layout;
use crate::effects::PaperNoise;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, Buffer, ComputePipeline, Format, Image, ImageSpec, Location, Recorder, Slot, Usage};
use crate::kernels::kernel;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct DevelopPush {
    size: [u32; 2],
    seed: [u32; 2],
    frame: u32,
    flags: u32,
    padding: [u32; 2],
    static_sigma: [f32; 4],
    color_sigma: [f32; 4],
    edge_sigma: [f32; 4],
}
assert_push_layout!("develop.comp", DevelopPush {
    size, seed, frame, flags, padding, static_sigma, color_sigma, edge_sigma
});

/// The radiance image and the kernel that develops it.
pub(super) struct Finish {
    develop: ComputePipeline,
    group: BindGroup,
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
        let develop = ComputePipeline::new(context, const { kernel("develop.comp") })?;
        let group = develop.bind(&[("radiance", Bound::Storage(&radiance)), ("Pixels", Bound::Buffer(&pixels))])?;
        let first = slots.first_mut().expect("at least one slot");
        prepare(&mut first.gpu, [&radiance])?;
        Ok(Self { develop, group, pixels, radiance })
    }

    /// Where the methods write.
    pub(super) fn radiance(&self) -> &Image {
        &self.radiance
    }

    /// Records noise, encoding and readback.
    pub(super) fn record(&self, recorder: &mut Recorder<'_>, request: &FrameRequest, readback: (&Buffer, &Buffer)) {
        let size = self.radiance.spec().size;
        let (picture, radiance) = readback;
        let sigma = PaperNoise::sigma(&request.settings);
        let push = DevelopPush {
            size,
            seed: [request.seed as u32, (request.seed >> 32) as u32],
            frame: request.index,
            flags: 0,
            padding: [0; 2],
            static_sigma: sigma.static_sigma,
            color_sigma: sigma.color_sigma,
            edge_sigma: sigma.edge_sigma,
        };
        recorder.mark("develop");
        recorder.dispatch(&self.develop, &self.group, &push, size);
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
