//! Picture files in and out. Pictures come from strangers: sizes are checked before memory is spent on them.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use image::{ImageReader, Limits};

use super::Plane;
use crate::error::{Error, Result};

/// Largest side of a picture that is read, px.
pub const MAX_SIDE_PX: u32 = 16_384;
/// Most memory that decoding one picture may take, bytes (a PNG bomb asks for more).
pub const MAX_DECODED_BYTES: u64 = 1 << 30;

/// Reads a PNG or JPEG as 8-bit RGB, shape `[height, width, 3]`; grey pictures are repeated in all three channels.
///
/// # Errors
/// A file that cannot be read or decoded, or that is larger than [`MAX_SIDE_PX`] or [`MAX_DECODED_BYTES`].
pub fn read_rgb8(path: &Path) -> Result<Plane<u8>> {
    let bytes = fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    let bad = |reason: String| Error::Picture { path: path.to_owned(), action: "decode", reason };
    let mut reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| bad(e.to_string()))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE_PX);
    limits.max_image_height = Some(MAX_SIDE_PX);
    limits.max_alloc = Some(MAX_DECODED_BYTES);
    reader.limits(limits);
    let rgb = reader.decode().map_err(|e| bad(e.to_string()))?.into_rgb8();
    let (width, height) = rgb.dimensions();
    Ok(Plane { width: width as usize, height: height as usize, channels: 3, data: rgb.into_raw() })
}

/// Writes an 8-bit PNG (1, 3 or 4 channels) under a temporary name and renames it: a file with the final name is whole.
///
/// # Errors
/// A file that cannot be written (a full disk, a missing folder).
///
/// # Panics
/// If the plane has another number of channels.
pub fn write_png_atomic(path: &Path, plane: &Plane<u8>) -> Result<()> {
    let kind = match plane.channels {
        1 => image::ExtendedColorType::L8,
        3 => image::ExtendedColorType::Rgb8,
        4 => image::ExtendedColorType::Rgba8,
        n => panic!("a PNG has 1, 3 or 4 channels, not {n}"),
    };
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, &plane.data, plane.width as u32, plane.height as u32, kind)
        .map_err(|e| Error::Picture { path: path.to_owned(), action: "encode", reason: e.to_string() })?;
    write_atomic(path, &bytes)
}

/// Writes `bytes` to `path` by way of a temporary file in the same folder; nothing half-written keeps the final name.
///
/// # Errors
/// A file that cannot be written; the temporary file is removed.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".partial");
    let partial = path.with_file_name(name);
    let written = fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, path));
    written.map_err(|e| {
        // The first error is the one to report; a leftover that cannot be removed either adds nothing to it.
        let _ = fs::remove_file(&partial);
        Error::io(path, "write", e)
    })
}
