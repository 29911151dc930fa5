//! The camera's clock is not the trajectory's: true start = timestamp + offset (docs/reference/camera.md). Acts where a
//! frame is requested: [`crate::capture::Capture::shutter`].

use crate::chain::{Effect, Fit, Law, Number, ParamSpec, Settings, Stage};

/// The effect; its values live in [`Settings`].
pub struct TimeOffset;

pub(super) const SPECS: &[ParamSpec] = &[ParamSpec::number(
    "offset_s",
    "s",
    (-1.0, 1.0),
    0.0,
    "how much later than its timestamp a frame starts",
)
.fit(
    Fit::by(1e-3)
        .within(-0.5, 0.5)
        .starts(&[-0.6, -0.3, -0.1, 0.1, 0.3, 0.6])
        .trial(Law::Either, 0.004, 0.06)
        .graded(1e-4, 1e-2),
)];

const OFFSET_S: Number = Number::of("time_offset", SPECS, "offset_s");

impl TimeOffset {
    /// Offset, s; 0 when the effect is off.
    pub fn offset_s(settings: &Settings) -> f64 {
        settings.value(OFFSET_S)
    }
}

impl Effect for TimeOffset {
    fn id(&self) -> &'static str {
        "time_offset"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::SetUp
    }

    fn shown_by(&self) -> &'static str {
        "upright edges while the camera changes its speed"
    }
}
