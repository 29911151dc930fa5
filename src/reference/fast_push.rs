//! Parameters of `fast_seeds` and `fast_gather`, and the claims that pass between them. Twin of
//! `glsl/include/fast_push.glsl`.

use bytemuck::{Pod, Zeroable};
use glam::{IVec2, Vec2};

use super::path::Paths;
use crate::plane::Plane;

/// The kernels' parameters. Times are relative to the reference instant, at which the picture was rendered.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Push {
    /// Width and height of the result, px.
    pub size: [u32; 2],
    /// How much more the picture and the path images hold on every side, px.
    pub margin_px: [i32; 2],
    /// Start of exposure of the first line read, s.
    pub start_s: f32,
    /// N times the delay from line to line, s.
    pub readout_time_s: f32,
    /// How long every line integrates, s.
    pub exposure_time_s: f32,
    /// Time from one knot to the next, s.
    pub knot_step_s: f32,
    /// The knot that is the reference instant: its displacement is zero and no image holds it.
    pub reference_knot: u32,
    /// Number of knots less one, 1 to 6.
    pub last_knot: u32,
    /// A [`super::timing::scan_order_code`].
    pub scan_order: u32,
    /// Most samples of the blur.
    pub max_samples: u32,
    /// Moments of the exposure at which claims are made: 1 (its middle) or 3 (begin, middle, end).
    pub slots: u32,
    /// One of several pictures of a frame: when it was rendered, s.
    pub picture_s: f32,
    /// When the one before it was.
    pub from_s: f32,
    /// When the one after it was.
    pub to_s: f32,
    /// The first pixel that the kernel of `fast_gather` looks at.
    pub first: [u32; 2],
}

/// Farthest that a source may lie from its destination to make a claim, px a side.
pub const SEED_REACH_PX: i32 = 511;

/// A claim: nearer surfaces have greater keys; beside depth it holds where the source lies.
pub fn seed_key(inverse_depth: f32, source_minus_destination: IVec2) -> u32 {
    let depth = ((inverse_depth.to_bits() as i32).wrapping_sub(0x3380_0000) >> 16).clamp(0, 4095);
    let offset = (source_minus_destination + 512).as_uvec2();
    ((depth as u32) << 20) | (offset.x << 10) | offset.y
}

/// Where the source of a claim lies from its destination, px.
pub fn seed_offset(key: u32) -> IVec2 {
    IVec2::new(((key >> 10) & 1023) as i32, (key & 1023) as i32) - 512
}

impl Push {
    /// Place of a destination pixel's claim: four words a pixel.
    pub fn seed_index(&self, slot: u32, pixel: IVec2) -> usize {
        (4 * (pixel.y as u32 * self.size[0] + pixel.x as u32) + slot) as usize
    }

    /// Columns and rows that the picture holds beyond each side of the result, px.
    pub fn margin(&self) -> Vec2 {
        IVec2::from(self.margin_px).as_vec2()
    }

    /// Place of a slot in the exposure, 0..1.
    pub fn slot_fraction(&self, slot: u32) -> f32 {
        if self.slots == 1 { 0.5 } else { 0.5 * slot as f32 }
    }
}

/// What one warp reads. Twin of the bindings of the kernels.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// Linear RGBA at the reference instant with margin, `color_scale` texels a px.
    pub color: &'a Plane<f32>,
    /// Texels of the colour a px: 1 or 2.
    pub color_scale: usize,
    /// The paths of what it shows.
    pub paths: Paths<'a>,
    /// One channel, size of the path images; grows towards the camera, 0 infinitely far.
    pub inverse_depth: &'a Plane<f32>,
    /// Whether all of the picture moves as one surface does: nothing is claimed then.
    pub one_surface: bool,
    /// Whether it is one of several pictures of a frame: results then hold what they are worth.
    pub one_of_several: bool,
    /// A lens that the picture was rendered without.
    pub lens: Option<FastLens<'a>>,
}

/// A lens, as two pictures of two channels. Twin of `glsl/include/fast_lens.glsl`.
#[derive(Clone, Copy, Debug)]
pub struct FastLens<'a> {
    /// By pixel of the result: where a pinhole's picture shows what it sees, px, margin included.
    pub ideal: &'a Plane<f32>,
    /// By pixel of the picture, margin included: where the lens shows what is there, px of the result.
    pub sensed: &'a Plane<f32>,
}

impl Inputs<'_> {
    /// Where a pixel of the result looks, px, margin included.
    pub fn looks_at(&self, push: &Push, pixel: IVec2) -> Vec2 {
        match self.lens {
            Some(lens) => Vec2::from_slice(lens.ideal.pixel(pixel.x as usize, pixel.y as usize)),
            None => pixel.as_vec2() + 0.5 + push.margin(),
        }
    }

    /// Where the lens shows a place of the pinhole's picture, both px of the result.
    pub fn on_sensor(&self, push: &Push, position_px: Vec2) -> Vec2 {
        let Some(lens) = self.lens else { return position_px };
        let full = IVec2::new(lens.sensed.width as i32, lens.sensed.height as i32);
        let place = position_px + push.margin();
        let inside = place.clamp(Vec2::ZERO, full.as_vec2()).floor().as_ivec2();
        let texel = inside.clamp(IVec2::ZERO, full - 1);
        let there = Vec2::from_slice(lens.sensed.pixel(texel.x as usize, texel.y as usize));
        there + (place - (texel.as_vec2() + 0.5))
    }
}
