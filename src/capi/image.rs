//! A caller's pictures: checks, and copies between them and ours.

use exr::prelude::f16;

use super::status::{self, Fault, Outcome};
use super::types::shutterbug_image;
use crate::plane::{PixelFormat, Plane};

/// Added to a format: the last row comes first.
pub const BOTTOM_UP: u32 = 0x1_0000;
/// The format of a delivered picture that is not one of pixels: luma, then interleaved chroma of 2x2 pixels.
pub(super) const NV12: u32 = 12;

/// A checked picture of the caller. Its bytes are reached only while the call runs that it was given to.
pub struct View {
    /// Layout of a pixel.
    pub format: PixelFormat,
    /// Whether the last row comes first.
    pub bottom_up: bool,
    /// Width and height, px.
    pub size: [u32; 2],
    /// From one row to the next, bytes.
    pub stride: usize,
    /// Bytes from the first pixel to the end of the last.
    pub bytes: usize,
    /// Handle of shared memory, or 0.
    pub memory: usize,
    /// Where the first row starts in shared memory, bytes.
    pub memory_offset: u64,
    pixels: *mut u8,
}

impl View {
    /// Checks a picture's numbers against each other.
    pub fn new(image: &shutterbug_image, what: &str) -> Outcome<Self> {
        let Some(format) = PixelFormat::from_code(image.format & !BOTTOM_UP) else {
            return Err(Fault::new(status::FORMAT, format!("{what}: unknown format {}", image.format)));
        };
        let size = [image.width, image.height];
        if size.contains(&0) || size.iter().any(|&s| s > 3 * crate::plane::MAX_SIDE_PX) {
            return Err(Fault::argument(format!("{what}: {}x{} px is no size", size[0], size[1])));
        }
        let row = u64::from(image.width) * format.bytes() as u64;
        if image.stride_bytes < row {
            let text = format!("{what}: stride_bytes is {}, a row takes {row}", image.stride_bytes);
            return Err(Fault::new(status::TOO_SMALL, text));
        }
        let bytes = image
            .stride_bytes
            .checked_mul(u64::from(image.height) - 1)
            .and_then(|b| b.checked_add(row))
            .filter(|&b| b <= isize::MAX as u64)
            .ok_or_else(|| {
                Fault::argument(format!("{what}: stride_bytes {} overflows", image.stride_bytes))
            })?;
        let aligned = image.stride_bytes.is_multiple_of(format.alignment() as u64);
        let memory = image.memory as usize;
        if memory == 0 {
            Self::check_host(image, what, bytes, format)?;
        } else if !image.memory_offset.is_multiple_of(4) || !image.stride_bytes.is_multiple_of(4) {
            let text = format!("{what}: in shared memory, offset and stride are multiples of 4");
            return Err(Fault::argument(text));
        }
        if !aligned {
            let text = format!("{what}: stride_bytes {} splits a value", image.stride_bytes);
            return Err(Fault::argument(text));
        }
        Ok(Self {
            format,
            bottom_up: image.format & BOTTOM_UP != 0,
            size,
            stride: image.stride_bytes as usize,
            bytes: bytes as usize,
            memory,
            memory_offset: image.memory_offset,
            pixels: image.pixels.cast(),
        })
    }

    fn check_host(image: &shutterbug_image, what: &str, bytes: u64, format: PixelFormat) -> Outcome<()> {
        if image.pixels.is_null() {
            return Err(Fault::argument(format!("{what}: pixels is null")));
        }
        if image.capacity_bytes < bytes {
            let text =
                format!("{what}: capacity_bytes is {}, the picture takes {bytes}", image.capacity_bytes);
            return Err(Fault::new(status::TOO_SMALL, text));
        }
        let address = image.pixels as usize;
        if !address.is_multiple_of(format.alignment()) {
            return Err(Fault::argument(format!(
                "{what}: pixels lies at no multiple of {}",
                format.alignment()
            )));
        }
        if address.checked_add(bytes as usize).is_none() {
            return Err(Fault::argument(format!("{what}: pixels wraps around the address space")));
        }
        Ok(())
    }

