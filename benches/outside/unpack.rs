//! What bringing a host's colours into linear RGBA costs: the kernel that is made for a format beside the one that
//! knows all of them, of the bench's size. Processor time of the process a picture, ms, least of the rounds.
#![allow(clippy::unwrap_used)]

use std::time::Duration;

use super::{FULL, processor_ms};
use shutterbug::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Context, ContextOptions, DeviceChoice, Format, Image,
    ImageSpec, Location, Slot, Usage, Validation,
};
use shutterbug::kernels::kernel;
use shutterbug::plane::PixelFormat;
use shutterbug::reference::unpack::{ColorPush, decode_table};

/// Pictures a measurement.
const TIMES: u32 = 8;

pub fn print(rounds: usize) {
    let device = DeviceChoice::from_option_or_environment(None);
    let context = Context::new(&ContextOptions { device, validation: Validation::Off }).unwrap();
    let mut slot = Slot::new(&context, "unpack").unwrap();
    let table = decode_table();
    let bytes = size_of_val(table.as_slice()) as u64;
    let mut decode = Buffer::new(&context, "decode", bytes, Usage::Texels, Location::Upload).unwrap();
    decode.write(0, &table);
    let size = FULL.map(|s| s as u32);
    let words = vec![0x3c3c_3c3c_u32; FULL[0] * FULL[1] * 4];
    let bytes = 4 * words.len() as u64;
    let mut source = Buffer::new(&context, "source", bytes, Usage::Storage, Location::Upload).unwrap();
    source.write(0, &words);
    println!(
        "unpacking a colour picture of {}x{} px, ms: kernel of its format, of all formats",
        size[0], size[1]
    );
    for (file, to) in [
        (const { kernel("unpack_color.comp") }, Format::Rgba32f),
        (const { kernel("unpack_color_half.comp") }, Format::Rgba16f),
    ] {
        let image = Image::new(&context, "color", ImageSpec::storage(size, to)).unwrap();
        // SAFETY: `done` waits for it before anything goes; nothing else uses the image.
        let mut recorder = unsafe { slot.begin_unchecked() }.unwrap();
        recorder.prepare([&image]);
        recorder.finish();
        done(&mut slot);
        for format in [
            PixelFormat::Rgb8,
            PixelFormat::Rgba8,
            PixelFormat::Bgra8,
            PixelFormat::Rgba16f,
            PixelFormat::Rgba32f,
        ] {
            let stride_bytes = (size[0] as usize * format.bytes()).next_multiple_of(4) as u32;
            let push = ColorPush { size, first_byte: 0, stride_bytes, format: format as u32, codes_from: 0 };
            let mut kernels = [format as u32, 0].map(|made_for| {
                let pipeline = ComputePipeline::specialized(&context, file, &[made_for]).unwrap();
                let group = pipeline.bind(&[
                    ("Source", Bound::Buffer(&source)),
                    ("decode", Bound::Buffer(&decode)),
                    ("color", Bound::Storage(&image)),
                ]);
                (pipeline, group.unwrap(), f64::INFINITY)
            });
            for _ in 0..rounds + 1 {
                for (pipeline, group, least) in &mut kernels {
                    *least = least.min(measured(&mut slot, (pipeline, group), &push));
                }
            }
            println!("{format:>8?} to {to:?}: {:5.2}, {:5.2}", kernels[0].2, kernels[1].2);
        }
    }
}

fn measured(slot: &mut Slot, (pipeline, group): (&ComputePipeline, &BindGroup), push: &ColorPush) -> f64 {
    // SAFETY: `done` waits for it while all that it binds lives; the push constants are those of the pipeline and its
    // picture.
    let mut recorder = unsafe { slot.begin_unchecked() }.unwrap();
    for _ in 0..TIMES {
        recorder.dispatch(pipeline, group, push, push.size);
    }
    recorder.finish();
    let before = processor_ms();
    done(slot);
    (processor_ms() - before) / f64::from(TIMES)
}

fn done(slot: &mut Slot) {
    slot.submit().unwrap();
    slot.wait(Duration::from_secs(60)).unwrap();
}
