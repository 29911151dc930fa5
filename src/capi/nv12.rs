//! Delivered pictures as NV12: a plane of luma, then one of interleaved chroma for every 2x2 pixels (BT.601, full
//! range, as JPEG has it).

use super::image::NV12;
use super::rows::{Layout, Rows};
use super::status::{Fault, Outcome};
use super::types::shutterbug_image;
use crate::plane::Plane;

/// A checked picture of the caller.
pub struct Nv12(Rows);

impl Nv12 {
    /// Whether an image is one.
    pub fn wanted(image: &shutterbug_image) -> bool {
        image.format == NV12
    }

    /// Checks its numbers against each other.
    pub fn new(image: &shutterbug_image) -> Outcome<Self> {
        let (width, height) = (u64::from(image.width), u64::from(image.height));
        if width % 2 != 0 || height % 2 != 0 {
            return Err(Fault::argument(format!("image: {width}x{height} px; NV12 has even sides")));
        }
        let rows = height + height / 2;
        let layout = Layout { name: "NV12", row_bytes: width, rows, alignment: 1, bottom_up: false };
        Rows::new(image, &layout).map(Self)
    }

    /// Writes an 8-bit RGB picture.
    ///
    /// # Safety
    /// The header's promise: this many bytes are writable, and nobody else uses them during the call.
    pub unsafe fn put(&self, picture: &Plane<u8>) -> Outcome<()> {
        let fill = |row: usize, to: &mut [u8]| {
            for (x, to) in to.iter_mut().enumerate() {
                *to = match row.checked_sub(picture.height) {
                    None => code(luma(picture.pixel(x, row))),
                    Some(pair) => chroma(picture, [x / 2 * 2, 2 * pair], x % 2),
                };
            }
        };
        // SAFETY: the caller's promise.
        unsafe { self.0.write([picture.width, picture.height], fill) }
    }
}

fn luma(rgb: &[u8]) -> f32 {
    0.299 * f32::from(rgb[0]) + 0.587 * f32::from(rgb[1]) + 0.114 * f32::from(rgb[2])
}

fn code(value: f32) -> u8 {
    (value + 0.5).clamp(0.0, 255.0) as u8
}

/// Blue's (0) or red's (1) mean distance from luma over the 2x2 pixels from there on.
fn chroma(picture: &Plane<u8>, [x, y]: [usize; 2], which: usize) -> u8 {
    let (channel, scale) = [(2, 0.564), (0, 0.713)][which];
    let of = |(i, j): (usize, usize)| {
        let rgb = picture.pixel(x + i, y + j);
        f32::from(rgb[channel]) - luma(rgb)
    };
    code(128.0 + scale * 0.25 * [(0, 0), (1, 0), (0, 1), (1, 1)].map(of).iter().sum::<f32>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_has_no_chroma_and_primaries_have_jpegs() {
        let of = |rgb: [u8; 3]| {
            let picture = Plane::from_fn(2, 2, |_, _| rgb);
            [code(luma(&rgb)), chroma(&picture, [0, 0], 0), chroma(&picture, [0, 0], 1)]
        };
        assert_eq!(of([77; 3]), [77, 128, 128]);
        assert_eq!(of([255, 0, 0]), [76, 85, 255]);
        assert_eq!(of([0, 0, 255]), [29, 255, 107]);
        assert_ne!(of([0, 255, 0])[1..], [128, 128], "control");
    }
}
