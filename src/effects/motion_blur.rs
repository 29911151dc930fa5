//! Every line is the mean of the linear radiance over [start, start + exposure] (CAPTURE contract; the paper's
//! section 3.3).

use crate::chain::{Effect, ParamKind, ParamSpec, Settings, Stage};
use crate::error::Result;

/// The effect; its values live in [`Settings`].
pub struct MotionBlur;

const SPECS: &[ParamSpec] = &[ParamSpec {
    name: "exposure_time_s",
    unit: "s",
    kind: ParamKind::Number { min: 0.0, max: 1.0, neutral: 0.0 },
    about: "how long every line integrates",
}];

impl MotionBlur {
    /// Exposure time, s; 0 when the effect is off.
    pub fn exposure_time_s(settings: &Settings) -> f64 {
        settings.number("motion_blur", "exposure_time_s", 0.0)
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

    fn check(&self, settings: &Settings, frame_period_s: f64) -> Result<Vec<String>> {
        let exposure_s = Self::exposure_time_s(settings);
        if exposure_s <= frame_period_s {
            return Ok(Vec::new());
        }
        let global = settings.number("rolling_shutter", "readout_time_s", 0.0) == 0.0;
        let shutter = if global { ", which no sensor with a global shutter can do" } else { "" };
        Ok(vec![format!(
            "motion_blur.exposure_time_s = {exposure_s} s is longer than frame_period_s = {frame_period_s} s: \
             exposures overlap in time{shutter}"
        )])
    }
}
