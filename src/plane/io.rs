//! Picture files in and out. Pictures come from strangers: sizes are checked before memory is spent on them.

use std::io::Cursor;
use std::path::Path;
use std::sync::Once;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::Plane;
use crate::error::{Error, Result};
use crate::files::{Limit, read_as, write_atomic};

/// Largest side of a picture that is read, px.
pub const MAX_SIDE_PX: u32 = 16_384;
/// Most memory that decoding one picture may take, bytes (a PNG bomb asks for more).
pub const MAX_DECODED_BYTES: u64 = 1 << 30;

/// Most pixels of a picture that is read. A copy or two of one with four channels stay below 1 GiB.
pub const MAX_PIXELS: u64 = 1 << 27;

/// Reads a PNG or JPEG as 8-bit RGB, shape `[height, width, 3]`; grey pictures are repeated in all three channels.
///
/// # Errors
/// A file that cannot be read or decoded, that was cut off, or that is larger than [`MAX_SIDE_PX`], [`MAX_PIXELS`] or
/// [`MAX_DECODED_BYTES`].
pub fn read_rgb8(path: &Path) -> Result<Plane<u8>> {
    read_rgb8_as(path, path)
}

/// As [`read_rgb8`]; errors call the file `shown`.
///
/// # Errors
/// As [`read_rgb8`].
pub fn read_rgb8_as(path: &Path, shown: &Path) -> Result<Plane<u8>> {
    let rgb = decode_picture(shown, &read_as(path, shown, Limit::PICTURE)?)?.into_rgb8();
    let (width, height) = rgb.dimensions();
    Ok(Plane { width: width as usize, height: height as usize, channels: 3, data: rgb.into_raw() })
}

/// Most pixels that a byte of a JPEG can hold: each block of 8x8 has at least a bit of its own.
const JPEG_PIXELS_A_BYTE: u64 = 512;

/// Decodes the bytes of a PNG or JPEG; `path` is what errors name. Its size is looked at before memory is spent on it.
///
/// Rows are those of the file, which are the sensor's: an EXIF orientation, by which viewers turn a picture, is not
/// followed. Turned, lines would be read in another order, and pictures of one sensor that was held in two ways would
/// not lie on each other. The first such picture of a run is warned of.
///
/// # Errors
/// As [`read_rgb8`].
pub fn decode_picture(path: &Path, bytes: &[u8]) -> Result<DynamicImage> {
    let bad = |reason: String| Error::Picture { path: path.to_owned(), action: "decode", reason };
    let format = image::guess_format(bytes).ok();
    if !matches!(format, Some(ImageFormat::Png | ImageFormat::Jpeg)) {
        let but = format.map_or_else(String::new, |f| format!(" but {}", format!("{f:?}").to_uppercase()));
        return Err(bad(format!("it is neither PNG nor JPEG{but} (only PNG or JPEG are read)")));
    }
    let mut header =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| bad(e.to_string()))?;
    // Nothing is decoded yet: the size is looked at first.
    header.no_limits();
    let mut header = header.into_decoder().map_err(|e| bad(e.to_string()))?;
    let (width, height) = header.dimensions();
    check_size(path, width, height)?;
    let orientation = header.orientation().unwrap_or(Orientation::NoTransforms);
    if let Some(shown) = shown_as(orientation) {
        static SAID: Once = Once::new();
        SAID.call_once(|| tracing::warn!("{}: {}", path.display(), turned(orientation, shown)));
    }
    // Else some hundred bytes would take the time of the largest picture, and all of it would be made up.
    let too_little = u64::from(width) * u64::from(height) > JPEG_PIXELS_A_BYTE * bytes.len() as u64;
    if format == Some(ImageFormat::Jpeg) && (too_little || !super::jpeg_end::is_whole(bytes)) {
        return Err(bad("it is cut off: the data ends before the picture does".to_owned()));
    }
    let mut reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| bad(e.to_string()))?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_DECODED_BYTES);
    reader.limits(limits);
    reader.decode().map_err(|e| bad(e.to_string()))
}

/// How viewers show a picture of that orientation; nothing where they show it as it is.
fn shown_as(orientation: Orientation) -> Option<&'static str> {
    Some(match orientation {
        Orientation::NoTransforms => return None,
        Orientation::Rotate90 => "turned by 90 degrees to the right",
        Orientation::Rotate180 => "turned by 180 degrees",
        Orientation::Rotate270 => "turned by 90 degrees to the left",
        Orientation::FlipHorizontal => "mirrored",
        Orientation::FlipVertical => "upside down and mirrored",
        Orientation::Rotate90FlipH | Orientation::Rotate270FlipH => "turned by 90 degrees and mirrored",
    })
}

fn turned(orientation: Orientation, shown: &str) -> String {
    format!(
        "by its EXIF orientation ({}) viewers show it {shown}; it is read as it is stored, which is how the sensor \
         delivered it. If the other pictures are upright, turn the pixels of this one and its like (jpegtran -rotate, \
         mogrify -auto-orient). Said of the first such picture",
        orientation.to_exif()
    )
}

