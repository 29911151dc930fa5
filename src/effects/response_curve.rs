//! The camera's response beside that of sRGB: a monotone curve per channel behind noise and smoothing, given by its
//! relative steepness over the delivered value; black stays black and white white. Where it is steep, noise is large:
//! cameras whose tone curve is not sRGB's, and whose processing damps noise in dark or bright parts, have another noise
//! over intensity than shot and read noise give. Encoded values.
//!
//! Alone it changes the picture as a tone curve does. With `sensor_color.match = "delivered"` the light is taken
//! through the inverse ahead of the sensor, and only the noise changes.

use super::response::{self, KNOTS, NAMES};
use crate::chain::{At, Domain, Effect, Moments, Packer, ParamSpec, Parameters, Settings, Stage, View, Work};
use crate::plane::three;

/// The effect; its values live in [`Settings`].
pub struct ResponseCurve;

impl ResponseCurve {
    /// Names of the steepness of red, green and blue at the delivered (encoded) values 0, 1/16, ..., 1.
    pub const NAMES: [[&'static str; KNOTS]; 3] = NAMES;
    /// Smallest and largest steepness.
    pub const RANGE: (f64, f64) = (0.1, 10.0);
}

const fn steepness(channel: usize, knot: usize) -> ParamSpec {
    let about = "relative steepness at the delivered value of a sixteenth times the name's number";
    ParamSpec::number(NAMES[channel][knot], "", ResponseCurve::RANGE, 1.0, about)
}

pub(super) const SPECS: &[ParamSpec] = &{
    let mut specs = [steepness(0, 0); 3 * KNOTS];
    let mut i = 0;
    while i < specs.len() {
        specs[i] = steepness(i / KNOTS, i % KNOTS);
        i += 1;
    }
    specs
};

/// The function of the same name in `glsl/include/effects/response_curve.glsl`.
fn response_curve(value: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    three(|c| response::from_sensor(value[c], c, p, (0, 1)))
}

impl Effect for ResponseCurve {
    fn id(&self) -> &'static str {
        response::ID
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::EncodedRgb, Domain::EncodedRgb)
    }

    fn variant(&self, settings: &Settings) -> u32 {
        u32::from(response::densities(settings).is_some())
    }

    fn moments(&self) -> Moments {
        Moments::Curve
    }

    fn undiagnosed(&self) -> Option<&'static str> {
        Some("51 numbers that gamma and tone_curve give the main part of: calibrate-noise measures them")
    }

    fn work(&self) -> Work {
        Work::Pointwise(response_curve)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        if let Some(densities) = response::densities(settings) {
            response::pack(&densities, packer);
            response::pack_starts(&densities, packer);
        }
    }
}
