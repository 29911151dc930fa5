//! Pictures in the library's own memory.

use super::{PIXELS, SIZE};
use crate::capi_support::*;
use exr::prelude::f16;
use shutterbug::capi::*;
use shutterbug::plane::PixelFormat;

/// Some picture as bytes of a format; halves and floats in -2 ... 2 or depths in 1 ... 3.
pub(super) fn bytes_of(format: PixelFormat) -> Vec<u8> {
    let mut seed = 5u32;
    let mut number = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / 16_777_216.0
    };
    let values = PIXELS * format.bytes() / format.alignment();
    match format.alignment() {
        1 => (0..values).map(|_| (255.0 * number()) as u8).collect(),
        2 => (0..values).flat_map(|_| f16::from_f32(4.0 * number() - 2.0).to_le_bytes()).collect(),
        _ if format == PixelFormat::R32f => {
            (0..values).flat_map(|_| (1.0 + 2.0 * number()).to_le_bytes()).collect()
        }
        _ => (0..values).flat_map(|_| (4.0 * number() - 2.0).to_le_bytes()).collect(),
    }
}

/// The library's own bytes, aligned for floats.
pub(super) struct Given(Vec<u32>, PixelFormat);

impl Given {
    pub(super) fn new(format: PixelFormat) -> Self {
        let words =
            bytes_of(format).chunks_exact(4).map(|c| u32::from_le_bytes(c.try_into().unwrap())).collect();
        Self(words, format)
    }

    pub(super) fn image(&mut self) -> shutterbug_image {
        image(self.1, SIZE[0], SIZE[1], bytemuck::cast_slice_mut(&mut self.0))
    }
}
