//! OpenEXR in and out: planes of 32-bit floats that must come back bit for bit (motion, depth, linear colour).

use std::io::Cursor;
use std::path::Path;

use ::exr::prelude::*;

use super::io::{MAX_DECODED_BYTES, MAX_SIDE_PX};
use crate::error::Error;
use crate::files::{self, Limit, write_atomic};

/// Channels of a motion plane: px moved over one frame interval, from this frame to the next.
pub const MOTION_CHANNELS: [&str; 2] = ["forward.u", "forward.v"];
/// Channel of a depth plane: metres along the optical axis.
pub const DEPTH_CHANNELS: [&str; 1] = ["Z"];
/// Channels of a colour plane: linear radiance.
pub const COLOR_CHANNELS: [&str; 3] = ["R", "G", "B"];

/// What an EXR file holds: named channels of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrPicture {
    /// Columns, px.
    pub width: usize,
    /// Rows, px.
    pub height: usize,
    /// Name and `height * width` values of each channel, top row first, in the file's (alphabetic) order.
    pub channels: Vec<(String, Vec<f32>)>,
}

/// Writes named channels (`height * width` values each, top row first) as 32-bit floats, compressed without loss, by
/// way of a temporary name: a file with the final name is whole.
///
/// # Errors
/// A file that cannot be encoded or written.
///
/// # Panics
/// If there is no channel or pixel, a channel has another number of values, or a name stands twice.
pub fn write_exr_atomic(
    path: &Path,
    width: usize,
    height: usize,
    channels: &[(&str, &[f32])],
) -> crate::Result<()> {
    assert!(width > 0 && height > 0 && !channels.is_empty(), "an EXR file needs a channel and a pixel");
    let mut list = SmallVec::new();
    for (index, (name, values)) in channels.iter().enumerate() {
        assert_eq!(values.len(), width * height, "channel {name} of a {width}x{height} picture");
        assert!(channels[..index].iter().all(|(other, _)| other != name), "channel {name} stands twice");
        list.push(AnyChannel::new(*name, FlatSamples::F32(values.to_vec())));
    }
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::SMALL_LOSSLESS };
    let layer = Layer::new((width, height), LayerAttributes::default(), encoding, AnyChannels::sort(list));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .map_err(|e| fault(path, "encode", e.to_string()))?;
    write_atomic(path, bytes.get_ref())
}

/// Reads the first layer of an EXR file at its full resolution. Half floats and integers become `f32`.
///
/// # Errors
/// A file that cannot be read or decoded, deep data, or a picture larger than [`MAX_SIDE_PX`] or
/// [`MAX_DECODED_BYTES`].
pub fn read_exr(path: &Path) -> crate::Result<ExrPicture> {
    let bytes = files::read(path, Limit::PICTURE)?;
    check_size(path, &bytes)?;
    let reader = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    let image = reader.all_attributes().from_buffered(Cursor::new(bytes));
    let layer = image.map_err(|e| fault(path, "decode", e.to_string()))?.layer_data;
    let (width, height) = (layer.size.x(), layer.size.y());
    let mut channels = Vec::new();
    for channel in layer.channel_data.list {
        let values: Vec<f32> = match channel.sample_data {
            FlatSamples::F32(values) => values,
            FlatSamples::F16(values) => values.into_iter().map(f16::to_f32).collect(),
            FlatSamples::U32(values) => values.into_iter().map(|v| v as f32).collect(),
        };
        if values.len() != width * height {
            let reason = format!("channel {} has not one value a pixel", channel.name);
            return Err(fault(path, "decode", reason));
        }
        channels.push((channel.name.to_string(), values));
    }
    Ok(ExrPicture { width, height, channels })
}

/// Writes a plane with one name a channel: [`MOTION_CHANNELS`], [`DEPTH_CHANNELS`], [`COLOR_CHANNELS`].
///
/// # Errors
/// As [`write_exr_atomic`].
///
/// # Panics
/// If the plane is empty or has another number of channels than names.
pub fn write_exr_plane(path: &Path, plane: &super::Plane<f32>, names: &[&str]) -> crate::Result<()> {
    assert_eq!(plane.channels, names.len(), "names for the channels of a plane");
    let planar: Vec<Vec<f32>> = (0..plane.channels)
        .map(|c| plane.data.iter().skip(c).step_by(plane.channels).copied().collect())
        .collect();
    let channels: Vec<(&str, &[f32])> = names.iter().copied().zip(planar.iter().map(Vec::as_slice)).collect();
    write_exr_atomic(path, plane.width, plane.height, &channels)
}

