//! Presets: real cameras as `camera.toml` files that ship in the program, with the source of every number.
//!
//! A preset is a whole camera, so it can be written to a file and used as one. Put on a capture
//! (`simulate --preset NAME`) it gives its effects only: size, pinhole and frame period stay the capture's, because the
//! real or nominal pictures were taken with them, and an effect that the capture's `camera.toml` has keeps its own
//! values.

use std::borrow::Cow;

use shutterbug::capture::CameraFile;
use shutterbug::effects;
use shutterbug::error::Result;

/// A preset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Preset {
    /// Its name.
    pub name: Cow<'static, str>,
    /// Its `camera.toml`, with the source of every number as comments.
    pub toml: Cow<'static, str>,
}

impl Preset {
    const fn shipped(name: &'static str, toml: &'static str) -> Self {
        Self { name: Cow::Borrowed(name), toml: Cow::Borrowed(toml) }
    }
}

/// All presets that ship.
pub const PRESETS: &[Preset] = &[
    Preset::shipped("humanoid-2008", include_str!("../../presets/humanoid-2008.toml")),
    Preset::shipped("machine-vision", include_str!("../../presets/machine-vision.toml")),
    Preset::shipped("phone", include_str!("../../presets/phone.toml")),
    Preset::shipped("usb-webcam", include_str!("../../presets/usb-webcam.toml")),
];

impl Preset {
    /// What it is: the first line of the file.
    pub fn about(&self) -> &str {
        self.toml.lines().next().unwrap_or_default().trim_start_matches(['#', ' '])
    }

    /// The camera.
    ///
    /// # Errors
    /// An effect or a parameter that this build does not have.
    pub fn camera(&self) -> Result<CameraFile> {
        CameraFile::parse(&std::path::PathBuf::from(format!("preset {}", self.name)), &self.toml)
    }
}

/// Adds the preset's effects to a camera; those that the camera has keep their own values. Returns what is worth
/// saying: effects that were kept, lengths in px that belong to another size.
///
/// # Errors
/// As [`Preset::camera`], and values that contradict each other with the camera's frame period.
pub fn apply_preset(preset: &Preset, camera: &mut CameraFile) -> Result<Vec<String>> {
    let from = preset.camera()?;
    let mut notes = Vec::new();
    for effect in effects::LIST.iter().filter(|e| from.settings.has(e.id())) {
        if camera.settings.has(effect.id()) {
            notes.push(format!("{} is the camera's own, not the preset's", effect.id()));
            continue;
        }
        camera.settings.enable(*effect);
        for spec in effect.specs() {
            if let Some(value) = from.settings.get(effect.id(), spec.name) {
                camera.settings.set(*effect, spec.name, value)?;
            }
        }
        let in_px = effect.specs().iter().any(|s| s.unit == "px" || s.name.ends_with("_px"));
        if in_px && camera.intrinsics.width != from.intrinsics.width {
            let (own, preset) = (camera.intrinsics.width, from.intrinsics.width);
            notes.push(format!(
                "{}: lengths in px are for {preset} px of width, the camera has {own}",
                effect.id()
            ));
        }
    }
    let [own, theirs] = [&*camera, &from].map(|c| c.intrinsics.fx / f64::from(c.intrinsics.width));
    let bent = from.settings.has("lens_distortion") && (own / theirs - 1.0).abs() > 0.01;
    if bent {
        notes.push(format!(
            "lens_distortion belongs to a focal length of {theirs:.3} widths, the camera has {own:.3}: use the \
             preset's pinhole for its field of view"
        ));
    }
    for effect in effects::LIST.iter().filter(|e| camera.settings.has(e.id())) {
        for warning in effect.warnings(&camera.settings, camera.frame_period_s)? {
            if !camera.warnings.contains(&warning) {
                notes.push(warning.clone());
                camera.warnings.push(warning);
            }
        }
    }
    Ok(notes)
}
