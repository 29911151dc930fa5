//! The chain on the device: kernels of the project on uploaded inputs.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytemuck::{Pod, Zeroable};
use shutterbug::gpu::{
    BindGroup, Bound, Buffer, ComputePipeline, Context, Format, Image, ImageSpec, Location, Sampler, Slot,
    Usage,
};
use shutterbug::kernels::{POINTWISE, TABLE};
use shutterbug::plane::Plane;
use shutterbug::reference::paper_gather::Push;

use super::input::{Input, SIGMA};
use crate::peer_kernels;

const LIMIT: Duration = Duration::from_secs(120);
/// Words of a slot of parameters.
const SLOT_WORDS: usize = 16;

/// A kernel with its constants.
#[derive(Clone, Copy)]
pub struct Variant {
    pub name: &'static str,
    pub file: &'static str,
    pub taps_per_px: f32,
    pub unroll: u32,
    pub fixed: bool,
    /// Colour of 8 bits a channel, as the peers have it, instead of half floats.
    pub eight_bits: bool,
    /// What is made of the colour first, and read instead; its time counts.
    pub level: Level,
}

/// What a trial reads instead of the picture.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// The picture itself.
    None,
    /// Half its size.
    Half,
    /// Sums along its rows.
    Sums,
}

/// Push constants of `paper_fast`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct FastPush {
    gather: Push,
    seed: [u32; 2],
    frame: u32,
    flags: u32,
    slot: u32,
    unused: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PointwisePush {
    size: [u32; 2],
    seed: [u32; 2],
    frame: u32,
    flags: u32,
    slot: u32,
    unused: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ResolvePush {
    size: [u32; 2],
    grid: [i32; 2],
}

pub struct Device {
    pub context: Arc<Context>,
    slot: Slot,
    linear: Sampler,
    nearest: Sampler,
    color: Image,
    color8: Image,
    color32: Image,
    half: Image,
    sums: Image,
    pub motions: Vec<Image>,
    radiance: Image,
    pixels: Buffer,
    parameters: Buffer,
    tables: Buffer,
    readback: Buffer,
    size: [u32; 2],
}

impl Device {
    pub fn new(context: &Arc<Context>, input: &Input) -> Self {
        let mut slot = Slot::new(context, "chain").unwrap();
        let size = input.size.map(|s| s as u32);
        let count = u64::from(size[0] * size[1]);
        let motions = (0..input.motions.len())
            .map(|k| upload(context, &mut slot, &input.motion_planes(k), Format::Rg32f));
        let motions: Vec<Image> = motions.collect();
        let color = input.color_plane();
        let color32 = upload(context, &mut slot, std::slice::from_ref(&color), Format::Rgba32f);
        let color8 =
            Image::new(context, "input", ImageSpec::storage(input.outer().map(|s| s as u32), Format::Rgba8))
                .unwrap();
        staged(context, &mut slot, &color8, &input.color);
        let color16 = upload_half(context, &mut slot, &color);
        let radiance = Image::new(context, "radiance", ImageSpec::storage(size, Format::Rgba32f)).unwrap();
        let outer = input.outer().map(|s| s as u32);
        let level = |size, format| Image::new(context, "level", ImageSpec::storage(size, format)).unwrap();
        let (half, sums) =
            (level(outer.map(|s| s.div_ceil(2)), Format::Rgba8), level(outer, Format::Rgba32f));
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut recorder = unsafe { slot.begin_unchecked() }.unwrap();
        recorder.prepare([&radiance, &half, &sums]);
        recorder.finish();
        slot.submit().unwrap();
        slot.wait(LIMIT).unwrap();
        let mut parameters =
            Buffer::new(context, "parameters", 4096, Usage::Uniform, Location::Upload).unwrap();
        let place = POINTWISE.iter().position(|s| *s == "paper_noise").unwrap();
        let mut words = vec![0f32; 1024];
        // The white part: three sigmas, after those of the static part.
        words[SLOT_WORDS * place + 3..SLOT_WORDS * place + 6].fill(SIGMA);
        parameters.write(0, &words);
        let tables = Buffer::new(context, "tables", 4096, Usage::Texels, Location::Upload).unwrap();
        Self {
            linear: Sampler::in_texels(context).unwrap(),
            nearest: Sampler::new(context, false).unwrap(),
            color: color16,
            color8,
            color32,
            half,
            sums,
            motions,
            radiance,
            pixels: Buffer::new(context, "pixels", 4 * count, Usage::Storage, Location::Device).unwrap(),
            parameters,
            tables,
            readback: Buffer::new(context, "readback", 4 * count, Usage::Transfer, Location::Readback)
                .unwrap(),
            size,
            slot,
            context: context.clone(),
        }
    }

    fn constants(variant: &Variant, noise: bool) -> Vec<u32> {
        let mut constants = vec![0u32; 45];
        let place = POINTWISE.iter().position(|s| *s == "paper_noise").unwrap();
        // Part 2 of the effect: white noise.
        constants[1 + place] = if noise { 2 } else { 0 };
        constants[40] = variant.taps_per_px.to_bits();
        constants[41] = variant.unroll;
        constants[42] = 1;
        constants[43] = variant.fixed.into();
        constants[44] = 2;
        constants
    }

    fn bind(&self, pipeline: &ComputePipeline, motion: usize, eight_bits: bool, level: Level) -> BindGroup {
        let color = match level {
            Level::None if eight_bits => &self.color8,
            Level::None => &self.color,
            Level::Half => &self.half,
            Level::Sums => &self.sums,
        };
        let sampler = if pipeline_is_linear(pipeline) { &self.linear } else { &self.nearest };
        let all = [
            ("color", Bound::Sampled(color, sampler)),
            ("motion", Bound::Storage(&self.motions[motion])),
            ("radiance", Bound::Storage(&self.radiance)),
            ("source", Bound::Storage(&self.radiance)),
            ("original", Bound::Storage(&self.radiance)),
            ("target", Bound::Storage(&self.radiance)),
            ("Parameters", Bound::Buffer(&self.parameters)),
            ("tables", Bound::Buffer(&self.tables)),
            ("Pixels", Bound::Buffer(&self.pixels)),
        ];
        pipeline.bind(&all).unwrap()
    }

    /// Host times of `repeats` runs of the fused chain, ms, and its picture (RGBX) without noise.
    pub fn fused(
        &mut self,
        variant: &Variant,
        motion: usize,
        push: Push,
        repeats: usize,
    ) -> (Vec<f64>, Vec<u8>) {
        let kernel = find(variant.file);
        let level = self.level(variant.level);
        let push = FastPush { gather: push, seed: [1, 2], frame: 3, flags: 0, slot: 0, unused: 0 };
        let [quiet, noisy] = [false, true].map(|noise| {
            let constants = Self::constants(variant, noise);
            let pipeline = ComputePipeline::specialized(&self.context, kernel, &constants).unwrap();
            let group = self.bind(&pipeline, motion, variant.eight_bits, variant.level);
            (pipeline, group)
        });
        let record =
            |r: &mut shutterbug::gpu::Recorder<'_>, size: [u32; 2], last: &(ComputePipeline, BindGroup)| {
                if let Some((pipeline, group, size)) = &level {
                    r.dispatch(pipeline, group, &[0u32; 0], *size);
                }
                r.dispatch(&last.0, &last.1, &push, size);
            };
        let picture = self.picture(|r, size| record(r, size, &quiet));
        let ms = self.time(repeats, |r, size| record(r, size, &noisy));
        (ms, picture)
    }

    /// The kernel that makes a level, what it binds, and over how many invocations it runs.
    fn level(&self, level: Level) -> Option<(ComputePipeline, BindGroup, [u32; 2])> {
        let (file, to) = match level {
            Level::None => return None,
            Level::Half => ("trial_halve.comp", &self.half),
            Level::Sums => ("trial_sums.comp", &self.sums),
        };
        let pipeline = ComputePipeline::new(&self.context, find(file)).unwrap();
        let group = pipeline
            .bind(&[("color", Bound::Sampled(&self.color8, &self.nearest)), ("level", Bound::Storage(to))])
            .unwrap();
        let [width, height] = to.spec().size;
        Some((pipeline, group, if level == Level::Sums { [height, 1] } else { [width, height] }))
    }

    /// Noise and encoding alone: what a pixel that nothing moves in cannot cost less than.
    pub fn developed(&mut self, repeats: usize) -> Vec<f64> {
        let (pipeline, group) = self.developer(true);
        let chain = PointwisePush { size: self.size, seed: [1, 2], frame: 3, flags: 0, slot: 0, unused: 0 };
        self.time(repeats, |r, size| r.dispatch(&pipeline, &group, &chain, size))
    }

    fn developer(&self, noise: bool) -> (ComputePipeline, BindGroup) {
        let place = POINTWISE.iter().position(|s| *s == "paper_noise").unwrap();
        let mut constants = vec![0u32; 1 + POINTWISE.len()];
        (constants[0], constants[1 + place]) = (1, if noise { 2 } else { 0 });
        let pipeline =
            ComputePipeline::specialized(&self.context, find("pointwise.comp"), &constants).unwrap();
        let group = self.bind(&pipeline, 0, false, Level::None);
        (pipeline, group)
    }

    /// The exact gather and the pixel chain, two kernels: what the engine runs by default.
    pub fn unfused(&mut self, motion: usize, push: Push, repeats: usize) -> (Vec<f64>, Vec<u8>) {
        let gather = ComputePipeline::new(&self.context, find("paper_gather.comp")).unwrap();
        let gather_group = gather
            .bind(&[
                ("color", Bound::Sampled(&self.color32, &self.nearest)),
                ("motion", Bound::Storage(&self.motions[motion])),
                ("radiance", Bound::Storage(&self.radiance)),
            ])
            .unwrap();
        let [quiet, noisy] = [false, true].map(|noise| self.developer(noise));
        let chain = PointwisePush { size: self.size, seed: [1, 2], frame: 3, flags: 0, slot: 0, unused: 0 };
        let record =
            |r: &mut shutterbug::gpu::Recorder<'_>, size: [u32; 2], last: &(ComputePipeline, BindGroup)| {
                r.dispatch(&gather, &gather_group, &push, size);
                r.dispatch(&last.0, &last.1, &chain, size);
            };
        let picture = self.picture(|r, size| record(r, size, &quiet));
        let ms = self.time(repeats, |r, size| record(r, size, &noisy));
        (ms, picture)
    }

    /// A kernel that reads a texel and writes it: what any pass costs.
    pub fn pass_through(&mut self, repeats: usize) -> Vec<f64> {
        let pipeline = ComputePipeline::new(&self.context, find("resolve_color.comp")).unwrap();
        let group = pipeline
            .bind(&[
                ("color_samples", Bound::Sampled(&self.color, &self.nearest)),
                ("color", Bound::Storage(&self.radiance)),
            ])
            .unwrap();
        let push = ResolvePush { size: self.size, grid: [1, 1] };
        self.time(repeats, |r, size| r.dispatch(&pipeline, &group, &push, size))
    }

    fn picture(&mut self, record: impl Fn(&mut shutterbug::gpu::Recorder<'_>, [u32; 2])) -> Vec<u8> {
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut recorder = unsafe { self.slot.begin_unchecked() }.unwrap();
        record(&mut recorder, self.size);
        recorder.copy_buffer(&self.pixels, &self.readback, self.pixels.bytes());
        recorder.barrier();
        recorder.finish();
        self.slot.submit().unwrap();
        self.slot.wait(LIMIT).unwrap();
        self.readback.mapped().to_vec()
    }

    fn time(
        &mut self,
        repeats: usize,
        record: impl Fn(&mut shutterbug::gpu::Recorder<'_>, [u32; 2]),
    ) -> Vec<f64> {
        let mut ms = Vec::new();
        for i in 0..repeats + 2 {
            // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
            #[allow(unsafe_code)]
            let mut recorder = unsafe { self.slot.begin_unchecked() }.unwrap();
            record(&mut recorder, self.size);
            recorder.finish();
            let start = Instant::now();
            self.slot.submit().unwrap();
            self.slot.wait(LIMIT).unwrap();
            if i >= 2 {
                ms.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
        ms
    }
}

fn find(file: &str) -> &'static shutterbug::kernels::Kernel {
    TABLE.iter().find(|k| k.file == file).unwrap_or_else(|| peer_kernels::find(file))
}

/// Whether it reads between texels.
fn pipeline_is_linear(pipeline: &ComputePipeline) -> bool {
    ["paper_fast_sampler.comp", "trial_prefiltered.comp"].contains(&pipeline.file())
}

fn staged(context: &Arc<Context>, slot: &mut Slot, image: &Image, bytes: &[u8]) {
    let mut staging =
        Buffer::new(context, "staging", bytes.len() as u64, Usage::Transfer, Location::Upload).unwrap();
    staging.write(0, bytes);
    // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
    #[allow(unsafe_code)]
    let mut recorder = unsafe { slot.begin_unchecked() }.unwrap();
    recorder.prepare([image]);
    recorder.copy_buffer_to_image(&staging, image);
    recorder.barrier();
    recorder.finish();
    slot.submit().unwrap();
    slot.wait(LIMIT).unwrap();
}

fn upload(context: &Arc<Context>, slot: &mut Slot, layers: &[Plane<f32>], format: Format) -> Image {
    let size = [layers[0].width as u32, layers[0].height as u32];
    let spec = ImageSpec {
        layers: layers.len() as u32,
        array: layers.len() > 1,
        ..ImageSpec::storage(size, format)
    };
    let image = Image::new(context, "input", spec).unwrap();
    let values: Vec<f32> = layers.iter().flat_map(|p| p.data.iter().copied()).collect();
    staged(context, slot, &image, bytemuck::cast_slice(&values));
    image
}

/// Half floats, as the engine keeps colour for this kernel.
fn upload_half(context: &Arc<Context>, slot: &mut Slot, plane: &Plane<f32>) -> Image {
    let size = [plane.width as u32, plane.height as u32];
    let image = Image::new(context, "input", ImageSpec::storage(size, Format::Rgba16f)).unwrap();
    let bytes: Vec<u8> =
        plane.data.iter().flat_map(|v| exr::prelude::f16::from_f32(*v).to_le_bytes()).collect();
    staged(context, slot, &image, &bytes);
    image
}
