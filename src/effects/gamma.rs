//! From linear values to encoded ones: srgb(L)^exponent, clipped to 0..1 (docs/reference/camera.md; srgb: IEC
//! 61966-2-1). Every camera encodes, so it is part of every chain; when it is off the exponent is 1.

use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};
use crate::plane::{srgb_encode, three};

/// The effect; its values live in [`Settings`].
pub struct Gamma;

pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::number("exponent", "", (0.1, 10.0), 1.0, "power of the sRGB-encoded value")
        .fit(Fit::by(0.01).within(0.3, 3.0).trial(Law::Factor, 0.05, 0.35).graded(2e-3, 2e-1))];

const EXPONENT: Number = Number::of("gamma", SPECS, "exponent");

const ENCODE: u32 = 1;
const POWER: u32 = 2;

/// The function of the same name in `glsl/include/effects/gamma.glsl`.
fn gamma(value: [f32; 3], at: &At, p: &Parameters) -> [f32; 3] {
    // NaN becomes black, as in the kernel.
    let encoded = three(|c| if value[c] > 0.0 { srgb_encode(value[c]) } else { 0.0 });
    if at.variant & POWER == 0 {
        return encoded;
    }
    three(|c| if encoded[c] > 0.0 { encoded[c].powf(p.number(0)) } else { 0.0 })
}

impl Effect for Gamma {
    fn id(&self) -> &'static str {
        "gamma"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::RawDn, Domain::EncodedRgb)
    }

    fn variant(&self, settings: &Settings) -> u32 {
        if settings.is_neutral(self.id(), SPECS) { ENCODE } else { ENCODE | POWER }
    }

    fn moments(&self) -> Moments {
        Moments::Curve
    }

    fn work(&self) -> Work {
        Work::Pointwise(gamma)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        packer.number(settings.value(EXPONENT));
    }
}