/// Reads the named channels of an EXR file, in the order of the names: shape `[height, width, names]`.
///
/// # Errors
/// As [`read_exr`]; a channel that is not there, naming those that are.
pub fn read_exr_plane(path: &Path, names: &[&str]) -> crate::Result<super::Plane<f32>> {
    let picture = read_exr(path)?;
    let mut plane = super::Plane::new(picture.width, picture.height, names.len());
    for (c, name) in names.iter().enumerate() {
        let Some((_, values)) = picture.channels.iter().find(|(n, _)| n == name) else {
            let present: Vec<_> = picture.channels.iter().map(|(n, _)| n.as_str()).collect();
            return Err(Error::input(
                path,
                None,
                format!("channels {}", present.join(", ")),
                format!("channel {name}"),
            ));
        };
        for (pixel, value) in plane.data.iter_mut().skip(c).step_by(names.len()).zip(values) {
            *pixel = *value;
        }
    }
    Ok(plane)
}

/// How many times its size a file can unfold at most: deflate packs 1032 to 1, and PXR24 leaves a byte of four out
/// before.
const MAX_EXPANSION: u64 = 1500;

/// Looks at the header alone, before memory is spent on pixels.
fn check_size(path: &Path, bytes: &[u8]) -> crate::Result<()> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false);
    let meta = meta.map_err(|e| fault(path, "decode", e.to_string()))?;
    for header in &meta.headers {
        let (width, height) = (header.layer_size.x(), header.layer_size.y());
        let largest = width.max(height);
        if largest > MAX_SIDE_PX as usize {
            let reason = format!("{width}x{height} px, the limit is {MAX_SIDE_PX} px a side");
            return Err(fault(path, "decode", reason));
        }
        // Decoded to f32, whatever the file's own type.
        let size = width as u64 * height as u64 * header.channels.list.len() as u64 * 4;
        if size > MAX_DECODED_BYTES {
            let reason = format!("{size} bytes when decoded, the limit is {MAX_DECODED_BYTES}");
            return Err(fault(path, "decode", reason));
        }
        // Else some bytes would take as much memory and time as the largest picture, before it shows that there is
        // nothing behind.
        if size > MAX_EXPANSION * bytes.len() as u64 {
            let reason = format!("{size} bytes when decoded cannot be in a file of {}", bytes.len());
            return Err(fault(path, "decode", reason));
        }
    }
    Ok(())
}

