//! The validation layer watches: planted faults are reported. Without this, its silence in the other tests would mean
//! nothing.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;
use std::time::Duration;

use crate::gpu_support::{Turn, device};
use shutterbug::gpu::{
    Bound, Buffer, ComputePipeline, Context, ContextOptions, DeviceChoice, Format, Image, ImageSpec,
    Location, Sampler, Slot, Usage, Validation,
};
use shutterbug::kernels::kernel;

/// A device whose messages do not fail the test.
fn unwatched(test: &str) -> Option<Arc<Context>> {
    device(test)?;
    let device = DeviceChoice::from_option_or_environment(None);
    Some(Context::new(&ContextOptions { device, validation: Validation::Required }).unwrap())
}

fn storage(context: &Arc<Context>, format: Format) -> Image {
    Image::new(context, "image", ImageSpec::storage([8, 8], format)).unwrap()
}

#[test]
fn a_wrong_usage_is_reported() {
    let _turn = Turn::take();
    let Some(context) = unwatched("a_wrong_usage_is_reported") else { return };
    let kernel = ComputePipeline::new(&context, const { kernel("accumulate.comp") }).unwrap();
    let (color, radiance) = (storage(&context, Format::Rgba16f), storage(&context, Format::Rgba32f));
    let sampler = Sampler::new(&context, false).unwrap();
    // A buffer, because a newer lavapipe ends the program where an image is bound to what it was not made for.
    let bind = |usage: Usage| {
        let weights = Buffer::new(&context, "weights", 256, usage, Location::Upload).unwrap();
        let resources = [
            ("color_samples", Bound::Sampled(&color, &sampler)),
            ("radiance", Bound::Storage(&radiance)),
            ("Weights", Bound::Buffer(&weights)),
        ];
        drop(kernel.bind(&resources).unwrap());
    };
    bind(Usage::Storage);
    assert!(context.validation_messages().is_empty(), "control: {:?}", context.validation_messages());
    bind(Usage::Transfer);
    let messages = context.validation_messages();
    assert!(messages.iter().any(|m| m.contains("VUID-VkWriteDescriptorSet")), "{messages:?}");
}

#[test]
fn a_missing_barrier_is_reported() {
    let _turn = Turn::take();
    let Some(context) = unwatched("a_missing_barrier_is_reported") else { return };
    let image = storage(&context, Format::R32f);
    let staging = Buffer::new(&context, "staging", 256, Usage::Transfer, Location::Upload).unwrap();
    let mut slot = Slot::new(&context, "planted").unwrap();
    let mut record = |at_once: bool| {
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut recorder = unsafe { slot.begin_unchecked() }.unwrap();
        recorder.prepare([&image]);
        recorder.copy_buffer_to_image(&staging, &image);
        if !at_once {
            recorder.finish();
            slot.submit().unwrap();
            slot.wait(Duration::from_secs(60)).unwrap();
            #[allow(unsafe_code)]
            {
                // SAFETY: as above.
                recorder = unsafe { slot.begin_unchecked() }.unwrap();
            }
        }
        // `prepare` waits for no earlier write: it is for images that nothing has used.
        recorder.prepare([&image]);
        recorder.finish();
        slot.submit().unwrap();
        slot.wait(Duration::from_secs(60)).unwrap();
    };
    record(false);
    assert!(context.validation_messages().is_empty(), "control: {:?}", context.validation_messages());
    record(true);
    let messages = context.validation_messages();
    // The debug name says which image.
    let named = |m: &String| m.contains("SYNC-HAZARD-WRITE") && m.contains("name = image");
    assert!(messages.iter().any(named), "{messages:?}");
}
