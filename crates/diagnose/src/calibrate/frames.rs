//! Frames of one static scene: read, checked, and decoded to linear values.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::hash::{DefaultHasher, Hasher as _};
use std::path::{Path, PathBuf};

use super::copied;
use shutterbug::error::{Error, Result};
use shutterbug::files::{Limit, read};
use shutterbug::plane::{Plane, decode_picture, srgb_decode, srgb_encode};

/// What the values of a frame mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoding {
    /// sRGB-encoded (IEC 61966-2-1), as pictures for viewing are.
    #[default]
    Srgb,
    /// Proportional to light, as raw sensor values are.
    Linear,
}

impl Encoding {
    /// Encoded value (0 to 1) to linear radiance (1 = white).
    pub fn decode(self, value: f32) -> f32 {
        match self {
            Self::Srgb => srgb_decode(value),
            Self::Linear => value,
        }
    }

    /// Linear radiance to the encoded value.
    pub fn encode(self, linear: f32) -> f32 {
        match self {
            Self::Srgb => srgb_encode(linear),
            Self::Linear => linear,
        }
    }

    /// Derivative of the encoded value by the linear one, at a linear value.
    pub fn slope(self, linear: f64) -> f64 {
        match self {
            Self::Linear => 1.0,
            Self::Srgb if linear <= 0.003_130_8 => 12.92,
            Self::Srgb => 1.055 / 2.4 * linear.powf(1.0 / 2.4 - 1.0),
        }
    }

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Srgb => "srgb",
            Self::Linear => "linear",
        }
    }
}

/// How a JPEG was made, from its headers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JpegFacts {
    /// Quality on the scale of the IJG library whose luminance table is nearest.
    pub quality: u32,
    /// Luminance samples a chrominance sample, horizontally and vertically (`[2, 2]` = 4:2:0).
    pub chroma_step: [u8; 2],
}

/// One frame.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Its file (or a made-up name, for frames from memory); errors name it.
    pub path: PathBuf,
    /// Encoded values in 0 to 1, shape `[height, width, 3]`.
    pub encoded: Plane<f32>,
    /// Distance of two neighbouring values: 1/255, 1/65535 or, where a file has fewer levels than it could hold, more;
    /// 0 = not quantized.
    pub step: f32,
    /// Set for JPEG files.
    pub jpeg: Option<JpegFacts>,
}

impl Frame {
    /// Reads a PNG (8 or 16 bits) or JPEG.
    ///
    /// # Errors
    /// A file that cannot be read or decoded, or is too large; a picture that was enlarged by repeating pixels.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = read(path, Limit::PICTURE)?;
        let picture = decode_picture(path, &bytes)?;
        let deep = picture.color().bytes_per_pixel() / picture.color().channel_count() > 1;
        let code = if deep { 1.0 / 65_535.0 } else { 1.0 / 255.0 };
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let codes: Vec<u16> = if deep {
            picture.into_rgb16().into_raw()
        } else {
            picture.into_rgb8().into_raw().into_iter().map(u16::from).collect()
        };
        let step = f32::from(least_distance(&codes)) * code;
        let data = codes.into_iter().map(|v| f32::from(v) * code).collect();
        let encoded = Plane { width, height, channels: 3, data };
        if is_enlarged(&encoded) {
            let found = "a picture of which each pixel stands there twice, in rows and in columns";
            return Err(Error::input(path, None, found, "one as the camera wrote it, not enlarged"));
        }
        Ok(Self { path: path.to_owned(), encoded, step, jpeg: jpeg_facts(&bytes) })
    }

    /// Whether it has no colours: then all channels have the same noise.
    pub fn is_grey(&self) -> bool {
        self.encoded.data.chunks_exact(3).all(|p| p[0] == p[1] && p[1] == p[2])
    }

    /// Refuses a frame that is grey beside one with colours, or the other way round. What is black has neither.
    ///
    /// # Errors
    /// Such a frame.
    pub fn check_colours(&self, first_is_grey: bool, first: &Path) -> Result<()> {
        let named = |is_grey| if is_grey { "a grey picture" } else { "a picture in colour" };
        if self.is_grey() == first_is_grey || self.encoded.data.iter().all(|v| *v == 0.0) {
            return Ok(());
        }
        let expected = format!("{} as {}", named(first_is_grey), first.display());
        Err(Error::input(&self.path, None, named(!first_is_grey), expected))
    }

    /// A frame from memory.
    pub fn from_plane(name: &str, encoded: Plane<f32>, step: f32) -> Self {
        Self { path: PathBuf::from(name), encoded, step, jpeg: None }
    }
}

