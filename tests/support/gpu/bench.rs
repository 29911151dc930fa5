//! Runs one kernel on uploaded planes and reads back what it wrote.

use std::time::Duration;

use bytemuck::NoUninit;
use shutterbug::gpu::{
    Bound, Buffer, ComputePipeline, DeviceKind, Format, Image, ImageSpec, Location, Slot, Usage,
};
use shutterbug::kernels::Kernel;
use shutterbug::plane::Plane;

use super::{Watched, device};

const LIMIT: Duration = Duration::from_secs(60);

/// A device with one slot for single passes.
pub struct Bench {
    slot: Slot,
    pub watched: Watched,
}

impl Bench {
    pub fn new(test: &str) -> Option<Self> {
        let watched = device(test)?;
        Some(Self { slot: Slot::new(&watched.0, test).unwrap(), watched })
    }

    /// Whether results must agree bit for bit: lavapipe computes with the CPU's own IEEE operations. Others may divide
    /// and take roots in their own way.
    pub fn exact(&self) -> bool {
        self.watched.0.info().kind == DeviceKind::Cpu && self.watched.0.info().name.contains("llvmpipe")
    }

    /// An image of zeros, one layer for each of `layers`; an array where `array` says so.
    pub fn empty(&mut self, size: [usize; 2], format: Format, layers: u32, array: bool) -> Image {
        let size = size.map(|s| s as u32);
        let spec = ImageSpec { layers, array, ..ImageSpec::storage(size, format) };
        let image = Image::new(&self.watched.0, "test image", spec).unwrap();
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut recorder = unsafe { self.slot.begin_unchecked() }.unwrap();
        recorder.prepare([&image]);
        recorder.clear(&image);
        recorder.finish();
        self.finish();
        image
    }

    /// An image that holds these planes as its layers.
    pub fn upload(&mut self, layers: &[Plane<f32>], format: Format, array: bool) -> Image {
        let size = [layers[0].width, layers[0].height];
        let image = self.empty(size, format, layers.len() as u32, array);
        let values: Vec<f32> = layers.iter().flat_map(|p| p.data.iter().copied()).collect();
        let staging = self.filled(Usage::Transfer, &values);
        assert_eq!(staging.bytes(), (bytes(&image)).max(16), "the planes have the image's channels");
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut recorder = unsafe { self.slot.begin_unchecked() }.unwrap();
        recorder.copy_buffer_to_image(&staging, &image);
        recorder.barrier();
        recorder.finish();
        self.finish();
        image
    }

    /// A buffer that holds these values.
    pub fn filled<T: bytemuck::Pod>(&self, usage: Usage, values: &[T]) -> Buffer {
        let bytes = size_of_val(values) as u64;
        let mut buffer = Buffer::new(&self.watched.0, "test input", bytes, usage, Location::Upload).unwrap();
        buffer.write(0, values);
        buffer
    }

    /// A buffer that a kernel writes.
    pub fn buffer(&self, bytes: usize) -> Buffer {
        Buffer::new(&self.watched.0, "test output", bytes as u64, Usage::Storage, Location::Device).unwrap()
    }

    pub fn run<P: NoUninit>(
        &mut self,
        kernel: &'static Kernel,
        constants: &[u32],
        resources: &[(&str, Bound<'_>)],
        push: &P,
        size: [u32; 2],
    ) {
        let pipeline = ComputePipeline::specialized(&self.watched.0, kernel, constants).unwrap();
        let group = pipeline.bind(resources).unwrap();
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut recorder = unsafe { self.slot.begin_unchecked() }.unwrap();
        recorder.dispatch(&pipeline, &group, push, size);
        recorder.finish();
        self.finish();
    }

    /// The layers of an image.
    pub fn read(&mut self, image: &Image) -> Vec<Plane<f32>> {
        let spec = *image.spec();
        let to = self.readback(bytes(image));
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut recorder = unsafe { self.slot.begin_unchecked() }.unwrap();
        recorder.copy_image_to_buffer(image, [0, 0], spec.size, &to);
        recorder.barrier();
        recorder.finish();
        self.finish();
        let raw = &to.mapped()[..bytes(image) as usize];
        let values: Vec<f32> = match spec.format {
            Format::Rgba16f => raw.chunks_exact(2).map(|h| half(u16::from_le_bytes([h[0], h[1]]))).collect(),
            _ => bytemuck::pod_collect_to_vec(raw),
        };
        let [width, height] = spec.size.map(|s| s as usize);
        let channels = values.len() / (width * height * spec.layers as usize);
        let layer = |data: &[f32]| Plane { width, height, channels, data: data.to_vec() };
        values.chunks_exact(width * height * channels).map(layer).collect()
    }

    /// The first bytes of a buffer.
    pub fn read_buffer(&mut self, buffer: &Buffer, bytes: usize) -> Vec<u8> {
        let to = self.readback(bytes as u64);
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut recorder = unsafe { self.slot.begin_unchecked() }.unwrap();
        recorder.copy_buffer(buffer, &to, bytes as u64);
        recorder.barrier();
        recorder.finish();
        self.finish();
        to.mapped()[..bytes].to_vec()
    }

    fn readback(&self, bytes: u64) -> Buffer {
        Buffer::new(&self.watched.0, "test readback", bytes, Usage::Transfer, Location::Readback).unwrap()
    }

    fn finish(&mut self) {
        self.slot.submit().unwrap();
        self.slot.wait(LIMIT).unwrap();
    }
}

fn bytes(image: &Image) -> u64 {
    let spec = image.spec();
    let texels = u64::from(spec.size[0]) * u64::from(spec.size[1]) * u64::from(spec.layers);
    texels * spec.format.texel_bytes()
}

/// Half float to float (IEEE 754).
fn half(bits: u16) -> f32 {
    let (sign, exponent, mantissa) = (bits >> 15, (bits >> 10) & 31, f32::from(bits & 1023));
    let magnitude = match exponent {
        0 => mantissa * 2f32.powi(-24),
        31 if mantissa == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        e => (1.0 + mantissa / 1024.0) * 2f32.powi(i32::from(e) - 15),
    };
    if sign == 1 { -magnitude } else { magnitude }
}

/// Numbers without pattern, 0 to 1, of a fixed seed.
pub struct Scatter(pub u64);

impl Scatter {
    pub fn number(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.number()
    }
}

/// Pixels of which any channel differs in a bit, and those that differ by more than `tolerance` relative to the larger
/// of 1 and the value.
pub fn differing(got: &Plane<f32>, want: &Plane<f32>, tolerance: f32) -> (usize, usize) {
    assert_eq!((got.width, got.height, got.channels), (want.width, want.height, want.channels));
    let pairs = || got.data.chunks(got.channels).zip(want.data.chunks(got.channels));
    let bits = pairs().filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.to_bits() != b.to_bits()));
    let far = |a: f32, b: f32| a != b && !((a - b).abs() <= tolerance * b.abs().max(1.0));
    let outliers = pairs().filter(|(a, b)| a.iter().zip(*b).any(|(&a, &b)| far(a, b)));
    (bits.count(), outliers.count())
}
