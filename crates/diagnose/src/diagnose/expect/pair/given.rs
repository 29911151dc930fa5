//! How well a model knows its values where it reads a simulator's pictures.
//!
//! Pictures were rounded to whole numbers. Equal values of a picture are mostly one colour of the scene, and off by the
//! same: over a wall of one colour the mean is as far off as each of its values.

use crate::diagnose::expect::tone::Tone;
use shutterbug::plane::{srgb_encode, srgb_slope};

/// Of a frame, value by value.
pub(crate) type Given = Vec<GivenValue>;

/// How well one value is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct GivenValue {
    /// Variance of the value alone, DN^2: a value between pixels is not known from its neighbours, and what was warped
    /// lies a little off.
    pub single: f32,
    /// Width of one step of the picture's values behind the camera, DN.
    pub step: f32,
    /// The picture's value: what has the same is off by the same.
    pub value: u8,
}

/// Factors by which a camera may brighten a value without being taken for what adds to it.
const BRIGHTER: [f32; 2] = [0.25, 4.0];

impl GivenValue {
    /// Variance of a linear value of pictures that were rounded to whole numbers. `linear`: the pictures' values are
    /// linear.
    pub(crate) fn rounding(value: f64, linear: bool) -> f64 {
        (255.0 * slope_at(value, linear)).powi(-2) / 12.0
    }

    /// Of linear radiance `picture` that the camera delivers as `mean` DN. `linear`: the picture's values are linear.
    pub(super) fn of(picture: f32, linear: bool, mean: f32, tone: &Tone, channel: usize) -> Self {
        let encoded = if linear { picture } else { srgb_encode(picture) };
        let slope = slope_at(f64::from(picture), linear) as f32;
        // Gain, shading and colour multiply the light before the sensor.
        let light = tone.decode(mean, channel) / picture.max(1e-6);
        let brighter = if picture > DARK { light.clamp(BRIGHTER[0], BRIGHTER[1]) } else { 1.0 };
        let step = tone.slope_at(mean, channel) * brighter / (255.0 * slope);
        Self { single: 0.0, step, value: (255.0 * encoded).round() as u8 }
    }
}

/// How fast a picture's values grow with linear radiance there.
fn slope_at(radiance: f64, linear: bool) -> f64 {
    if linear { 1.0 } else { srgb_slope(radiance) }
}

/// Linear radiance below which a quotient of two says nothing.
const DARK: f32 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::model::Theta;
    use crate::diagnose::expect::vector::PLACES;
    use shutterbug::plane::srgb_decode;

    #[test]
    fn a_step_of_the_picture_is_as_wide_as_the_camera_makes_it() {
        let plain = Tone::new(&Theta::neutral());
        for value in [40u8, 128, 220] {
            let picture = srgb_decode(f32::from(value) / 255.0);
            let seen = GivenValue::of(picture, false, f32::from(value), &plain, 1);
            assert!((seen.step - 1.0).abs() < 0.03 && seen.value == value, "{seen:?}");
            // Behind a gain the same step is wider by what the next value comes to.
            let of = |v: f32| 255.0 * srgb_encode(1.3 * srgb_decode(v / 255.0));
            let brighter = of(f32::from(value) + 0.5) - of(f32::from(value) - 0.5);
            let seen = GivenValue::of(picture, false, of(f32::from(value)), &plain, 1);
            assert!((seen.step / brighter - 1.0).abs() < 0.03, "{seen:?} {brighter}");
            let gamma = PLACES.iter().copied().find(|p| p.spec().effect == "gamma").expect("an effect");
            let curved = Tone::new(&Theta::neutral().with(gamma, 1.4));
            let seen = GivenValue::of(picture, false, curved.dn_of(picture), &curved, 1);
            let next = (curved.dn_of(srgb_decode((f32::from(value) + 0.5) / 255.0))
                - curved.dn_of(srgb_decode((f32::from(value) - 0.5) / 255.0)))
            .abs();
            assert!((seen.step / next - 1.0).abs() < 0.05, "{seen:?} {next}");
        }
        // A picture of linear values has wide steps in the dark.
        let dark = GivenValue::of(4.0 / 255.0, true, 255.0 * srgb_encode(4.0 / 255.0), &plain, 1);
        assert!(dark.step > 2.5 && dark.value == 4, "{dark:?}");
    }
}
