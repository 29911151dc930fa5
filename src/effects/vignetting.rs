//! Light falls off towards the corners: L (1 + a1 q + a2 q^2), q = squared distance from (cx, cy) over the squared half
//! diagonal of the picture (docs/reference/camera.md). Linear radiance. Where the polynomial is negative no light
//! arrives.

use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};

/// The effect; its values live in [`Settings`].
pub struct Vignetting;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number(
        "a1",
        "",
        (-2.0, 2.0),
        0.0,
        "change of brightness per q (squared distance from (cx, cy) over the squared half diagonal)",
    )
    .fit(Fit::by(0.01).within(-1.5, 0.5).trial(Law::Down, 0.1, 0.6).graded(4e-3, 4e-1)),
    ParamSpec::number("a2", "", (-2.0, 2.0), 0.0, "change of brightness per squared q")
        .fit(Fit::by(0.01).within(-1.0, 1.5).trial(Law::Even, -0.2, 0.1)),
];

const A1: Number = Number::of("vignetting", SPECS, "a1");
const A2: Number = Number::of("vignetting", SPECS, "a2");

/// What a place lets through; `p`: centre, scale of q and the polynomial.
#[inline]
fn fall_off([x, y]: [f32; 2], p: &[f32; 5]) -> f32 {
    let [x, y] = [x + 0.5 - p[0], y + 0.5 - p[1]];
    let q = (x * x + y * y) * p[2];
    (1.0 + q * (p[3] + q * p[4])).max(0.0)
}

fn numbers(p: &Parameters) -> [f32; 5] {
    [0, 1, 2, 3, 4].map(|i| p.number(i))
}

/// The function of the same name in `glsl/include/effects/vignetting.glsl`.
fn vignetting(value: [f32; 3], at: &At, p: &Parameters) -> [f32; 3] {
    let fall_off = fall_off(at.pixel.map(|v| v as f32), &numbers(p));
    value.map(|v| v * fall_off)
}

fn light(p: &Parameters, _: &View, y: usize, row: &mut [f32]) {
    let numbers = numbers(p);
    row.iter_mut().enumerate().for_each(|(x, v)| *v = fall_off([x as f32, y as f32], &numbers));
}

impl Effect for Vignetting {
    fn id(&self) -> &'static str {
        "vignetting"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::LinearRgb, Domain::LinearRgb)
    }

    fn moments(&self) -> Moments {
        Moments::Light(light)
    }

    fn work(&self) -> Work {
        Work::Pointwise(vignetting)
    }

    fn pack(&self, settings: &Settings, view: &View, packer: &mut Packer<'_>) {
        let k = &view.intrinsics;
        let (w, h) = (f64::from(k.width), f64::from(k.height));
        for number in [k.cx, k.cy, 4.0 / (w * w + h * h)] {
            packer.number(number);
        }
        for of in [A1, A2] {
            packer.number(settings.value(of));
        }
    }
}
