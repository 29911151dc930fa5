//! What the sensor delivers without light: offset + (1 - offset) L (docs/reference/camera.md), so that white stays
//! white. From electrons to digital numbers.

use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};

/// The effect; its values live in [`Settings`].
pub struct BlackLevel;

pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::number("offset", "fraction of full scale", (-0.5, 0.9), 0.0, "value of no light")
        .fit(Fit::by(0.002).within(-0.2, 0.4).trial(Law::Up, 0.008, 0.1).graded(3e-4, 3e-2))];

const OFFSET: Number = Number::of("black_level", SPECS, "offset");

/// The function of the same name in `glsl/include/effects/black_level.glsl`.
fn black_level(value: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    value.map(|v| p.number(0) + p.number(1) * v)
}

fn affine(settings: &Settings, _: &View) -> [[f64; 2]; 3] {
    let offset = settings.value(OFFSET);
    [[1.0 - offset, offset]; 3]
}

impl Effect for BlackLevel {
    fn id(&self) -> &'static str {
        "black_level"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::Electrons, Domain::RawDn)
    }

    fn shown_by(&self) -> &'static str {
        "a frame with the lens covered"
    }

    fn moments(&self) -> Moments {
        Moments::Affine(affine)
    }

    fn work(&self) -> Work {
        Work::Pointwise(black_level)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        let offset = settings.value(OFFSET);
        packer.number(offset);
        packer.number(1.0 - offset);
    }
}
