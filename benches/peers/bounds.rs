//! What no pass can beat on a device: its bytes over the bandwidth of a copy, its taps over the rate of a kernel that
//! does nothing but read between texels. Both measured here, in the same run as what is held against them.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use shutterbug::error::Result;
use shutterbug::gpu::{
    Bound, Buffer, ComputePipeline, Context, Format, Image, ImageSpec, Location, Sampler, Slot, Usage,
};

use crate::peer_kernels;

const LIMIT: Duration = Duration::from_secs(120);
/// Larger than the caches of any processor that this is likely to run on.
const COPY_BYTES: u64 = 64 << 20;
/// Copies, and dispatches, of one submission: what a submission costs on its own is then lost among them.
const IN_ONE: usize = 4;
const RUNS: usize = 7;
const TAPS_SIZE: [u32; 2] = [640, 480];
const TAPS: u32 = 32;

/// Rates of a device.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Bounds {
    /// Bytes read plus bytes written a second by `vkCmdCopyBuffer`.
    pub copy_bytes_per_s: f64,
    /// Bilinear reads of an RGBA8 picture a second.
    pub taps_per_s: f64,
}

/// A time and what bounds it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Bounded {
    pub name: String,
    pub ms: f64,
    /// Least bytes that must be read and written.
    pub bytes: f64,
    pub bytes_ms: f64,
    /// 0 where nothing is sampled.
    pub taps_ms: f64,
    /// Of the time over the larger bound.
    pub ratio: f64,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct TapsPush {
    size: [u32; 2],
    taps: u32,
}

impl Bounds {
    /// Measures both rates: the best of several runs.
    pub fn measure(context: &Arc<Context>) -> Result<Self> {
        let mut slot = Slot::new(context, "bounds")?;
        let copy_s = copy(context, &mut slot)?;
        let taps_s = taps(context, &mut slot)?;
        let taps = f64::from(TAPS_SIZE[0] * TAPS_SIZE[1] * TAPS);
        Ok(Self { copy_bytes_per_s: 2.0 * COPY_BYTES as f64 / copy_s, taps_per_s: taps / taps_s })
    }

    /// A time beside its bounds.
    pub fn hold(&self, name: &str, ms: f64, bytes: f64, taps: f64) -> Bounded {
        let (bytes_ms, taps_ms) = (1e3 * bytes / self.copy_bytes_per_s, 1e3 * taps / self.taps_per_s);
        Bounded { name: name.to_owned(), ms, bytes, bytes_ms, taps_ms, ratio: ms / bytes_ms.max(taps_ms) }
    }

    /// Both rates in words.
    pub fn line(&self) -> String {
        let (copy, taps) = (self.copy_bytes_per_s * 1e-9, self.taps_per_s * 1e-9);
        format!(
            "copies: {copy:.2} GB/s (read and written); bilinear reads of 8 bits: {taps:.3} thousand million a second"
        )
    }
}

impl Bounded {
    /// Head of a table of [`Self::row`].
    pub const HEAD: &str =
        "pass | ms | MB | ms by bytes | ms by taps | over the larger\n---|---|---|---|---|---\n";

    /// A row of a Markdown table.
    pub fn row(&self) -> String {
        format!(
            "{} | {:.3} | {:.2} | {:.3} | {:.3} | {:.2}\n",
            self.name,
            self.ms,
            1e-6 * self.bytes,
            self.bytes_ms,
            self.taps_ms,
            self.ratio
        )
    }
}

/// Seconds of one copy.
fn copy(context: &Arc<Context>, slot: &mut Slot) -> Result<f64> {
    let buffer = |name| Buffer::new(context, name, COPY_BYTES, Usage::Storage, Location::Device);
    let (from, to) = (buffer("copied from")?, buffer("copied to")?);
    least_s(slot, |r| r.copy_buffer(&from, &to, COPY_BYTES))
}

/// Seconds of one dispatch of the kernel that samples.
fn taps(context: &Arc<Context>, slot: &mut Slot) -> Result<f64> {
    let outer = TAPS_SIZE.map(|s| s + 2 * TAPS + 8);
    let color = Image::new(context, "sampled", ImageSpec::storage(outer, Format::Rgba8))?;
    let bytes = u64::from(TAPS_SIZE[0] * TAPS_SIZE[1]) * 4;
    let pixels = Buffer::new(context, "taps", bytes, Usage::Storage, Location::Device)?;
    let sampler = Sampler::in_texels(context)?;
    let kernel = ComputePipeline::new(context, peer_kernels::find("taps.comp"))?;
    let group =
        kernel.bind(&[("color", Bound::Sampled(&color, &sampler)), ("Pixels", Bound::Buffer(&pixels))])?;
    // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
    #[allow(unsafe_code)]
    let mut recorder = unsafe { slot.begin_unchecked() }?;
    recorder.prepare([&color]);
    recorder.clear(&color);
    recorder.finish();
    slot.submit()?;
    slot.wait(LIMIT)?;
    let push = TapsPush { size: TAPS_SIZE, taps: TAPS };
    least_s(slot, |r| r.dispatch(&kernel, &group, &push, TAPS_SIZE))
}

/// The best of several submissions of the same, s each; the first compiles and is not counted.
fn least_s(slot: &mut Slot, record: impl Fn(&mut shutterbug::gpu::Recorder<'_>)) -> Result<f64> {
    let mut least = f64::INFINITY;
    for run in 0..=RUNS {
        // SAFETY: what is recorded is this function's or its owner's, fits, and is waited for before it is dropped.
        #[allow(unsafe_code)]
        let mut recorder = unsafe { slot.begin_unchecked() }?;
        (0..IN_ONE).for_each(|_| record(&mut recorder));
        recorder.finish();
        let start = Instant::now();
        slot.submit()?;
        slot.wait(LIMIT)?;
        if run > 0 {
            least = least.min(start.elapsed().as_secs_f64() / IN_ONE as f64);
        }
    }
    Ok(least)
}
