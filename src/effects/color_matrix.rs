//! From the sensor's colours to the picture's: a 3x3 matrix on linear values. `rg` is how much of green goes into red.
//! Digital numbers before the tone curve.

use crate::chain::{At, Domain, Effect, Moments, Packer, ParamSpec, Parameters, Settings, Stage, View, Work};

/// The effect; its values live in [`Settings`].
pub struct ColorMatrix;

const RANGE: (f64, f64) = (-8.0, 8.0);

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("rr", "", RANGE, 1.0, "red from red"),
    ParamSpec::number("rg", "", RANGE, 0.0, "red from green"),
    ParamSpec::number("rb", "", RANGE, 0.0, "red from blue"),
    ParamSpec::number("gr", "", RANGE, 0.0, "green from red"),
    ParamSpec::number("gg", "", RANGE, 1.0, "green from green"),
    ParamSpec::number("gb", "", RANGE, 0.0, "green from blue"),
    ParamSpec::number("br", "", RANGE, 0.0, "blue from red"),
    ParamSpec::number("bg", "", RANGE, 0.0, "blue from green"),
    ParamSpec::number("bb", "", RANGE, 1.0, "blue from blue"),
];

/// The function of the same name in `glsl/include/effects/color_matrix.glsl`.
fn color_matrix([r, g, b]: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    [0, 3, 6].map(|i| p.number(i) * r + p.number(i + 1) * g + p.number(i + 2) * b)
}

fn matrix(settings: &Settings) -> [[f64; 3]; 3] {
    let entry = |i: usize| {
        settings.number("color_matrix", SPECS[i].name, if i.is_multiple_of(4) { 1.0 } else { 0.0 })
    };
    [0, 3, 6].map(|row| [row, row + 1, row + 2].map(entry))
}

impl Effect for ColorMatrix {
    fn id(&self) -> &'static str {
        "color_matrix"
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

    fn undiagnosed(&self) -> Option<&'static str> {
        Some(
            "nine numbers that hold a white balance and a gain: as a candidate it took minutes and stood for other \
             effects",
        )
    }

    fn work(&self) -> Work {
        Work::Pointwise(color_matrix)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        for (i, spec) in SPECS.iter().enumerate() {
            packer.number(settings.number(
                "color_matrix",
                spec.name,
                if i.is_multiple_of(4) { 1.0 } else { 0.0 },
            ));
        }
    }
}
