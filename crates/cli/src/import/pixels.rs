//! Pictures of a log as files: values bit for bit as PNG, JPEG and PNG as they are. Sizes are held against what is
//! there before anything is allocated.

use std::path::Path;

use image::ExtendedColorType;

use super::contents::Body;
use super::wire::Fault;
use shutterbug::plane::{MAX_PIXELS, MAX_SIDE_PX, decode_picture};

/// A picture as a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PictureFile {
    /// "png" or "jpg".
    pub(super) ending: &'static str,
    pub(super) bytes: Vec<u8>,
    /// Columns and rows, px.
    pub(super) size: [u32; 2],
}

/// How the values of an encoding lie.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Layout {
    /// Values a pixel, as recorded.
    channels: usize,
    /// Bytes a value.
    bytes: usize,
    /// Blue comes first.
    swapped: bool,
    shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Plain,
    /// Two pixels share their colour: luma first, or colour first.
    Shared {
        luma_first: bool,
    },
}

/// Names that are read, for errors.
const KNOWN: &str = "rgb8, bgr8, rgba8, bgra8, mono8, mono16, rgb16, bgr16, bayer_*8, bayer_*16, 8UC1, 8UC3, 16UC1, \
    yuv422, yuv422_yuy2";

fn layout(encoding: &str) -> Option<Layout> {
    let plain = |channels, bytes, swapped| Some(Layout { channels, bytes, swapped, shape: Shape::Plain });
    let shared = |luma_first| {
        Some(Layout { channels: 2, bytes: 1, swapped: false, shape: Shape::Shared { luma_first } })
    };
    match encoding {
        "rgb8" => plain(3, 1, false),
        // OpenCV's order, where nothing is said.
        "bgr8" | "8UC3" => plain(3, 1, true),
        "rgba8" => plain(4, 1, false),
        "bgra8" | "8UC4" => plain(4, 1, true),
        "mono8" | "8UC1" => plain(1, 1, false),
        "mono16" | "16UC1" => plain(1, 2, false),
        "rgb16" => plain(3, 2, false),
        "bgr16" | "16UC3" => plain(3, 2, true),
        "yuv422" | "uyvy" => shared(false),
        "yuv422_yuy2" | "yuyv" => shared(true),
        _ if mosaic(encoding).is_some() => plain(1, if encoding.ends_with("16") { 2 } else { 1 }, false),
        _ => None,
    }
}

/// The colours of the upper left 2x2 pixels of a mosaic.
pub(super) fn mosaic(encoding: &str) -> Option<String> {
    let colors = encoding.strip_prefix("bayer_")?;
    let colors = colors.strip_suffix("8").or_else(|| colors.strip_suffix("16"))?;
    ["rggb", "bggr", "grbg", "gbrg"].contains(&colors).then(|| colors.to_uppercase())
}

/// What a user should know of an encoding.
pub(super) fn note(encoding: &str) -> Option<String> {
    if let Some(pattern) = mosaic(encoding) {
        return Some(format!(
            "pictures are {encoding}: frames hold the mosaic ({pattern}), one colour a pixel, in grey"
        ));
    }
    let layout = layout(encoding)?;
    if matches!(layout.shape, Shape::Shared { .. }) {
        return Some(format!("pictures are {encoding}: turned into RGB by BT.601 (16 to 235), as ROS does"));
    }
    match encoding {
        "8UC3" | "8UC4" | "16UC3" => {
            Some(format!("pictures are {encoding}: taken as blue, green, red, OpenCV's order"))
        }
        "16UC1" => Some("pictures are 16UC1: is this depth?".to_owned()),
        "rgba8" | "bgra8" => Some(format!("pictures are {encoding}: alpha is left out")),
        _ => None,
    }
}

/// Width and height of a picture; its values are not decoded.
pub(super) fn size_px(body: &Body<'_>) -> Result<[u32; 2], Fault> {
    match body {
        Body::Raw { width, height, .. } => Ok([*width, *height]),
        Body::Packed { data, format } => {
            let reader = image::ImageReader::new(std::io::Cursor::new(&**data)).with_guessed_format();
            let size = reader.ok().and_then(|r| r.into_dimensions().ok());
            size.map(|(w, h)| [w, h]).ok_or_else(|| not_packed(format, data))
        }
    }
}

fn not_packed(format: &str, data: &[u8]) -> Fault {
    let found = format!("a picture of {} bytes in the format `{}`", data.len(), super::shortened(format));
    let expected = if format.contains("compressedDepth") { "a picture, not depth" } else { "JPEG or PNG" };
    Fault::new(found, expected)
}

