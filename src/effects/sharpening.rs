//! The ISP's unsharp mask: v + amount (v - Gaussian of v), on encoded values (docs/reference/camera.md). A negative
//! amount softens, as ISPs do against noise: -1 is the Gaussian itself. Encoded values; clipped only when they are
//! rounded.

use super::gaussian;
use crate::chain::{
    Domain, Effect, Filter, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Pass, Settings, Stage,
    View, Work,
};
use crate::plane::{Plane, three};

/// The effect; its values live in [`Settings`].
pub struct Sharpening;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("amount", "", (-1.0, 10.0), 0.0, "weight of the mask; below 0 it softens")
        .beside(&["radius_px"])
        .fit(
            Fit::by(0.05)
                .within(0.0, 5.0)
                .starts(&[0.3, 0.5, 1.2])
                .trial(Law::Up, 0.3, 2.0)
                .graded(2e-2, 2.0),
        ),
    ParamSpec::number("radius_px", "px", (0.0, 50.0), 0.0, "standard deviation of the Gaussian")
        .beside(&["amount"])
        .fit(Fit::by(0.1).within(0.4, 5.0).rest(1.0).starts(&[0.7, 1.5, 1.0]).trial(Law::Even, 0.7, 2.0)),
];

const AMOUNT: Number = Number::of("sharpening", SPECS, "amount");
const RADIUS_PX: Number = Number::of("sharpening", SPECS, "radius_px");

fn amount(settings: &Settings) -> f64 {
    settings.value(AMOUNT)
}

fn radius_px(settings: &Settings) -> f64 {
    settings.value(RADIUS_PX)
}

/// Twin of `glsl/sharpening.comp`.
fn reference(source: &Plane<f32>, settings: &Settings, p: &Parameters) -> Plane<f32> {
    let weights = gaussian::weights(radius_px(settings));
    let blurred = gaussian::along(&gaussian::along(source, 0, &weights), 1, &weights);
    gaussian::filter(source, |x, y| {
        let (v, blurred) = (source.pixel(x, y), blurred.pixel(x, y));
        three(|c| v[c] + p.number(0) * (v[c] - blurred[c]))
    })
}

fn passes(settings: &Settings) -> Vec<Pass> {
    gaussian::passes("sharpening.comp", radius_px(settings)).to_vec()
}

impl Effect for Sharpening {
    fn id(&self) -> &'static str {
        "sharpening"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::EncodedRgb, Domain::EncodedRgb)
    }

    fn variant(&self, settings: &Settings) -> u32 {
        // Without a radius the mask is empty.
        u32::from(amount(settings) != 0.0 && radius_px(settings) != 0.0)
    }

    fn moments(&self) -> Moments {
        Moments::Filter(|settings| {
            let soft = gaussian::weights(radius_px(settings));
            Filter::lifted([(amount(settings), &soft); 2])
        })
    }

    fn work(&self) -> Work {
        Work::Neighbourhood { passes, reference }
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        packer.number(amount(settings));
        gaussian::pack(radius_px(settings), packer);
    }
}