fn fault(path: &Path, action: &'static str, reason: String) -> Error {
    Error::Picture { path: path.to_owned(), action, reason }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Plane;
    use proptest::prelude::{ProptestConfig, any, prop_assert, proptest};

    /// Values that a lossy or clamping codec would change.
    fn awkward(count: usize) -> Vec<f32> {
        let special = [
            0.0,
            -0.0,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MIN_POSITIVE,
            1e-45,
            f32::MAX,
            -1.0 / 3.0,
            65_505.0,
        ];
        (0..count)
            .map(|i| special[i % special.len()] * if i < special.len() { 1.0 } else { 0.999_999_9 })
            .collect()
    }

    fn bits(values: &[f32]) -> Vec<u32> {
        values.iter().map(|v| v.to_bits()).collect()
    }

    #[test]
    fn every_bit_comes_back() {
        let folder = tempfile::tempdir().expect("a folder");
        // Odd sizes, and more rows than one block of the compression holds (16).
        for (width, height) in [(1, 1), (7, 5), (33, 37)] {
            let path = folder.path().join("a.exr");
            let mut u = awkward(width * height);
            u[0] = f32::from_bits(0x7fc1_2345);
            let v: Vec<f32> = (0..width * height).map(|i| i as f32 * 0.1 - 3.0).collect();
            // Not in alphabetic order, in which the file holds them.
            write_exr_atomic(&path, width, height, &[("forward.v", &v), ("forward.u", &u)]).expect("written");
            let read = read_exr(&path).expect("read");
            assert_eq!((read.width, read.height), (width, height));
            assert_eq!(read.channels.iter().map(|(n, _)| n.as_str()).collect::<Vec<_>>(), MOTION_CHANNELS);
            assert_eq!(bits(&read.channels[0].1), bits(&u));
            assert_eq!(bits(&read.channels[1].1), bits(&v));
            // Control: the comparison sees one changed bit.
            let mut other = u.clone();
            other[0] = f32::from_bits(0x7fc1_2344);
            assert_ne!(bits(&read.channels[0].1), bits(&other));
        }
        let names: Vec<_> = std::fs::read_dir(folder.path())
            .expect("listed")
            .map(|e| e.expect("entry").file_name())
            .collect();
        assert_eq!(names, ["a.exr"], "no temporary file is left");
    }

    #[test]
    fn the_planes_of_the_contract_keep_their_channels() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("000000.exr");
        let color = Plane::from_fn(5, 4, |x, y| [x as f32, y as f32 + 0.25, (x * y) as f32 - 1.5]);
        write_exr_plane(&path, &color, &COLOR_CHANNELS).expect("written");
        assert_eq!(read_exr_plane(&path, &COLOR_CHANNELS).expect("read"), color);
        // Control: red and blue are not taken for each other (the file's order is B G R).
        assert_ne!(read_exr_plane(&path, &["B", "G", "R"]).expect("read"), color);
        let motion = Plane::from_fn(3, 2, |x, y| [x as f32 - 0.5, y as f32]);
        write_exr_plane(&path, &motion, &MOTION_CHANNELS).expect("replaced");
        assert_eq!(read_exr_plane(&path, &MOTION_CHANNELS).expect("read"), motion);
        let error = read_exr_plane(&path, &DEPTH_CHANNELS).expect_err("no depth").to_string();
        assert!(
            error.ends_with("000000.exr: found channels forward.u, forward.v; expected channel Z"),
            "{error}"
        );
    }

    #[test]
    fn half_floats_are_widened() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("half.exr");
        let image = Image::from_channels(
            (2, 1),
            AnyChannels::sort(SmallVec::from_vec(vec![
                AnyChannel::new("Z", FlatSamples::F16(vec![f16::from_f32(1.5), f16::from_f32(-2.25)])),
                AnyChannel::new("id", FlatSamples::U32(vec![7, 9])),
            ])),
        );
        image.write().to_file(&path).expect("written");
        assert_eq!(read_exr_plane(&path, &["Z", "id"]).expect("read").data, [1.5, 7.0, -2.25, 9.0]);
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("none/a.exr");
        for error in [
            write_exr_atomic(&path, 1, 1, &[("Z", &[1.0])]).expect_err("no folder"),
            read_exr(&path).expect_err("no file"),
        ] {
            assert!(error.to_string().contains("none/a.exr: cannot "), "{error}");
        }
    }

    #[test]
    fn a_size_that_no_file_holds_is_refused_before_memory_is_spent() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("bomb.exr");
        write_exr_atomic(&path, 4, 4, &[("Z", &[1.0; 16])]).expect("written");
        let whole = std::fs::read(&path).expect("read");
        let refused = |right: i32, bottom: i32| {
            let mut bytes = whole.clone();
            for name in [&b"dataWindow\0box2i\0"[..], &b"displayWindow\0box2i\0"[..]] {
                let at = bytes.windows(name.len()).position(|w| w == name).expect("in the header")
                    + name.len()
                    + 4;
                bytes[at + 8..at + 12].copy_from_slice(&right.to_le_bytes());
                bytes[at + 12..at + 16].copy_from_slice(&bottom.to_le_bytes());
            }
            std::fs::write(&path, &bytes).expect("written");
            read_exr(&path).expect_err("too large").to_string()
        };
        let error = refused(1_000_000, 3);
        assert!(
            error.contains("bomb.exr: cannot decode the picture: 1000001x4 px, the limit is 16384"),
            "{error}"
        );
        // Within the limits of a picture, but not of what some hundred bytes can hold.
        let error = refused(11_999, 7_999);
        let size = format!("384000000 bytes when decoded cannot be in a file of {}", whole.len());
        assert!(error.contains(&size), "{error}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]
        #[test]
        #[cfg_attr(miri, ignore = "512 files")]
        fn damaged_files_are_refused_or_read_but_never_panic(
            at in any::<proptest::sample::Index>(),
            byte: u8,
            cut in any::<proptest::sample::Index>(),
            truncate: bool,
        ) {
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().join("damaged.exr");
            write_exr_atomic(&path, 9, 20, &[("Z", &awkward(180))]).expect("written");
            let mut bytes = std::fs::read(&path).expect("read");
            let at = at.index(bytes.len());
            bytes[at] = byte;
            if truncate {
                bytes.truncate(cut.index(bytes.len()));
            }
            std::fs::write(&path, &bytes).expect("written");
            if let Err(error) = read_exr(&path) {
                prop_assert!(error.to_string().contains("damaged.exr"), "{}", error);
            }
        }

        #[test]
        fn bytes_that_are_no_exr_are_refused(bytes: Vec<u8>) {
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().join("noise.exr");
            std::fs::write(&path, &bytes).expect("written");
            let error = read_exr(&path).expect_err("noise").to_string();
            prop_assert!(error.contains("noise.exr: cannot decode the picture"), "{}", error);
        }
    }
}