/// Whether pixels stand there twice along both axes: at one of the two places where pairs can begin all pairs are
/// equal, at the other they are not.
fn is_enlarged(picture: &Plane<f32>) -> bool {
    let (w, h) = (picture.width, picture.height);
    let columns_alike = |x: usize| (0..h).all(|y| picture.pixel(x, y) == picture.pixel(x + 1, y));
    let rows_alike = |y: usize| picture.row(y) == picture.row(y + 1);
    let twice = |side: usize, alike: &dyn Fn(usize) -> bool| {
        let pairs = |first: usize| (first..side.saturating_sub(1)).step_by(2).all(alike);
        // In a few pixels it happens by chance.
        side >= 16 && pairs(0) != pairs(1)
    };
    twice(w, &columns_alike) && twice(h, &rows_alike)
}

/// The value of a pixel that patterns are measured of: green, where there are colours. Each colour of a sensor has a
/// pattern of its own, as `fixed_pattern_noise` draws them; the mean of three would have 0.58 of it.
pub(super) fn of_pattern(pixel: &[f32]) -> f32 {
    pixel[if pixel.len() < 3 { 0 } else { 1 }]
}

/// The least distance of two codes that a picture has; 1 where it has but one.
fn least_distance(codes: &[u16]) -> u16 {
    let mut there = vec![false; usize::from(u16::MAX) + 1];
    codes.iter().for_each(|v| there[usize::from(*v)] = true);
    let all: Vec<u16> = (0..=u16::MAX).filter(|v| there[usize::from(*v)]).collect();
    all.windows(2).map(|w| w[1] - w[0]).min().unwrap_or(1)
}

/// Pictures that were read, by their values: a copy is no second exposure, and says nothing that the first does not.
#[derive(Debug, Default)]
pub struct Distinct {
    known: BTreeMap<u64, PathBuf>,
    last: Option<Frame>,
}

impl Distinct {
    /// Notes a picture.
    ///
    /// # Errors
    /// One whose values are those of a picture before, unless both are black, as a cap leaves them; one with rows of
    /// the last.
    pub fn add(&mut self, frame: Frame) -> Result<()> {
        if frame.encoded.data.iter().all(|v| *v == 0.0) {
            return Ok(());
        }
        let mut hasher = DefaultHasher::new();
        frame.encoded.data.iter().for_each(|v| hasher.write_u32(v.to_bits()));
        match self.known.entry(hasher.finish()) {
            Entry::Vacant(place) => {
                place.insert(frame.path.clone());
                let copied = self.last.as_ref().map_or(Ok(()), |last| refuse_copied(last, &frame));
                self.last = Some(frame);
                copied
            }
            Entry::Occupied(before) => {
                let found = format!("the same picture as {}", before.get().display());
                Err(Error::input(&frame.path, None, found, "another exposure"))
            }
        }
    }
}

/// Smallest side that can be measured, px: the statistics need some blocks of 32 px.
pub const MIN_SIDE_PX: usize = 64;

