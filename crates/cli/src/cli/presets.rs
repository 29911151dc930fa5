//! `shutterbug presets`.

use super::terminal::print;
use crate::formats::{PRESETS, Preset, preset};
use shutterbug::effects::{MotionBlur, RollingShutter};
use shutterbug::error::Result;

/// Lists the presets, or prints one.
pub fn run(name: Option<&str>) -> Result<()> {
    if let Some(name) = name {
        return print(preset(name)?.toml);
    }
    let mut text: String = PRESETS.iter().map(describe).collect::<Result<_>>()?;
    text += "\nshutterbug presets NAME prints one with the source of every number.\n";
    text += "shutterbug simulate CAPTURE --preset NAME adds its effects to a capture's camera.\n";
    print(text)
}

fn describe(preset: &Preset) -> Result<String> {
    let camera = preset.camera()?;
    let k = &camera.intrinsics;
    let fov_deg = 2.0 * (0.5 * f64::from(k.width) / k.fx).atan().to_degrees();
    let shutter = match RollingShutter::readout_time_s(&camera.settings) {
        0.0 => "global shutter".to_owned(),
        readout_s => format!("rolling shutter {:.1} ms", readout_s * 1e3),
    };
    let exposure_ms = MotionBlur::exposure_time_s(&camera.settings) * 1e3;
    Ok(format!(
        "{:<16} {}\n{:16} {}x{}, {:.0} frames a second, {fov_deg:.0} degrees across, {shutter}, exposure {exposure_ms:.1} ms\n",
        preset.name,
        preset.about(),
        "",
        k.width,
        k.height,
        1.0 / camera.frame_period_s,
    ))
}
