//! Rows of the caller's memory that a delivered picture is written to, in layouts that are not one of pixels
//! ([`super::image`] has those).

use super::status::{self, Fault, Outcome};
use super::types::shutterbug_image;

/// Checked rows.
pub(super) struct Rows {
    size: [usize; 2],
    count: usize,
    bytes: usize,
    stride: usize,
    bottom_up: bool,
    pixels: *mut u8,
}

/// What a layout asks of the caller's image.
pub(super) struct Layout {
    /// Its name.
    pub(super) name: &'static str,
    /// Bytes of a row.
    pub(super) row_bytes: u64,
    /// Rows in memory.
    pub(super) rows: u64,
    /// Addresses and strides are multiples of it.
    pub(super) alignment: u64,
    /// Whether the last row comes first.
    pub(super) bottom_up: bool,
}

impl Rows {
    /// Checks an image's numbers against each other.
    pub(super) fn new(image: &shutterbug_image, layout: &Layout) -> Outcome<Self> {
        let Layout { name, row_bytes, rows, alignment, bottom_up } = *layout;
        if !image.memory.is_null() || image.pixels.is_null() {
            return Err(Fault::argument(format!("image: {name} goes to pixels in host memory")));
        }
        if image.width == 0 || image.height == 0 {
            return Err(Fault::argument(format!("image: {}x{} px is no size", image.width, image.height)));
        }
        if image.stride_bytes < row_bytes {
            let text = format!("image: stride_bytes is {}, a row takes {row_bytes}", image.stride_bytes);
            return Err(Fault::new(status::TOO_SMALL, text));
        }
        let address = image.pixels as usize;
        if !image.stride_bytes.is_multiple_of(alignment) || !(address as u64).is_multiple_of(alignment) {
            let text = format!(
                "image: values of {alignment} bytes; pixels ({address:#x}) and stride_bytes ({}) are multiples of that",
                image.stride_bytes
            );
            return Err(Fault::argument(text));
        }
        // The last row needs no padding.
        let bytes = image.stride_bytes.checked_mul(rows - 1).and_then(|b| b.checked_add(row_bytes));
        match bytes {
            Some(bytes) if bytes > isize::MAX as u64 || address.checked_add(bytes as usize).is_none() => {
                Err(Fault::argument("image: the picture wraps around the address space"))
            }
            None => Err(Fault::argument(format!("image: stride_bytes {} overflows", image.stride_bytes))),
            Some(bytes) if image.capacity_bytes < bytes => {
                let text =
                    format!("image: capacity_bytes is {}, the picture takes {bytes}", image.capacity_bytes);
                Err(Fault::new(status::TOO_SMALL, text))
            }
            Some(_) => Ok(Self {
                size: [image.width as usize, image.height as usize],
                count: rows as usize,
                bytes: row_bytes as usize,
                stride: image.stride_bytes as usize,
                bottom_up,
                pixels: image.pixels.cast(),
            }),
        }
    }

    /// Writes a picture of that size: `row(y, bytes)` fills row `y` of those in memory. Bytes between rows are left
    /// alone.
    ///
    /// # Safety
    /// The header's promise: this many bytes are writable, and nobody else uses them during the call.
    pub(super) unsafe fn write(
        &self,
        size: [usize; 2],
        mut row: impl FnMut(usize, &mut [u8]),
    ) -> Outcome<()> {
        let [width, height] = self.size;
        if size != self.size {
            let text = format!("image: the picture is {}x{} px, not {width}x{height}", size[0], size[1]);
            return Err(Fault::argument(text));
        }
        for y in 0..self.count {
            let place = if self.bottom_up { self.count - 1 - y } else { y };
            // SAFETY: inside the range that `new` checked; writable by the caller's promise. Rows never overlap, as the
            // stride is not below their length.
            let to =
                unsafe { std::slice::from_raw_parts_mut(self.pixels.add(place * self.stride), self.bytes) };
            row(y, to);
        }
        Ok(())
    }
}
