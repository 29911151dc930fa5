//! The converter: clips to 0..1 (saturation) and rounds to the steps of so many bits. Digital numbers before the ISP;
//! the delivered picture is rounded to 8 bits besides. Without it nothing is clipped before the tone curve.

use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};

/// The effect; its values live in [`Settings`].
pub struct Quantization;

pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::integer("bits", "bit", (0.0, 16.0), "depth of the converter; 0: no converter")
        .fit(Fit::choice().within(0.0, 10.0).trial(Law::Coarser, 3.0, 6.0))];

const BITS: Number = Number::of("quantization", SPECS, "bits");

/// The function of the same name in `glsl/include/effects/quantization.glsl`.
fn quantization(value: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    value.map(|v| (v.clamp(0.0, 1.0) * p.number(0) + 0.5).floor() * p.number(1))
}

impl Effect for Quantization {
    fn id(&self) -> &'static str {
        "quantization"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::RawDn, Domain::RawDn)
    }

    fn moments(&self) -> Moments {
        Moments::Steps(|settings| 1.0 / (settings.value(BITS).exp2() - 1.0))
    }

    fn work(&self) -> Work {
        Work::Pointwise(quantization)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        let largest = settings.value(BITS).exp2() - 1.0;
        packer.number(largest);
        packer.number(1.0 / largest);
    }
}
