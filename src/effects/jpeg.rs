//! The camera's JPEG, 4:4:4 (for coarser colour put [`super::ChromaSubsampling`] before it): encoded and decoded again
//! by the `image` crate on the CPU. The delivered 8-bit picture; the last of all effects. What it makes of noise, on
//! average and block by block, stands in `jpeg/`.

pub mod dct;
pub mod flips;
pub mod grain;
pub mod packing;

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageFormat};

use crate::chain::{Domain, Effect, Fit, Law, Moments, Number, ParamSpec, Settings, Stage, Work};
use crate::plane::Plane;

/// The effect; its values live in [`Settings`].
pub struct Jpeg;

pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::integer("quality", "", (0.0, 100.0), "1 (coarsest) to 100, as in libjpeg; 0: no JPEG")
        .fit(Fit::choice().trial(Law::Coarser, 25.0, 85.0).graded(2.0, 70.0))];

const QUALITY: Number = Number::of("jpeg", SPECS, "quality");

fn through_jpeg(picture: &mut Plane<u8>, settings: &Settings) {
    let quality = settings.value(QUALITY) as u8;
    picture.data = coded(&picture.data, [picture.width, picture.height], quality);
}

/// Bytes of a picture, encoded and decoded again.
fn coded(bytes: &[u8], size: [usize; 2], quality: u8) -> Vec<u8> {
    let mut file = Vec::new();
    // Sides are at most 16384 px, JPEG's limit is 65535, and a Vec takes all that is written.
    JpegEncoder::new_with_quality(&mut file, quality)
        .encode(bytes, size[0] as u32, size[1] as u32, ExtendedColorType::Rgb8)
        .expect("a picture of an allowed size can be encoded into memory");
    let decoded = image::load_from_memory_with_format(&file, ImageFormat::Jpeg);
    decoded.expect("what the encoder wrote can be decoded").into_rgb8().into_raw()
}

/// The same of values in DN, shape `[height, width, 3]`.
pub fn compressed(dn: &Plane<f32>, quality: u8) -> Plane<f32> {
    let bytes: Vec<u8> = dn.data.iter().map(|v| (v + 0.5).clamp(0.0, 255.0) as u8).collect();
    let data =
        coded(&bytes, [dn.width, dn.height], quality.clamp(1, 100)).into_iter().map(f32::from).collect();
    Plane { width: dn.width, height: dn.height, channels: 3, data }
}

impl Effect for Jpeg {
    fn id(&self) -> &'static str {
        "jpeg"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::EncodedRgb, Domain::EncodedRgb)
    }

    fn moments(&self) -> Moments {
        Moments::File(|settings| settings.value(QUALITY) as u8)
    }

    fn work(&self) -> Work {
        Work::Host(through_jpeg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::Value;

    #[test]
    fn coarser_is_further_off() {
        let picture = Plane::from_fn(33, 17, |x, y| {
            [(x * 37 + y * 91) as u8, (x * 7) as u8, ((x / 4 + y / 4) % 2 * 255) as u8]
        });
        let off = |quality: f64| {
            let mut settings = Settings::default();
            settings.set(&Jpeg, "quality", Value::Number(quality)).expect("in range");
            let mut seen = picture.clone();
            through_jpeg(&mut seen, &settings);
            assert_eq!((seen.width, seen.height, seen.data.len()), (33, 17, 33 * 17 * 3));
            crate::plane::metrics::mean_absolute_difference(&seen, &picture)
        };
        let (fine, coarse) = (off(100.0), off(10.0));
        assert!(fine < 2.0 && coarse > 5.0 * fine, "{fine} {coarse}");
    }
}
