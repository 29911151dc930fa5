//! The effect that tests add, by the list of `docs/add-an-effect.md`: dark tones go towards blue and bright ones
//! towards red, v' = v + amount (2 Y - 1) (1, 0, -1) on encoded values, Y the luma. It has no kernel, so it is in no
//! build but that of the library's own tests, which make frames on the CPU and have them diagnosed (`withhold`).

use crate::chain::{
    At, Domain, Effect, Fit, Law, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};
use crate::plane::stats::luma;

/// The effect; its values live in [`Settings`].
pub struct SplitToning;

const ID: &str = "split_toning";
pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::number("amount", "", (-0.5, 0.5), 0.0, "what white gains in red and loses in blue")
        .fit(Fit::by(0.01).trial(Law::Either, 0.02, 0.1))];

const AMOUNT: Number = Number::of(ID, SPECS, "amount");

fn split_toning([r, g, b]: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    let tint = p.number(0) * (2.0 * luma(&[r, g, b]) - 1.0);
    [r + tint, g, b - tint]
}

impl Effect for SplitToning {
    fn id(&self) -> &'static str {
        ID
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::EncodedRgb, Domain::EncodedRgb)
    }

    fn work(&self) -> Work {
        Work::Pointwise(split_toning)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        packer.number(settings.value(AMOUNT));
    }
}