/// The picture as a file.
pub(super) fn file_of(body: &Body<'_>) -> Result<PictureFile, Fault> {
    match body {
        Body::Packed { format, data } => packed(format, data),
        Body::Raw { width, height, encoding, big_endian, step, data } => {
            raw([*width, *height], encoding, *big_endian, *step as usize, data)
        }
    }
}

/// The bytes stay as they are: what the coder did to the picture is to be diagnosed. It is decoded once, to be sure.
fn packed(format: &str, data: &[u8]) -> Result<PictureFile, Fault> {
    let ending = match image::guess_format(data) {
        Ok(image::ImageFormat::Png) => "png",
        Ok(image::ImageFormat::Jpeg) => "jpg",
        _ => return Err(not_packed(format, data)),
    };
    let picture = decode_picture(Path::new("picture"), data)
        .map_err(|e| Fault::new(format!("a picture that does not decode ({e})"), "a whole JPEG or PNG"))?;
    Ok(PictureFile { ending, bytes: data.to_vec(), size: [picture.width(), picture.height()] })
}

/// Whether a picture can be made of a message, as far as that is seen without its values.
pub(super) fn check(body: &Body<'_>) -> Result<(), Fault> {
    match body {
        Body::Raw { width, height, encoding, step, data, .. } => {
            checked([*width, *height], encoding, *step as usize, data).map(|_| ())
        }
        Body::Packed { .. } => size_px(body).map(|_| ()),
    }
}

/// How the values lie, and bytes of a row.
fn checked(
    [width, height]: [u32; 2],
    encoding: &str,
    step: usize,
    data: &[u8],
) -> Result<(Layout, usize), Fault> {
    let Some(layout) = layout(encoding) else {
        let found = format!("the encoding `{}`", super::shortened(encoding));
        return Err(Fault::new(found, format!("one of {KNOWN}")));
    };
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || width.max(height) > MAX_SIDE_PX || pixels > MAX_PIXELS {
        let expected = format!("1 to {MAX_SIDE_PX} px a side and at most {MAX_PIXELS} px");
        return Err(Fault::new(format!("a picture of {width}x{height} px"), expected));
    }
    let (width, height) = (width as usize, height as usize);
    let row = width * layout.channels * layout.bytes;
    let odd = matches!(layout.shape, Shape::Shared { .. }) && width % 2 == 1;
    // The last row need not be padded.
    let needed = step.checked_mul(height - 1).and_then(|n| n.checked_add(row));
    if odd || step < row || needed.is_none_or(|n| n > data.len()) {
        let found = format!("{} bytes, {step} a row, for {width}x{height} px in {encoding}", data.len());
        return Err(Fault::new(found, format!("at least {row} bytes a row and all rows")));
    }
    Ok((layout, row))
}

fn raw(
    [width, height]: [u32; 2],
    encoding: &str,
    big_endian: bool,
    step: usize,
    data: &[u8],
) -> Result<PictureFile, Fault> {
    let (layout, row) = checked([width, height], encoding, step, data)?;
    let height = height as usize;
    let mut values = Vec::with_capacity(height * row);
    for y in 0..height {
        append_row(&data[y * step..][..row], layout, big_endian, &mut values);
    }
    let grey = layout.channels == 1;
    let color = match (grey, layout.bytes) {
        (true, 1) => ExtendedColorType::L8,
        (true, _) => ExtendedColorType::L16,
        (false, 1) => ExtendedColorType::Rgb8,
        (false, _) => ExtendedColorType::Rgb16,
    };
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, &values, width, height as u32, color)
        .map_err(|e| Fault::new(format!("a picture that cannot be written as PNG ({e})"), "one that can"))?;
    Ok(PictureFile { ending: "png", bytes, size: [width, height as u32] })
}

/// A row as grey or red, green, blue; values of two bytes in the machine's order.
fn append_row(row: &[u8], layout: Layout, big_endian: bool, into: &mut Vec<u8>) {
    if let Shape::Shared { luma_first } = layout.shape {
        for four in row.as_chunks::<4>().0 {
            let [y0, u, y1, v] = if luma_first { *four } else { [four[1], four[0], four[3], four[2]] };
            into.extend(rgb_of([y0, u, v]));
            into.extend(rgb_of([y1, u, v]));
        }
        return;
    }
    let kept = layout.channels.min(3);
    for pixel in row.chunks_exact(layout.channels * layout.bytes) {
        for place in 0..kept {
            let channel = if layout.swapped { kept - 1 - place } else { place };
            match pixel[channel * layout.bytes..][..layout.bytes] {
                [a, b] => {
                    let value =
                        if big_endian { u16::from_be_bytes([a, b]) } else { u16::from_le_bytes([a, b]) };
                    into.extend(value.to_ne_bytes());
                }
                ref one => into.extend(one),
            }
        }
    }
}

