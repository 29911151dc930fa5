//! CPU pictures: row-major, interleaved channels, top row first.

mod exr;
mod format;
mod io;
mod jpeg_end;
pub mod metrics;
mod raw;
mod srgb;
pub mod stats;

pub use crate::files::write_atomic;
pub use exr::{
    COLOR_CHANNELS, DEPTH_CHANNELS, ExrPicture, MOTION_CHANNELS, read_exr, read_exr_plane, write_exr_atomic,
    write_exr_plane,
};
pub use format::PixelFormat;
pub use io::{
    MAX_DECODED_BYTES, MAX_PIXELS, MAX_SIDE_PX, decode_picture, read_rgb8, read_rgb8_as, write_png_atomic,
};
pub use raw::{RawLayout, digital_number};
pub use srgb::{srgb_decode, srgb_encode, srgb_slope, srgb8};

/// What `f` gives for the colours of a pixel, or for three coordinates or corners. In loops over pixels it stands for
/// `[0, 1, 2].map(f)`, which is called and not inlined where a crate is compiled in many parts: 40 % of the time of
/// some tests went there.
#[inline(always)]
pub fn three<T>(mut f: impl FnMut(usize) -> T) -> [T; 3] {
    [f(0), f(1), f(2)]
}

/// A picture of `height` rows, `width` columns and `channels` interleaved values: shape `[height, width, channels]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane<T> {
    /// Columns, px.
    pub width: usize,
    /// Rows, px.
    pub height: usize,
    /// Values a pixel.
    pub channels: usize,
    /// `height * width * channels` values.
    pub data: Vec<T>,
}

impl Plane<u8> {
    /// The same whole values as `f32`.
    pub fn to_f32(&self) -> Plane<f32> {
        let data = self.data.iter().map(|v| f32::from(*v)).collect();
        Plane { width: self.width, height: self.height, channels: self.channels, data }
    }
}

impl<T: Copy + Default> Plane<T> {
    /// A picture of default values.
    pub fn new(width: usize, height: usize, channels: usize) -> Self {
        Self { width, height, channels, data: vec![T::default(); width * height * channels] }
    }

    /// A picture computed pixel by pixel; `f(x, y)` gives the channels of one.
    pub fn from_fn<const N: usize>(
        width: usize,
        height: usize,
        mut f: impl FnMut(usize, usize) -> [T; N],
    ) -> Self {
        let mut data = Vec::with_capacity(width * height * N);
        for y in 0..height {
            for x in 0..width {
                data.extend_from_slice(&f(x, y));
            }
        }
        Self { width, height, channels: N, data }
    }

    /// The channels of one pixel.
    ///
    /// # Panics
    /// If the pixel lies outside.
    pub fn pixel(&self, x: usize, y: usize) -> &[T] {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) outside {}x{}", self.width, self.height);
        let at = (y * self.width + x) * self.channels;
        &self.data[at..at + self.channels]
    }

    /// The channels of one pixel, to be changed.
    ///
    /// # Panics
    /// If the pixel lies outside.
    pub fn pixel_mut(&mut self, x: usize, y: usize) -> &mut [T] {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) outside {}x{}", self.width, self.height);
        let at = (y * self.width + x) * self.channels;
        &mut self.data[at..at + self.channels]
    }

    /// One row: `width * channels` values.
    pub fn row(&self, y: usize) -> &[T] {
        let stride = self.width * self.channels;
        &self.data[y * stride..(y + 1) * stride]
    }
}
