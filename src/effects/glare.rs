//! Veiling glare: (1 - veil) L + veil level (docs/reference/camera.md). Light scattered in the lens lifts all of the
//! picture alike, so contrast is lost most in the shadows. Linear radiance.

use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};

/// The effect; its values live in [`Settings`].
pub struct Glare;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("veil", "", (0.0, 1.0), 0.0, "share of the light that is scattered").fit(
        Fit::by(0.005)
            .within(0.0, 0.8)
            .starts(&[0.05, 0.05, 0.2])
            .trial(Law::Up, 0.03, 0.3)
            .graded(1e-3, 1e-1),
    ),
    ParamSpec::number("level", "fraction of full scale", (0.0, 10.0), 0.0, "radiance of the scattered light")
        .beside(&["veil"])
        .fit(Fit::by(0.02).ends().within(0.0, 1.5).rest(0.5).starts(&[0.8, 0.2, 0.5]).trial(
            Law::Even,
            0.2,
            0.9,
        )),
];

const VEIL: Number = Number::of("glare", SPECS, "veil");
const LEVEL: Number = Number::of("glare", SPECS, "level");

/// The function of the same name in `glsl/include/effects/glare.glsl`.
fn glare(value: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    value.map(|v| p.number(0) * v + p.number(1))
}

fn affine(settings: &Settings, _: &View) -> [[f64; 2]; 3] {
    let (veil, level) = (settings.value(VEIL), settings.value(LEVEL));
    [[1.0 - veil, veil * level]; 3]
}

impl Effect for Glare {
    fn id(&self) -> &'static str {
        "glare"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::LinearRgb, Domain::LinearRgb)
    }

    fn shown_by(&self) -> &'static str {
        "a dark surface beside a bright lamp, and again with the lamp covered"
    }

    fn variant(&self, settings: &Settings) -> u32 {
        // A level without a veil changes nothing.
        u32::from(settings.value(VEIL) != 0.0)
    }

    fn moments(&self) -> Moments {
        Moments::Affine(affine)
    }

    fn work(&self) -> Work {
        Work::Pointwise(glare)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        let veil = settings.value(VEIL);
        packer.number(1.0 - veil);
        packer.number(veil * settings.value(LEVEL));
    }
}
