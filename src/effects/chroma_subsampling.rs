//! Colour is kept at half the resolution: 4:2:0 halves columns and rows, 4:2:2 columns (docs/reference/camera.md). The
//! colour difference of a block is that of its mean, and all of its pixels get it; brightness (ITU-R BT.601, as in
//! JFIF) stays. Encoded values.

use super::gaussian;
use crate::chain::{
    Choice, Domain, Effect, Fit, Law, Moments, ParamSpec, Parameters, Pass, Settings, Stage, Work,
};
use crate::plane::stats::luma;
use crate::plane::{Plane, three};

/// The effect; its values live in [`Settings`].
pub struct ChromaSubsampling;

pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::choice("scheme", &["4:4:4", "4:2:0", "4:2:2"], "which pixels share their colour")
        .fit(Fit::choice().trial(Law::Option, 0.4, 1.0))];

const SCHEME: Choice = Choice::of("chroma_subsampling", SPECS, "scheme");

fn block_rows(settings: &Settings) -> usize {
    if settings.chosen(SCHEME) == Some("4:2:0") { 2 } else { 1 }
}

/// Twin of `glsl/chroma_subsampling.comp`.
fn reference(source: &Plane<f32>, settings: &Settings, _: &Parameters) -> Plane<f32> {
    sharing(source, block_rows(settings))
}

/// Where the colour of two columns and so many rows is one.
pub fn sharing(source: &Plane<f32>, rows: usize) -> Plane<f32> {
    gaussian::filter(source, |x, y| {
        let first = [(x & !1) as i64, if rows == 2 { y & !1 } else { y } as i64];
        let at = |dx: i64, dy: i64| gaussian::clamped(source, [first[0] + dx, first[1] + dy]);
        let add = |a: [f32; 3], b: [f32; 3]| three(|c| a[c] + b[c]);
        let upper = add(at(0, 0), at(1, 0));
        let mean = match rows {
            2 => add(upper, add(at(0, 1), at(1, 1))).map(|v| 0.25 * v),
            _ => upper.map(|v| 0.5 * v),
        };
        let seen = gaussian::clamped(source, [x as i64, y as i64]);
        mean.map(|v| luma(&seen) + (v - luma(&mean)))
    })
}

fn passes(settings: &Settings) -> Vec<Pass> {
    let rows = block_rows(settings) as u32;
    vec![Pass { file: "chroma_subsampling.comp", constants: [rows, 0], run: [2, rows] }]
}

fn shares(settings: &Settings) -> [usize; 2] {
    [2, block_rows(settings)]
}

impl Effect for ChromaSubsampling {
    fn id(&self) -> &'static str {
        "chroma_subsampling"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::EncodedRgb, Domain::EncodedRgb)
    }

    fn moments(&self) -> Moments {
        Moments::Shares(shares)
    }

    fn work(&self) -> Work {
        Work::Neighbourhood { passes, reference }
    }
}
