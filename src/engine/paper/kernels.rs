//! The kernels of the paper's gather, and what each is good for.

use crate::kernels::{Kernel, kernel};

/// What the gather of the paper's method may give up for speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Gather {
    /// Nothing: `paper_gather`, the bits of its twin, a tap a px.
    #[default]
    Exact,
    /// Weights of 8 bits, a tap every second px of the path: about 52 dB from the exact one.
    Bilinear,
    /// The texel that holds the place, a tap a px: about 44 dB.
    Fast,
}

/// One kernel with its constants.
#[derive(Clone, Copy)]
pub struct GatherKernel {
    /// What `--gather-kernel` and the cache call it.
    pub name: &'static str,
    /// What it is good for.
    pub gather: Gather,
    pub(super) shader: &'static Kernel,
    pub(super) taps_per_px: f32,
    pub(super) unroll: u32,
    /// Whether it reads between texels.
    pub(super) linear: bool,
}

impl PartialEq for GatherKernel {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl std::fmt::Debug for GatherKernel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

const SAMPLER: &Kernel = kernel("paper_fast_sampler.comp");
const TEXELS: &Kernel = kernel("paper_fast_texels.comp");
const NEAREST: &Kernel = kernel("paper_fast_nearest.comp");

const fn bilinear(name: &'static str, shader: &'static Kernel, unroll: u32, linear: bool) -> GatherKernel {
    GatherKernel { name, gather: Gather::Bilinear, shader, taps_per_px: 0.5, unroll, linear }
}

const fn nearest(name: &'static str, unroll: u32) -> GatherKernel {
    GatherKernel { name, gather: Gather::Fast, shader: NEAREST, taps_per_px: 1.0, unroll, linear: false }
}

/// All kernels that can be chosen.
pub const GATHER_KERNELS: [GatherKernel; 8] = [
    bilinear("sampler_1", SAMPLER, 1, true),
    bilinear("sampler_2", SAMPLER, 2, true),
    bilinear("sampler_4", SAMPLER, 4, true),
    bilinear("texels_1", TEXELS, 1, false),
    bilinear("texels_2", TEXELS, 2, false),
    nearest("nearest_1", 1),
    nearest("nearest_4", 4),
    nearest("nearest_8", 8),
];
