//! Every line is the mean of the linear radiance over [start, start + exposure] (docs/reference/camera.md; the paper's
//! section 3.3).

use crate::chain::{Effect, Fit, Law, Number, ParamSpec, Settings, Stage};
use crate::error::Result;

/// The effect; its values live in [`Settings`].
pub struct MotionBlur;

pub(super) const SPECS: &[ParamSpec] =
    &[ParamSpec::number("exposure_time_s", "s", (0.0, 1.0), 0.0, "how long every line integrates").fit(
        // Beside what explains most of a gap hardly any blur is the likeliest.
        Fit::by(2e-3)
            .within(0.0, 0.5)
            .starts(&[0.03, 0.1, 0.25, 0.5, 0.85])
            .trial(Law::Up, 0.004, 0.028)
            .graded(5e-4, 2e-2),
    )];

const EXPOSURE_TIME_S: Number = Number::of("motion_blur", SPECS, "exposure_time_s");

impl MotionBlur {
    /// Exposure time, s; 0 when the effect is off.
    pub fn exposure_time_s(settings: &Settings) -> f64 {
        settings.value(EXPOSURE_TIME_S)
    }
}

impl Effect for MotionBlur {
    fn id(&self) -> &'static str {
        "motion_blur"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Time
    }

    fn shown_by(&self) -> &'static str {
        "upright edges in pans of several speeds"
    }

    fn check(&self, settings: &Settings, frame_period_s: f64) -> Result<Vec<String>> {
        let exposure_s = Self::exposure_time_s(settings);
        if exposure_s <= frame_period_s {
            return Ok(Vec::new());
        }
        let global = super::RollingShutter::readout_time_s(settings) == 0.0;
        let shutter = if global { ", which no sensor with a global shutter can do" } else { "" };
        Ok(vec![format!(
            "motion_blur.exposure_time_s = {exposure_s} s is longer than frame_period_s = {frame_period_s} s: \
             exposures overlap in time{shutter}"
        )])
    }
}
