//! Lines are read one after another: line i of N in scan order starts at timestamp + readout i/N
//! (docs/reference/camera.md; the paper's eq. 1 with the readout in seconds instead of frames).

use crate::camera::ScanOrder;
use crate::chain::{Choice, Effect, Fit, Held, Law, Number, ParamSpec, Settings, Stage};
use crate::error::Result;

/// The effect; its values live in [`Settings`].
pub struct RollingShutter;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::number(
        "readout_time_s",
        "s",
        (0.0, 1.0),
        0.0,
        "N times the delay from line to line (not N - 1 times)",
    )
    .fit(
        Fit::by(2e-3)
            .within(0.0, 0.5)
            .starts(&[0.2, 0.5, 0.9])
            .trial(Law::Up, 0.005, 0.031)
            .graded(2e-4, 2e-2),
    ),
    ParamSpec::choice(
        "scan_order",
        &["top_to_bottom", "bottom_to_top", "left_to_right", "right_to_left"],
        "which line is read first",
    )
    .beside(&["readout_time_s"])
    .fit(Fit::choice().held(Held::Aside).trial(Law::Option, -1.5, 1.0)),
];

const READOUT_TIME_S: Number = Number::of("rolling_shutter", SPECS, "readout_time_s");
const SCAN_ORDER: Choice = Choice::of("rolling_shutter", SPECS, "scan_order");

impl RollingShutter {
    /// Readout time, s; 0 when the effect is off.
    pub fn readout_time_s(settings: &Settings) -> f64 {
        settings.value(READOUT_TIME_S)
    }

    /// Scan order; top to bottom when the effect is off.
    pub fn scan_order(settings: &Settings) -> ScanOrder {
        let name = settings.chosen(SCAN_ORDER);
        name.and_then(ScanOrder::from_name).unwrap_or_default()
    }
}

impl Effect for RollingShutter {
    fn id(&self) -> &'static str {
        "rolling_shutter"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Time
    }

    fn check(&self, settings: &Settings, frame_period_s: f64) -> Result<Vec<String>> {
        let readout_s = Self::readout_time_s(settings);
        if readout_s <= frame_period_s {
            return Ok(Vec::new());
        }
        Ok(vec![format!(
            "rolling_shutter.readout_time_s = {readout_s} s is longer than frame_period_s = {frame_period_s} s: \
             frames overlap in time"
        )])
    }
}
