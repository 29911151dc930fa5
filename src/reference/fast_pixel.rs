//! A pixel of [`super::fast_gather`] and what it asks of the picture. Twin of the head of
//! `glsl/include/fast_gather.glsl`.

use glam::{IVec2, Vec2, Vec3};

use super::fast_push::{Inputs, Push};
use super::sample::sample_bilinear;

/// Everything that a pixel asks.
pub(super) struct Task<'a> {
    pub(super) push: &'a Push,
    pub(super) inputs: &'a Inputs<'a>,
    pub(super) seeds: Vec<u32>,
}

/// Half the distance of two bilinear samples that stand for a pixel's width of texels of half a px, px.
const SPREAD_PX: f32 = 0.14434;
impl Task<'_> {
    /// A pixel that is one texel is not spread.
    pub(super) fn spread_px(&self) -> f32 {
        if self.inputs.color_scale == 2 { SPREAD_PX } else { 0.0 }
    }

    /// Bilinear.
    pub(super) fn read_between(&self, position_px: Vec2) -> Vec3 {
        let position = position_px * self.inputs.color_scale as f32;
        sample_bilinear(self.inputs.color, position, &mut false).truncate()
    }

    /// Whether a place lies beyond the centres of the outermost texels.
    pub(super) fn is_beyond(&self, position_px: Vec2) -> bool {
        let color = self.inputs.color;
        let texel = position_px * self.inputs.color_scale as f32;
        let last = Vec2::new(color.width as f32, color.height as f32) - 0.5;
        texel.cmplt(Vec2::splat(0.5)).any() || texel.cmpgt(last).any()
    }
}

/// A pixel's place and time.
#[derive(Clone, Copy)]
pub(super) struct Pixel {
    pub(super) at: IVec2,
    /// Where it looks in the picture with its margin.
    pub(super) x_px: Vec2,
    /// Begin and duration of its exposure, in knots.
    pub(super) from: f32,
    pub(super) span: f32,
}

/// Samples for a path, px: one a px, in pairs.
pub(super) fn blur_pairs(push: &Push, path_px: f32) -> u32 {
    ((0.5 * path_px).ceil() as u32).clamp(1, (push.max_samples / 2).max(1))
}
