//! Pictures as callers have them, brought into the engine's units. Twin of `glsl/unpack_color.comp` (its variant for
//! half floats does the same and rounds), `unpack_motion.comp`, `unpack_depth.comp`, `unpack_inverse_depth.comp` and
//! `unpack_body.comp`.

use bytemuck::{Pod, Zeroable};
use exr::prelude::f16;

use crate::plane::{PixelFormat, Plane, srgb_decode};

/// What 8-bit colour values mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Encoding {
    /// sRGB codes (IEC 61966-2-1).
    #[default]
    Srgb,
    /// Linear radiance, 255 = white.
    Linear,
}

/// Radiance of the 256 sRGB codes, then of the 256 linear ones: what `unpack_color` looks codes up in.
pub fn decode_table() -> Vec<f32> {
    let code = |c: u32| c as f32 / 255.0;
    (0..256).map(|c| srgb_decode(code(c))).chain((0..256).map(code)).collect()
}

/// Parameters of `unpack_color`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ColorPush {
    /// Width and height, px.
    pub size: [u32; 2],
    /// Where the first row starts.
    pub first_byte: u32,
    /// From one row to the next, bytes.
    pub stride_bytes: u32,
    /// A [`PixelFormat`].
    pub format: u32,
    /// Place of the first code in [`decode_table`]: 0 for sRGB, 256 for linear codes.
    pub codes_from: u32,
}

/// Parameters of `unpack_motion`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MotionPush {
    /// Width and height, px.
    pub size: [u32; 2],
    /// Multiplies the values given: px per frame interval, content from its previous to its current place.
    pub scale: [f32; 2],
    /// Where the first row starts.
    pub first_byte: u32,
    /// From one row to the next, bytes.
    pub stride_bytes: u32,
    /// A [`PixelFormat`].
    pub format: u32,
    /// Layer that is written.
    pub layer: u32,
}

/// Parameters of `unpack_depth`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct DepthPush {
    /// Width and height, px.
    pub size: [u32; 2],
    /// Where the first row starts.
    pub first_byte: u32,
    /// From one row to the next, bytes.
    pub stride_bytes: u32,
    /// 1: values are metres. 0: metres = numerator / (constant + slope value).
    pub metres: u32,
    /// See `metres`.
    pub numerator: f32,
    /// See `metres`.
    pub constant: f32,
    /// See `metres`.
    pub slope: f32,
}

/// Parameters of `unpack_inverse_depth`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct InverseDepthPush {
    /// Width and height, px.
    pub size: [u32; 2],
    /// Where the first row starts.
    pub first_byte: u32,
    /// From one row to the next, bytes.
    pub stride_bytes: u32,
    /// Near distance over distance = numerator / value where this is not 0, else constant + slope value.
    pub numerator: f32,
    /// See `numerator`.
    pub constant: f32,
    /// See `numerator`.
    pub slope: f32,
}

/// Parameters of `unpack_body`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BodyPush {
    /// Width and height, px.
    pub size: [u32; 2],
    /// Where the first row starts.
    pub first_byte: u32,
    /// From one row to the next, bytes.
    pub stride_bytes: u32,
    /// Bytes of an id: 1, 2 or 4.
    pub id_bytes: u32,
    /// How many bodies there are.
    pub count: u32,
}

fn half(bytes: &[u8], at: usize) -> f32 {
    f16::from_le_bytes([bytes[at], bytes[at + 1]]).to_f32()
}

