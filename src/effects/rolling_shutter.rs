//! Lines are read one after another: line i of N in scan order starts at timestamp + readout i/N (CAPTURE contract;
//! the paper's eq. 1 with the readout in seconds instead of frames).

use crate::camera::ScanOrder;
use crate::chain::{Effect, ParamKind, ParamSpec, Settings, Stage};
use crate::error::Result;

/// The effect; its values live in [`Settings`].
pub struct RollingShutter;

const SPECS: &[ParamSpec] = &[
    ParamSpec {
        name: "readout_time_s",
        unit: "s",
        kind: ParamKind::Number { min: 0.0, max: 1.0, neutral: 0.0 },
        about: "N times the delay from line to line (not N - 1 times)",
    },
    ParamSpec {
        name: "scan_order",
        unit: "",
        kind: ParamKind::Choice {
            options: &["top_to_bottom", "bottom_to_top", "left_to_right", "right_to_left"],
            neutral: "top_to_bottom",
        },
        about: "which line is read first",
    },
];

impl RollingShutter {
    /// Readout time, s; 0 when the effect is off.
    pub fn readout_time_s(settings: &Settings) -> f64 {
        settings.number("rolling_shutter", "readout_time_s", 0.0)
    }

    /// Scan order; top to bottom when the effect is off.
    pub fn scan_order(settings: &Settings) -> ScanOrder {
        let name = settings.choice("rolling_shutter", "scan_order");
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