/// Refuses frames that cannot hold a measurement.
///
/// # Errors
/// Fewer than two frames, different sizes, a frame that is nearly all black or saturated, two identical frames.
pub fn check(frames: &[Frame]) -> Result<()> {
    let first = match frames {
        [] => return Err(Error::input(Path::new("calibrate noise"), None, "no frame", NEEDS_TWO)),
        [one] => return Err(Error::input(&one.path, None, "one frame alone", NEEDS_TWO)),
        [first, ..] => first,
    };
    let size = |f: &Frame| (f.encoded.width, f.encoded.height);
    if size(first).0.min(size(first).1) < MIN_SIDE_PX {
        let found = format!("{}x{} px", size(first).0, size(first).1);
        return Err(Error::input(&first.path, None, found, format!("at least {MIN_SIDE_PX} px a side")));
    }
    let first_is_grey = first.is_grey();
    for frame in frames {
        if size(frame) != size(first) {
            let found = format!("{}x{} px", size(frame).0, size(frame).1);
            let expected = format!("{}x{} px as in {}", size(first).0, size(first).1, first.path.display());
            return Err(Error::input(&frame.path, None, found, expected));
        }
        let count = frame.encoded.data.len() as f64;
        for (what, lost) in [
            ("black", frame.encoded.data.iter().filter(|v| **v <= frame.step).count()),
            ("saturated", frame.encoded.data.iter().filter(|v| **v >= 1.0 - frame.step).count()),
        ] {
            let share = lost as f64 / count;
            if share > 0.98 {
                let found = format!("{:.1} % of the values {what}", 100.0 * share);
                return Err(Error::input(&frame.path, None, found, "a picture whose noise is not cut off"));
            }
        }
        frame.check_colours(first_is_grey, &first.path)?;
    }
    for (i, a) in frames.iter().enumerate() {
        if let Some(b) = frames[..i].iter().find(|b| b.encoded == a.encoded) {
            let found = format!("the same picture as in {}: their difference is zero", b.path.display());
            return Err(Error::input(&a.path, None, found, "another exposure of the scene"));
        }
    }
    frames.windows(2).try_for_each(|pair| refuse_copied(&pair[0], &pair[1]))
}

/// # Errors
/// A picture of which rows are those of the one before, at most brighter or darker as a whole.
fn refuse_copied(before: &Frame, frame: &Frame) -> Result<()> {
    let (a, b) = (&before.encoded, &frame.encoded);
    if (a.width, a.height, a.channels) != (b.width, b.height, b.channels) {
        return Ok(());
    }
    let count = copied::rows(a, b, frame.step);
    if count == 0 {
        return Ok(());
    }
    let found = format!("{count} of {} rows that are those of {} again", a.height, before.path.display());
    Err(Error::input(&frame.path, None, found, "another exposure, with noise of its own"))
}

const NEEDS_TWO: &str = "two or more frames of one static scene";

/// Quality and subsampling from the segments DQT and SOF (ITU-T T.81, annex B); `None` where the file is no JPEG.
fn jpeg_facts(bytes: &[u8]) -> Option<JpegFacts> {
    if !bytes.starts_with(&[0xff, 0xd8]) {
        return None;
    }
    let (mut at, mut quality, mut chroma_step) = (2, None, None);
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..at + 4) {
        let length = usize::from(u16::from_be_bytes([high, low]));
        let body = bytes.get(at + 4..at + 2 + length)?;
        match marker {
            // Table 0 with 8-bit entries.
            0xdb if body.first() == Some(&0) && body.len() >= 65 => {
                quality = quality.or_else(|| Some(nearest_quality(&body[1..65])));
            }
            0xc0..=0xc2 if body.len() >= 12 => {
                let (luma, chroma) = (body[7], body[10]);
                let ratio = |l: u8, c: u8| l.checked_div(c).unwrap_or(1).max(1);
                chroma_step = Some([ratio(luma >> 4, chroma >> 4), ratio(luma & 15, chroma & 15)]);
            }
            0xda => break,
            _ => {}
        }
        at += 2 + length;
    }
    Some(JpegFacts { quality: quality?, chroma_step: chroma_step.unwrap_or([1, 1]) })
}

