//! Noise of the amplifiers that a row or a column shares: one normal value a row and frame (docs/reference/camera.md),
//! and one a column and frame with `column_sigma`; the same in all channels. Electrons.

use crate::chain::rng::{random_normal, seed_words};
use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Noise, Number, Packer, ParamSpec, Parameters, Settings, Stage,
    View, Work,
};
use crate::plane::three;

/// The effect; its values live in [`Settings`].
pub struct RowNoise;

/// Stream of the rows' values.
pub const STREAM_ROW_NOISE: u32 = 0x524f;
/// Stream of the columns' values.
pub const STREAM_COLUMN_NOISE: u32 = 0x434c;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("sigma", "fraction of full scale", (0.0, 1.0), 0.0, "standard deviation of the rows")
        .fit(Fit::by(1e-3).within(0.0, 0.3).trial(Law::Up, 0.003, 0.02).graded(2e-4, 1e-2)),
    ParamSpec::number(
        "column_sigma",
        "fraction of full scale",
        (0.0, 1.0),
        0.0,
        "standard deviation of the columns, new in every frame",
    ),
];

const SIGMA: Number = Number::of("row_noise", SPECS, "sigma");
const COLUMN_SIGMA: Number = Number::of("row_noise", SPECS, "column_sigma");

const ROWS: u32 = 1;
const COLUMNS: u32 = 2;

/// The function of the same name in `glsl/include/effects/row_noise.glsl`.
fn row_noise(value: [f32; 3], at: &At, p: &Parameters) -> [f32; 3] {
    let mut seen = value;
    if at.variant & ROWS != 0 {
        seen = three(|c| seen[c] + p.table(0, at.pixel[1] as usize));
    }
    if at.variant & COLUMNS != 0 {
        seen = three(|c| seen[c] + p.table(1, at.pixel[0] as usize));
    }
    seen
}

fn noise(settings: &Settings) -> [Noise; 3] {
    let [rows, columns] = [SIGMA, COLUMN_SIGMA].map(|of| settings.value(of));
    // What a column shares counts as each pixel's and colour's own: nothing here knows columns.
    [Noise { free: [columns * columns, 0.0, 0.0], row: [rows * rows, 0.0, 0.0], ..Noise::default() }; 3]
}

impl Effect for RowNoise {
    fn id(&self) -> &'static str {
        "row_noise"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::Electrons, Domain::Electrons)
    }

    fn variant(&self, settings: &Settings) -> u32 {
        let has = |of, part| if settings.value(of) != 0.0 { part } else { 0 };
        has(SIGMA, ROWS) | has(COLUMN_SIGMA, COLUMNS)
    }

    fn moments(&self) -> Moments {
        Moments::Noise(noise)
    }

    fn work(&self) -> Work {
        Work::Pointwise(row_noise)
    }

    fn pack(&self, settings: &Settings, view: &View, packer: &mut Packer<'_>) {
        let k = &view.intrinsics;
        for (of, lines, stream) in
            [(SIGMA, k.height, STREAM_ROW_NOISE), (COLUMN_SIGMA, k.width, STREAM_COLUMN_NOISE)]
        {
            let sigma = settings.value(of) as f32;
            let lines = if sigma == 0.0 { 0 } else { lines };
            let normal = |line| random_normal([line, 0], view.frame, stream, seed_words(view.seed))[0];
            packer.table((0..lines).map(|line| sigma * normal(line)));
        }
    }
}