fn check_size(path: &Path, width: u32, height: u32) -> Result<()> {
    let pixels = u64::from(width) * u64::from(height);
    if width.max(height) <= MAX_SIDE_PX && pixels <= MAX_PIXELS {
        return Ok(());
    }
    let reason = format!(
        "it has {width}x{height} px, the limit is {MAX_SIDE_PX} px a side and {MAX_PIXELS} px in all"
    );
    Err(Error::Picture { path: path.to_owned(), action: "decode", reason })
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

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(width: u32, height: u32, format: ImageFormat) -> Vec<u8> {
        let picture = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([x as u8, y as u8, 77]));
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, format).expect("encoded");
        bytes.into_inner()
    }

    /// A picture with an EXIF orientation, little endian: APP1 of a JPEG, `eXIf` of a PNG.
    fn marked(format: ImageFormat, orientation: u8) -> Vec<u8> {
        let mut tiff = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".to_vec();
        tiff.extend([orientation, 0, 0, 0, 0, 0, 0, 0]);
        let mut bytes = encoded(64, 48, format);
        let (at, marker) = if format == ImageFormat::Jpeg {
            let body = [b"Exif\0\0".as_slice(), &tiff].concat();
            let head = [0xff, 0xe1, 0, (body.len() + 2) as u8];
            (2, [head.as_slice(), &body].concat())
        } else {
            let body = [b"eXIf".as_slice(), &tiff].concat();
            let crc = crc32(&body).to_be_bytes();
            // Behind the signature and the header.
            (33, [(tiff.len() as u32).to_be_bytes().as_slice(), &body, &crc].concat())
        };
        bytes.splice(at..at, marker);
        bytes
    }

    fn crc32(bytes: &[u8]) -> u32 {
        let step = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
        !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
    }

    #[test]
    fn a_picture_that_viewers_turn_is_read_as_it_is_stored_and_known() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg] {
            let told = |orientation: u8| {
                let bytes = marked(format, orientation);
                let read = decode_picture(Path::new("a"), &bytes).expect("it is whole");
                assert_eq!([read.width(), read.height()], [64, 48], "{orientation}");
                let mut decoder =
                    ImageReader::with_format(Cursor::new(bytes), format).into_decoder().expect("it is whole");
                let orientation = decoder.orientation().expect("it has one");
                shown_as(orientation).map(|shown| turned(orientation, shown))
            };
            for (orientation, shown) in
                [(3, "by 180 degrees"), (6, "to the right"), (8, "to the left"), (2, "mirrored")]
            {
                let said = told(orientation).expect("viewers turn it");
                assert!(
                    said.contains(&format!("orientation ({orientation})")) && said.contains(shown),
                    "{said}"
                );
            }
            // Controls: upright, and numbers that mean nothing.
            for upright in [1, 0, 9] {
                assert_eq!(told(upright), None, "{upright}");
            }
        }
    }

    #[test]
    fn a_picture_that_was_cut_off_is_refused_and_one_with_more_behind_it_is_not() {
        let decode = |bytes: &[u8]| decode_picture(Path::new("a"), bytes).map(|p| p.width());
        for format in [ImageFormat::Png, ImageFormat::Jpeg] {
            let whole = encoded(64, 48, format);
            assert_eq!(decode(&whole).expect("whole"), 64);
            for share in [40, 60, 80, 95] {
                let error = decode(&whole[..whole.len() * share / 100]).expect_err("cut off").to_string();
                assert!(error.starts_with("a: cannot decode"), "{error}");
            }
        }
        // The same bytes with a larger size in the header, and an end.
        let mut claims = encoded(64, 48, ImageFormat::Jpeg);
        let frame = claims.windows(2).position(|w| w == [0xff, 0xc0]).expect("a frame");
        claims[frame + 5..frame + 9].copy_from_slice(&[8, 16, 26, 24]);
        let error = decode(&claims).expect_err("of 13 megapixels").to_string();
        assert!(error.contains("the data ends before the picture does"), "{error}");
        // Control: the least that a picture takes.
        let even = image::GrayImage::from_pixel(4000, 3000, image::Luma([128]));
        let mut bytes = Cursor::new(Vec::new());
        even.write_to(&mut bytes, ImageFormat::Jpeg).expect("encoded");
        assert_eq!(decode(&bytes.into_inner()).expect("whole"), 4000);
        let mut more = encoded(64, 48, ImageFormat::Jpeg);
        more.extend(b"what a phone puts behind it");
        assert_eq!(decode(&more).expect("whole"), 64);
        let other = decode(b"GIF89a").expect_err("no picture that is read").to_string();
        assert!(other.contains("PNG or JPEG"), "{other}");
    }

    #[test]
    fn a_picture_of_another_format_is_named() {
        let said = |bytes: &[u8]| decode_picture(Path::new("a.png"), bytes).expect_err("none").to_string();
        for (bytes, name) in [(&b"II*\0........"[..], "JPEG but TIFF"), (b"GIF89a......", "JPEG but GIF")] {
            assert!(said(bytes).contains(name), "{}", said(bytes));
        }
        assert!(said(b"nothing that is known").contains("JPEG (only"), "{}", said(b"nothing that is known"));
    }

    #[test]
    fn a_size_is_refused_before_it_is_decoded() {
        let path = Path::new("a");
        assert!(check_size(path, 16_000, 8_000).is_ok() && check_size(path, 1, 1).is_ok());
        for (width, height) in [(16_000, 16_000), (16_385, 1), (1, u32::MAX)] {
            let error = check_size(path, width, height).expect_err("too large").to_string();
            assert!(error.contains(&format!("{width}x{height} px")) && error.contains("16384"), "{error}");
        }
    }
}
