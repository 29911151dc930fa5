//! Gains of red and blue on linear values, green = 1 (docs/reference/camera.md). Digital numbers before the tone curve,
//! behind the noise, which it scales too.

use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};

/// The effect; its values live in [`Settings`].
pub struct WhiteBalance;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("r", "", (0.0, 16.0), 1.0, "gain of red")
        .fit(Fit::by(0.01).within(0.2, 5.0).trial(Law::Factor, 0.04, 0.35).graded(2e-3, 2e-1)),
    ParamSpec::number("b", "", (0.0, 16.0), 1.0, "gain of blue")
        .fit(Fit::by(0.01).within(0.2, 5.0).trial(Law::Factor, 0.04, 0.35).graded(2e-3, 2e-1)),
];

const R: Number = Number::of("white_balance", SPECS, "r");
const B: Number = Number::of("white_balance", SPECS, "b");

/// The function of the same name in `glsl/include/effects/white_balance.glsl`.
fn white_balance([r, g, b]: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    [r * p.number(0), g, b * p.number(1)]
}

fn matrix(settings: &Settings) -> [[f64; 3]; 3] {
    let [r, b] = [R, B].map(|of| settings.value(of));
    [[r, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, b]]
}

impl Effect for WhiteBalance {
    fn id(&self) -> &'static str {
        "white_balance"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::RawDn, Domain::RawDn)
    }

    fn moments(&self) -> Moments {
        Moments::Colors(matrix)
    }

    fn work(&self) -> Work {
        Work::Pointwise(white_balance)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        packer.number(settings.value(R));
        packer.number(settings.value(B));
    }
}
