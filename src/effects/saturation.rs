//! Strength of colours: v' = Y + factor (v - Y) on encoded values, Y the luma of ITU-R BT.601, as in JFIF: what ISPs
//! call saturation, behind the tone curve, its clipping at black and the response. With a factor below 1 no delivered
//! channel falls below (1 - factor) Y: in all six photographs of a Nao robot's head camera that this was measured on,
//! the least channel of vivid colours piles up at 0.25 Y, whatever Y is.

use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};
use crate::plane::stats::{LUMA, luma};
use crate::plane::three;

/// The effect; its values live in [`Settings`].
pub struct Saturation;

const ID: &str = "saturation";
pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::number("factor", "", (0.0, 4.0), 1.0, "factor on the differences from luma; 0: grey")
        .fit(Fit::by(0.02).within(0.0, 3.0).trial(Law::Factor, 0.1, 0.6).graded(5e-3, 5e-1))];

const FACTOR: Number = Number::of(ID, SPECS, "factor");

impl Saturation {
    pub(super) fn factor(settings: &Settings) -> f64 {
        settings.value(FACTOR)
    }
}

/// The function of the same name in `glsl/include/effects/saturation.glsl`.
fn saturation(value: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    let y = luma(&value);
    value.map(|v| y + p.number(0) * (v - y))
}

fn matrix(settings: &Settings) -> [[f64; 3]; 3] {
    let factor = Saturation::factor(settings);
    let of = |of: usize, from: usize| {
        (1.0 - factor) * f64::from(LUMA[from]) + if of == from { factor } else { 0.0 }
    };
    three(|row| three(|from| of(row, from)))
}

impl Effect for Saturation {
    fn id(&self) -> &'static str {
        ID
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::EncodedRgb, Domain::EncodedRgb)
    }

    fn moments(&self) -> Moments {
        Moments::Colors(matrix)
    }

    fn work(&self) -> Work {
        Work::Pointwise(saturation)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        packer.number(Self::factor(settings));
    }
}
