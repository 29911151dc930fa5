//! Delivered pictures of more than 8 bits: 16-bit values, linear floats, and the converter's raw numbers.

use super::image::{BOTTOM_UP, View};
use super::rows::{Layout, Rows};
use super::status::{self, Fault, Outcome};
use super::types::shutterbug_image;
use crate::engine::Frame;
use crate::plane::{PixelFormat, Plane, RawLayout, digital_number, srgb_decode};

/// Formats of a delivered picture with values of 16 bits: their numbers in the header, and channels.
const WIDE: [(u32, usize); 2] = [(13, 3), (14, 4)];

/// Formats of a raw picture: their numbers in the header, and what they are called.
const RAW: [(u32, RawLayout, &str); 7] = [
    (15, RawLayout::Words(10), "BAYER10"),
    (16, RawLayout::Words(12), "BAYER12"),
    (17, RawLayout::Words(14), "BAYER14"),
    (18, RawLayout::Words(16), "BAYER16"),
    (19, RawLayout::Mipi10, "MIPI_RAW10"),
    (20, RawLayout::Mipi12, "MIPI_RAW12"),
    (21, RawLayout::Mipi14, "MIPI_RAW14"),
];

/// Whether a picture is asked for in a format that has more than 8 bits.
pub(super) fn wanted(image: &shutterbug_image) -> bool {
    let format = image.format & !BOTTOM_UP;
    let floats = [PixelFormat::Rgba16f as u32, PixelFormat::Rgba32f as u32];
    floats.contains(&format) || WIDE.iter().any(|(code, _)| *code == format)
}

/// Writes the delivered picture in one of those formats.
///
/// # Safety
/// The header's promise for `image`.
pub(super) unsafe fn put_picture(image: &shutterbug_image, frame: &Frame) -> Outcome<()> {
    let Some(values) = &frame.values else {
        let text = "the frame was submitted without SHUTTERBUG_REQUEST_FINE or SHUTTERBUG_OUTSIDE_FINE";
        return Err(Fault::new(status::STATE, text));
    };
    let format = image.format & !BOTTOM_UP;
    let Some((_, channels)) = WIDE.iter().find(|(code, _)| *code == format) else {
        let formats = [PixelFormat::Rgba32f, PixelFormat::Rgba16f];
        // SAFETY: the caller's promise.
        return unsafe { View::new(image, "image")?.put_floats(&linear(values), formats, "picture") };
    };
    let layout = Layout {
        name: "a picture of 16 bits",
        row_bytes: u64::from(image.width) * 2 * *channels as u64,
        rows: u64::from(image.height),
        alignment: 2,
        bottom_up: image.format & BOTTOM_UP != 0,
    };
    let fill = |y: usize, to: &mut [u8]| {
        for (from, to) in values.row(y).chunks_exact(4).zip(to.chunks_exact_mut(2 * channels)) {
            for (c, to) in to.chunks_exact_mut(2).enumerate() {
                let number = if c == 3 { u16::MAX } else { digital_number(from[c], 16) };
                to.copy_from_slice(&number.to_le_bytes());
            }
        }
    };
    // SAFETY: the caller's promise.
    unsafe { Rows::new(image, &layout)?.write([values.width, values.height], fill) }
}

/// The light that a display makes of encoded values, alpha 1.
fn linear(values: &Plane<f32>) -> Plane<f32> {
    let mut out = values.clone();
    for pixel in out.data.chunks_exact_mut(4) {
        pixel[..3].iter_mut().for_each(|v| *v = srgb_decode(v.clamp(0.0, 1.0)));
        pixel[3] = 1.0;
    }
    out
}

/// Writes what the converter delivers.
///
/// # Safety
/// The header's promise for `image`.
pub(super) unsafe fn put_raw(image: &shutterbug_image, frame: &Frame) -> Outcome<()> {
    let Some((_, raw, name)) = RAW.iter().find(|(code, ..)| *code == image.format) else {
        let text =
            format!("SHUTTERBUG_RAW is had as BAYER10 to 16 or MIPI_RAW10 to 14, not {:#x}", image.format);
        return Err(Fault::new(status::FORMAT, text));
    };
    let [pixels, bytes] = raw.group().map(|n| n as u64);
    if !u64::from(image.width).is_multiple_of(pixels) {
        let text = format!("image: {name} has widths that are multiples of {pixels}, not {} px", image.width);
        return Err(Fault::argument(text));
    }
    let layout = Layout {
        name,
        row_bytes: u64::from(image.width) / pixels * bytes,
        rows: u64::from(image.height),
        alignment: if matches!(raw, RawLayout::Words(_)) { 2 } else { 1 },
        bottom_up: false,
    };
    let rows = Rows::new(image, &layout)?;
    let Some(values) = &frame.raw else {
        let text = "the frame was submitted without SHUTTERBUG_REQUEST_RAW or SHUTTERBUG_OUTSIDE_RAW";
        return Err(Fault::new(status::STATE, text));
    };
    // SAFETY: the caller's promise.
    unsafe { rows.write([values.width, values.height], |y, to| raw.put(values.row(y), to)) }
}
