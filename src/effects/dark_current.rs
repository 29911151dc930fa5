//! Charge that collects in a pixel without light: L + rate exposure (EMVA 1288, 3.1: mu_d = mu_d0 + mu_I t). It stands
//! before [`super::ShotNoise`], which thus makes its noise too. Linear radiance, 1 = full well.

use super::MotionBlur;
use crate::chain::{
    At, Domain, Effect, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};
use crate::error::Result;

/// The effect; its values live in [`Settings`].
pub struct DarkCurrent;

pub(super) const SPECS: &[ParamSpec] = &[ParamSpec::number(
    "rate_per_s",
    "fraction of full scale per s",
    (0.0, 1000.0),
    0.0,
    "electrons per second over full well, times the exposure of the frame",
)];

const RATE_PER_S: Number = Number::of("dark_current", SPECS, "rate_per_s");

/// The function of the same name in `glsl/include/effects/dark_current.glsl`.
fn dark_current(value: [f32; 3], _: &At, p: &Parameters) -> [f32; 3] {
    value.map(|v| v + p.number(0))
}

impl DarkCurrent {
    /// What it adds to every pixel of a frame, fraction of full scale.
    pub(super) fn mean(settings: &Settings, view: &View) -> f64 {
        settings.value(RATE_PER_S) * view.shutter.exposure_time_s
    }
}

impl Effect for DarkCurrent {
    fn id(&self) -> &'static str {
        "dark_current"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::LinearRgb, Domain::LinearRgb)
    }

    fn check(&self, settings: &Settings, _: f64) -> Result<Vec<String>> {
        let exposed = MotionBlur::exposure_time_s(settings) > 0.0;
        if exposed || self.variant(settings) == 0 {
            return Ok(Vec::new());
        }
        Ok(vec!["dark_current needs time: without motion_blur.exposure_time_s it changes nothing".to_owned()])
    }

    fn moments(&self) -> Moments {
        Moments::Affine(|settings, view| [[1.0, Self::mean(settings, view)]; 3])
    }

    fn undiagnosed(&self) -> Option<&'static str> {
        Some(
            "one number a frame that a black level ahead of the noise gives as well, and nothing without an exposure",
        )
    }

    fn work(&self) -> Work {
        Work::Pointwise(dark_current)
    }

    fn pack(&self, settings: &Settings, view: &View, packer: &mut Packer<'_>) {
        packer.number(Self::mean(settings, view));
    }
}