fn float(bytes: &[u8], at: usize) -> f32 {
    f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn number(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

/// Linear RGBA, shape `[height, width, 4]`. What is not a number is 0.
///
/// # Panics
/// If `bytes` is shorter than the picture or `push.format` is no colour format.
pub fn unpack_color(push: &ColorPush, bytes: &[u8], table: &[f32]) -> Plane<f32> {
    let format = PixelFormat::from_code(push.format).filter(|f| f.is_color()).expect("a colour format");
    let [width, height] = push.size.map(|s| s as usize);
    let code = |at: usize| table[push.codes_from as usize + usize::from(bytes[at])];
    Plane::from_fn(width, height, |x, y| {
        let at = push.first_byte as usize + y * push.stride_bytes as usize + x * format.bytes();
        let alpha = |at: usize| f32::from(bytes[at]) / 255.0;
        match format {
            PixelFormat::Rgb8 => [code(at), code(at + 1), code(at + 2), 1.0],
            PixelFormat::Rgba8 => [code(at), code(at + 1), code(at + 2), alpha(at + 3)],
            PixelFormat::Bgra8 => [code(at + 2), code(at + 1), code(at), alpha(at + 3)],
            PixelFormat::Rgba16f => [0, 2, 4, 6].map(|i| number(half(bytes, at + i))),
            _ => [0, 4, 8, 12].map(|i| number(float(bytes, at + i))),
        }
    })
}

/// Motion, px per frame interval, shape `[height, width, 2]`. What is not a number does not move.
///
/// # Panics
/// If `bytes` is shorter than the picture or `push.format` is no motion format.
pub fn unpack_motion(push: &MotionPush, bytes: &[u8]) -> Plane<f32> {
    let format = PixelFormat::from_code(push.format).filter(|f| f.is_motion()).expect("a motion format");
    let [width, height] = push.size.map(|s| s as usize);
    Plane::from_fn(width, height, |x, y| {
        let at = push.first_byte as usize + y * push.stride_bytes as usize + x * format.bytes();
        let given = match format {
            PixelFormat::Rg16f => [half(bytes, at), half(bytes, at + 2)],
            _ => [float(bytes, at), float(bytes, at + 4)],
        };
        let known = given.iter().all(|v| v.is_finite());
        if known { [given[0] * push.scale[0], given[1] * push.scale[1]] } else { [0.0; 2] }
    })
}

/// Depth along the optical axis, m, shape `[height, width, 1]`; 0 = infinitely far.
///
/// # Panics
/// If `bytes` is shorter than the picture.
pub fn unpack_depth(push: &DepthPush, bytes: &[u8]) -> Plane<f32> {
    let [width, height] = push.size.map(|s| s as usize);
    Plane::from_fn(width, height, |x, y| {
        let given = float(bytes, push.first_byte as usize + y * push.stride_bytes as usize + x * 4);
        let bottom = push.constant + push.slope * given;
        let there = if bottom > 0.0 { push.numerator / bottom } else { 0.0 };
        [if push.metres != 0 { given } else { there }]
    })
}

/// Near distance over distance, shape `[height, width, 1]`; 0 = infinitely far, which all is that is no number above 0.
///
/// # Panics
/// If `bytes` is shorter than the picture.
pub fn unpack_inverse_depth(push: &InverseDepthPush, bytes: &[u8]) -> Plane<f32> {
    let [width, height] = push.size.map(|s| s as usize);
    Plane::from_fn(width, height, |x, y| {
        let given = float(bytes, push.first_byte as usize + y * push.stride_bytes as usize + x * 4);
        let inverse = match push.numerator {
            0.0 => (push.constant + push.slope * given).max(0.0),
            numerator if given > 0.0 => numerator / given,
            _ => 0.0,
        };
        [if given.is_finite() { inverse } else { 0.0 }]
    })
}

/// Numbers of bodies, shape `[height, width, 1]`; what is nobody's is 0. `numbers`: ids in rising order, then the
/// number of each.
///
/// # Panics
/// If `bytes` is shorter than the picture.
pub fn unpack_body(push: &BodyPush, bytes: &[u8], numbers: &[u32]) -> Plane<f32> {
    let [width, height] = push.size.map(|s| s as usize);
    let (ids, of) = numbers.split_at(push.count as usize);
    let id_bytes = push.id_bytes as usize;
    Plane::from_fn(width, height, |x, y| {
        let at = push.first_byte as usize + y * push.stride_bytes as usize + x * id_bytes;
        let id = bytes[at..at + id_bytes].iter().rev().fold(0, |id, &byte| id << 8 | u32::from(byte));
        [ids.binary_search(&id).map_or(0.0, |at| of[at] as f32)]
    })
}
