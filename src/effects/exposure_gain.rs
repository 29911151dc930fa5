//! Brightness of the whole picture: gain L (docs/reference/camera.md). Exposure set otherwise than assumed, or an
//! amplifier's gain. Linear radiance, before all noise: a gain behind the noise is [`super::ColorMatrix`]'s.

use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};

/// The effect; its values live in [`Settings`].
pub struct ExposureGain;

pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::number("gain", "", (0.0, 100.0), 1.0, "factor on the radiance")
        .fit(Fit::by(0.01).within(0.05, 20.0).trial(Law::Factor, 0.05, 0.5).graded(2e-3, 2e-1))];

const GAIN: Number = Number::of("exposure_gain", SPECS, "gain");

/// The function of the same name in `glsl/include/effects/exposure_gain.glsl`.
fn exposure_gain(value: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    value.map(|v| p.number(0) * v)
}

impl Effect for ExposureGain {
    fn id(&self) -> &'static str {
        "exposure_gain"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::LinearRgb, Domain::LinearRgb)
    }

    fn shown_by(&self) -> &'static str {
        "a card of known reflectance under a known light"
    }

    fn moments(&self) -> Moments {
        Moments::Affine(|settings, _| [[settings.value(GAIN), 0.0]; 3])
    }

    fn work(&self) -> Work {
        Work::Pointwise(exposure_gain)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        packer.number(settings.value(GAIN));
    }
}
