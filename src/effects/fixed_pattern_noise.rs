//! No two pixels are alike: L (1 + prnu n1) + dsnu n2, n1 and n2 normal (docs/reference/camera.md; DSNU and PRNU as the
//! spatial standard deviations of EMVA 1288, 4). Gains are those of the response to light: the mean of
//! [`super::DarkCurrent`], which no light made, is left alone, so that what EMVA 1288 calls PRNU is `prnu` at any
//! exposure. The pattern belongs to the sensor: it depends on `sensor_seed` only, not on the frame or the run.
//! Electrons.

use super::DarkCurrent;
use crate::chain::rng::{FIXED_FRAME, random_normal, seed_words};
use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Noise, Number, Packer, ParamSpec, Parameters, Settings, Stage,
    View, Work,
};
use crate::plane::three;

/// The effect; its values live in [`Settings`].
pub struct FixedPatternNoise;

/// Stream of the offsets.
pub const STREAM_FIXED_PATTERN_DSNU: u32 = 0x4453;
/// Stream of the gains.
pub const STREAM_FIXED_PATTERN_PRNU: u32 = 0x5052;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number("dsnu", "fraction of full scale", (0.0, 1.0), 0.0, "standard deviation of the offsets")
        .fit(Fit::by(1e-3).within(0.0, 0.3).trial(Law::Up, 0.004, 0.03).graded(3e-4, 1e-2)),
    ParamSpec::number("prnu", "", (0.0, 1.0), 0.0, "standard deviation of the gains")
        .fit(Fit::by(1e-3).within(0.0, 0.3).trial(Law::Up, 0.008, 0.05).graded(6e-4, 2e-2)),
    ParamSpec::integer("sensor_seed", "", (0.0, 4_294_967_295.0), "which sensor of its kind")
        .beside(&["dsnu", "prnu"]),
];

const DSNU: Number = Number::of("fixed_pattern_noise", SPECS, "dsnu");
const PRNU: Number = Number::of("fixed_pattern_noise", SPECS, "prnu");
const SENSOR_SEED: Number = Number::of("fixed_pattern_noise", SPECS, "sensor_seed");

const OFFSETS: u32 = 1;
const GAINS: u32 = 2;

/// The function of the same name in `glsl/include/effects/fixed_pattern_noise.glsl`.
fn fixed_pattern_noise(value: [f32; 3], at: &At, p: &Parameters) -> [f32; 3] {
    let sensor = [p.bits(2), p.bits(3)];
    let normal = |stream| random_normal(at.pixel, FIXED_FRAME, stream, sensor);
    let mut seen = value;
    if at.variant & GAINS != 0 {
        let n = normal(STREAM_FIXED_PATTERN_PRNU);
        seen = three(|c| seen[c] + (seen[c] - p.number(4)) * (p.number(1) * n[c]));
    }
    if at.variant & OFFSETS != 0 {
        let n = normal(STREAM_FIXED_PATTERN_DSNU);
        seen = three(|c| seen[c] + p.number(0) * n[c]);
    }
    seen
}

fn noise(settings: &Settings) -> [Noise; 3] {
    let [dsnu, prnu] = [DSNU, PRNU].map(|of| settings.value(of));
    [Noise { fixed: [dsnu * dsnu, 0.0, prnu * prnu], ..Noise::default() }; 3]
}

impl Effect for FixedPatternNoise {
    fn id(&self) -> &'static str {
        "fixed_pattern_noise"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::Electrons, Domain::Electrons)
    }

    fn variant(&self, settings: &Settings) -> u32 {
        let has = |of, part| if settings.value(of) != 0.0 { part } else { 0 };
        has(DSNU, OFFSETS) | has(PRNU, GAINS)
    }

    fn moments(&self) -> Moments {
        Moments::Noise(noise)
    }

    fn work(&self) -> Work {
        Work::Pointwise(fixed_pattern_noise)
    }

    fn pack(&self, settings: &Settings, view: &View, packer: &mut Packer<'_>) {
        packer.number(settings.value(DSNU));
        packer.number(settings.value(PRNU));
        let seed = settings.value(SENSOR_SEED) as u64;
        seed_words(seed).into_iter().for_each(|word| packer.bits(word));
        packer.number(DarkCurrent::mean(settings, view));
    }
}