/// BT.601 with 16 to 235, as OpenCV has it.
fn rgb_of([y, u, v]: [u8; 3]) -> [u8; 3] {
    let (y, u, v) = (1.164 * (f32::from(y) - 16.0), f32::from(u) - 128.0, f32::from(v) - 128.0);
    [y + 1.596 * v, y - 0.813 * v - 0.391 * u, y + 2.018 * u].map(|c| c.round().clamp(0.0, 255.0) as u8)
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use super::*;

    fn body<'a>(encoding: &str, size: [u32; 2], step: u32, data: &'a [u8]) -> Body<'a> {
        let (encoding, data) = (encoding.to_owned(), Cow::Borrowed(data));
        Body::Raw { width: size[0], height: size[1], encoding, big_endian: false, step, data }
    }

    fn decoded(encoding: &str, size: [u32; 2], step: u32, data: &[u8]) -> image::DynamicImage {
        let file = file_of(&body(encoding, size, step, data)).unwrap_or_else(|e| panic!("{encoding}: {e:?}"));
        decode_picture(Path::new("x"), &file.bytes).expect("a picture")
    }

    #[test]
    fn values_come_out_bit_for_bit() {
        let bytes: Vec<u8> = (0..12).collect();
        // Two rows of two pixels; a row padded by a byte.
        let padded: Vec<u8> = [&bytes[..6], &[99], &bytes[6..]].concat();
        assert_eq!(decoded("rgb8", [2, 2], 7, &padded).into_rgb8().into_raw(), bytes);
        let swapped = decoded("bgr8", [2, 2], 6, &bytes).into_rgb8().into_raw();
        assert_eq!(swapped[..6], [2, 1, 0, 5, 4, 3]);
        assert_eq!(decoded("mono8", [4, 3], 4, &bytes).into_luma8().into_raw(), bytes);
        assert_eq!(decoded("bayer_grbg8", [4, 3], 4, &bytes).into_luma8().into_raw(), bytes);
        let wide = decoded("mono16", [3, 2], 6, &bytes).into_luma16().into_raw();
        assert_eq!(wide[..3], [0x0100, 0x0302, 0x0504]);
        assert_eq!(decoded("rgba8", [3, 1], 12, &bytes).into_rgb8().into_raw(), [0, 1, 2, 4, 5, 6, 8, 9, 10]);
    }

    #[test]
    fn shared_colour_is_turned_into_rgb() {
        let grey = decoded("yuv422_yuy2", [2, 1], 4, &[16, 128, 235, 128]).into_rgb8().into_raw();
        assert_eq!(grey, [0, 0, 0, 255, 255, 255]);
        let red = decoded("yuv422", [2, 1], 4, &[90, 81, 240, 81]).into_rgb8().into_raw();
        assert!(red[0] > 250 && red[1] < 5 && red[2] < 5, "{red:?}");
    }

    #[test]
    fn sizes_are_refused_before_memory_is_spent() {
        let refused = |encoding: &str, size, step| {
            let fault = file_of(&body(encoding, size, step, &[0; 12])).expect_err("refused");
            format!("{} / {}", fault.found, fault.expected)
        };
        assert!(refused("rgb8", [60_000, 60_000], 180_000).contains("a picture of 60000x60000 px"));
        assert!(refused("rgb8", [0, 5], 0).contains("0x5"));
        assert!(refused("rgb8", [2, 3], 6).contains("12 bytes, 6 a row, for 2x3 px"));
        assert!(refused("rgb8", [2, 2], 5).contains("at least 6 bytes a row"));
        assert!(refused("mono8", [2, 2], u32::MAX).contains("4294967295 a row"));
        assert!(refused("32FC1", [1, 1], 4).contains("the encoding `32FC1`"));
        assert!(refused("yuv422", [3, 1], 6).contains("3x1"));
        let packed = Body::Packed { format: "h264".to_owned(), data: Cow::Borrowed(&[0, 0, 1]) };
        assert!(file_of(&packed).expect_err("refused").found.contains("`h264`"));
    }
}
