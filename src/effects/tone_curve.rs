//! The ISP's contrast: v + contrast (3 v^2 - 2 v^3 - v), an S-curve through black, middle and white; negative flattens.
//! Encoded values. For powers see [`super::Gamma`].

use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};

/// The effect; its values live in [`Settings`].
pub struct ToneCurve;

pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::number("contrast", "", (-1.0, 1.0), 0.0, "how much of the S-curve is mixed in")
        .fit(Fit::by(0.02).trial(Law::Either, 0.1, 0.6).graded(5e-3, 5e-1))];

const CONTRAST: Number = Number::of("tone_curve", SPECS, "contrast");

/// The function of the same name in `glsl/include/effects/tone_curve.glsl`.
fn tone_curve(value: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    value.map(|v| {
        let v = v.clamp(0.0, 1.0);
        let curve = v * v * (3.0 - 2.0 * v);
        v + p.number(0) * (curve - v)
    })
}

impl Effect for ToneCurve {
    fn id(&self) -> &'static str {
        "tone_curve"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::EncodedRgb, Domain::EncodedRgb)
    }

    fn moments(&self) -> Moments {
        Moments::Curve
    }

    fn work(&self) -> Work {
        Work::Pointwise(tone_curve)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        packer.number(settings.value(CONTRAST));
    }
}
