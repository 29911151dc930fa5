//! What a pass of the rasterizer draws: shaders, formats, specialization constants.

use super::SceneBuffers;
use crate::camera::NEAR_M;
use crate::gpu::Format;
use crate::kernels::{Kernel, kernel};

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RasterKind {
    /// Radiance only.
    Color,
    /// Motion only: no lights, no textures.
    Motion,
    /// Both in one pass.
    ColorMotion,
    /// Displacement from the instant of the picture to the begin (first two channels) and to the end (last two) of the
    /// span; no lights, no textures.
    Path,
    /// Radiance of placed vertices, and the motion group in alpha.
    Exact,
}

impl RasterKind {
    pub(super) fn shaders(self) -> (&'static Kernel, &'static Kernel) {
        match self {
            Self::Color => (const { kernel("raster_color.vert") }, const { kernel("raster_color.frag") }),
            Self::Motion => (const { kernel("raster_motion.vert") }, const { kernel("raster_motion.frag") }),
            Self::Exact => (const { kernel("raster_exact.vert") }, const { kernel("raster_exact.frag") }),
            Self::ColorMotion => {
                (const { kernel("raster_color_motion.vert") }, const { kernel("raster_color_motion.frag") })
            }
            Self::Path => (const { kernel("raster_path.vert") }, const { kernel("raster_path.frag") }),
        }
    }

    pub(super) fn formats(self) -> &'static [Format] {
        match self {
            Self::Color | Self::Exact => &[Format::Rgba16f],
            Self::Motion => &[Format::Rg32f],
            Self::ColorMotion => &[Format::Rgba16f, Format::Rg32f],
            Self::Path => &[Format::Rgba32f],
        }
    }

    /// `(textured, glossy)` of the pipelines that draw this kind.
    pub(super) fn variants(self) -> &'static [(bool, bool)] {
        match self.has_color() {
            true => &[(false, false), (true, false), (false, true), (true, true)],
            false => &[(false, false)],
        }
    }

    pub(super) fn has_color(self) -> bool {
        !matches!(self, Self::Motion | Self::Path)
    }
}

/// Number of the first specialization constant in `raster_lights.glsl`.
const FIRST_FIXED_LIGHT: usize = 16;

/// Specialization constants of all pipelines.
pub(super) fn constants(scene: &SceneBuffers, kind: RasterKind, textured: bool, glossy: bool) -> Vec<u32> {
    let color = kind.has_color();
    let near = (NEAR_M as f32).to_bits();
    let mut all = vec![(color && scene.lit).into(), textured.into(), scene.light_count, near, glossy.into()];
    all.resize(FIRST_FIXED_LIGHT, 0);
    all.extend(&scene.fixed_lights);
    all
}