/// The IJG quality whose scaled luminance table (T.81, table K.1) has the same sum. A sum does not depend on the
/// zigzag order.
fn nearest_quality(table: &[u8]) -> u32 {
    const K1: [u32; 64] = [
        16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55, 14, 13, 16, 24, 40, 57, 69, 56, 14,
        17, 22, 29, 51, 87, 80, 62, 18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92, 49,
        64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99,
    ];
    let sum: u32 = table.iter().map(|v| u32::from(*v)).sum();
    let scaled = |quality: u32| -> u32 {
        let scale = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
        K1.iter().map(|v| ((v * scale + 50) / 100).clamp(1, 255)).sum()
    };
    (1..=100).min_by_key(|q| scaled(*q).abs_diff(sum)).unwrap_or(75)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_is_the_derivative_of_the_encoding() {
        for linear in [0.001, 0.01, 0.2, 0.7] {
            let h = 1e-4 * linear;
            let measured = f64::from(srgb_encode((linear + h) as f32) - srgb_encode((linear - h) as f32));
            let got = Encoding::Srgb.slope(linear) * 2.0 * h;
            assert!((got / measured - 1.0).abs() < 0.02, "{linear}: {got} for {measured}");
        }
    }

    #[test]
    fn an_enlarged_picture_is_told_from_one_that_a_camera_wrote() {
        let value = |x: usize, y: usize| [0.01 * ((x * 7 + y * 13) % 90) as f32; 3];
        let plain = Plane::from_fn(40, 30, value);
        for shift in [0, 1] {
            let of = |side: usize| (side + shift) / 2;
            assert!(is_enlarged(&Plane::from_fn(40, 30, |x, y| value(of(x), of(y)))), "from {shift} on");
            assert!(!is_enlarged(&Plane::from_fn(40, 30, |x, y| value(of(x), y))), "columns alone");
        }
        assert!(!is_enlarged(&plain) && !is_enlarged(&Plane::from_fn(40, 30, |_, _| [0.0; 3])));
        // Half black, half white: an edge at an even place is no pair.
        assert!(!is_enlarged(&Plane::from_fn(40, 30, |x, _| [if x < 20 { 0.0 } else { 1.0 }; 3])));
    }

    #[test]
    fn the_quality_of_a_jpeg_is_read_back() {
        for quality in [30, 75, 90, 95] {
            let mut bytes = Vec::new();
            let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality);
            image::ImageEncoder::write_image(
                encoder,
                &[100; 64 * 64 * 3],
                64,
                64,
                image::ExtendedColorType::Rgb8,
            )
            .expect("encoded");
            let facts = jpeg_facts(&bytes).expect("a JPEG");
            assert_eq!(facts.quality, u32::from(quality));
        }
        assert_eq!(jpeg_facts(b"\x89PNG"), None);
    }

    #[test]
    fn a_copy_is_no_other_exposure() {
        let frame = |name: &str, value: f32| {
            Frame::from_plane(name, Plane::from_fn(4, 4, |x, _| [value * x as f32; 3]), 0.0)
        };
        let mut seen = Distinct::default();
        seen.add(frame("a", 0.1)).expect("new");
        seen.add(frame("b", 0.2)).expect("another");
        let said = seen.add(frame("c", 0.1)).expect_err("a copy").to_string();
        assert!(said.contains("c: found the same picture as a"), "{said}");
        seen.add(frame("d", 0.0)).expect("black");
        seen.add(frame("e", 0.0)).expect("black again");
    }

    #[test]
    fn unusable_frames_are_refused() {
        let plane = |width, level: f32| {
            Plane::from_fn(width, 64, |x, y| [level * (1.0 + 0.1 * ((x * 7 + y) % 5) as f32); 3])
        };
        let frame = |name, width, level| Frame::from_plane(name, plane(width, level), 1.0 / 255.0);
        let refused = |frames: &[Frame]| check(frames).expect_err("refused").to_string();
        assert!(refused(&[frame("a", 64, 0.5)]).contains("one frame alone"));
        assert!(refused(&[frame("a", 64, 0.5), frame("b", 65, 0.5)]).contains("b: found 65x64 px"));
        assert!(refused(&[frame("a", 64, 0.5), frame("b", 64, 0.5)]).contains("difference is zero"));
        assert!(refused(&[frame("a", 64, 0.5), frame("b", 64, 0.0)]).contains("% of the values black"));
        assert!(refused(&[frame("a", 64, 1.0), frame("b", 64, 0.9)]).contains("saturated"));
        assert!(refused(&[frame("a", 32, 0.5), frame("b", 32, 0.4)]).contains("at least 64 px"));
        assert!(check(&[frame("a", 64, 0.5), frame("b", 64, 0.51)]).is_ok(), "control");
    }
}