    /// The caller's bytes, to be read.
    ///
    /// # Safety
    /// The header's promise: this many bytes are readable, and nobody writes them during the call.
    pub unsafe fn read(&self) -> &[u8] {
        // SAFETY: checked in `new` to be not null and in range; readable by the caller's promise.
        unsafe { std::slice::from_raw_parts(self.pixels, self.bytes) }
    }

    /// Writes rows of the caller's picture: `row(y, bytes)` fills one. Bytes between rows are left alone.
    ///
    /// # Safety
    /// The header's promise: this many bytes are writable, and nobody else uses them during the call.
    unsafe fn write(&self, mut row: impl FnMut(usize, &mut [u8])) {
        let width = self.size[0] as usize * self.format.bytes();
        for y in 0..self.size[1] as usize {
            let place = if self.bottom_up { self.size[1] as usize - 1 - y } else { y };
            // SAFETY: row `y` lies inside the checked range; writable by the caller's promise. Rows never overlap, as
            // the stride is not below the width.
            let bytes =
                unsafe { std::slice::from_raw_parts_mut(self.pixels.add(place * self.stride), width) };
            row(y, bytes);
        }
    }

    fn fits(&self, width: usize, height: usize, what: &str) -> Outcome<()> {
        if self.memory != 0 {
            return Err(Fault::argument(format!("{what} is read into host memory, not into shared memory")));
        }
        if [self.size[0] as usize, self.size[1] as usize] == [width, height] {
            return Ok(());
        }
        let [w, h] = self.size;
        Err(Fault::argument(format!("{what}: the picture is {width}x{height} px, not {w}x{h}")))
    }

    /// Copies an 8-bit RGB picture out.
    ///
    /// # Safety
    /// As for [`Self::write`].
    pub unsafe fn put_picture(&self, picture: &Plane<u8>) -> Outcome<()> {
        self.fits(picture.width, picture.height, "picture")?;
        let fill: fn(&[u8], &mut [u8]) = match self.format {
            PixelFormat::Rgb8 => |from, to| to.copy_from_slice(from),
            PixelFormat::Rgba8 => |from, to| {
                for (p, q) in from.chunks_exact(3).zip(to.chunks_exact_mut(4)) {
                    q.copy_from_slice(&[p[0], p[1], p[2], 255]);
                }
            },
            PixelFormat::Bgra8 => |from, to| {
                for (p, q) in from.chunks_exact(3).zip(to.chunks_exact_mut(4)) {
                    q.copy_from_slice(&[p[2], p[1], p[0], 255]);
                }
            },
            other => {
                let text = format!("the picture is delivered as RGB8, RGBA8 or BGRA8, not {other:?}");
                return Err(Fault::new(status::FORMAT, text));
            }
        };
        // SAFETY: the caller's promise.
        unsafe { self.write(|y, to| fill(picture.row(y), to)) };
        Ok(())
    }

    /// Copies a plane of floats out, as floats or halves. `formats`: the ones that are possible.
    ///
    /// # Safety
    /// As for [`Self::write`].
    pub unsafe fn put_floats(
        &self,
        plane: &Plane<f32>,
        formats: [PixelFormat; 2],
        what: &str,
    ) -> Outcome<()> {
        self.fits(plane.width, plane.height, what)?;
        if !formats.contains(&self.format) {
            let text = format!("the {what} plane is delivered as {formats:?}, not {:?}", self.format);
            return Err(Fault::new(status::FORMAT, text));
        }
        let halves = self.format.alignment() == 2;
        let fill = |y: usize, to: &mut [u8]| {
            if halves {
                for (value, to) in plane.row(y).iter().zip(to.chunks_exact_mut(2)) {
                    to.copy_from_slice(&f16::from_f32(*value).to_le_bytes());
                }
            } else {
                for (value, to) in plane.row(y).iter().zip(to.chunks_exact_mut(4)) {
                    to.copy_from_slice(&value.to_le_bytes());
                }
            }
        };
        // SAFETY: the caller's promise.
        unsafe { self.write(fill) };
        Ok(())
    }
}
