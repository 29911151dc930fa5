//! The camera model that all file formats are converted to and from.

use shutterbug::camera::{Distortion, Intrinsics, Lens, Pose};
use shutterbug::capture::CameraFile;
use shutterbug::chain::{Effect as _, ParamSpec, Settings, Value, neutral};
use shutterbug::effects::{self, LensDistortion, RollingShutter};
use shutterbug::error::{Error, Result};

/// What all formats together know about a camera. Lengths in px as in [`Intrinsics`]: pixel centres at +0.5.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraModel {
    /// The camera's name in its file, or of its file.
    pub name: String,
    /// Size and pinhole.
    pub intrinsics: Intrinsics,
    /// The lens.
    pub distortion: Distortion,
    /// Frames a second, where the format says it.
    pub rate_hz: Option<f64>,
    /// Where the camera sits on its body (IMU, robot), where the format says it.
    pub body_from_camera: Option<Pose>,
    /// All other effects: shutter, noise and so on.
    pub settings: Settings,
}

/// The camera that was read, and notes on what this program cannot hold.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The camera.
    pub camera: CameraModel,
    /// One sentence for each thing that was left out or assumed.
    pub notes: Vec<String>,
}

impl CameraModel {
    /// A pinhole without effects.
    pub fn new(name: impl Into<String>, intrinsics: Intrinsics) -> Self {
        Self {
            name: name.into(),
            intrinsics,
            distortion: Distortion::None,
            rate_hz: None,
            body_from_camera: None,
            settings: Settings::default(),
        }
    }

    /// The delay from one row to the next, s; `None` for a global shutter or another scan order than top to bottom.
    pub fn line_delay_s(&self) -> Option<f64> {
        let readout_s = RollingShutter::readout_time_s(&self.settings);
        let by_rows = RollingShutter::scan_order(&self.settings).name() == "top_to_bottom";
        (readout_s > 0.0 && by_rows).then(|| readout_s / f64::from(self.intrinsics.height))
    }

    /// Sets the rolling shutter from the delay of a row.
    ///
    /// # Errors
    /// A readout outside the effect's range.
    pub fn set_line_delay_s(&mut self, line_delay_s: f64) -> Result<()> {
        let readout_s = line_delay_s * f64::from(self.intrinsics.height);
        self.settings.set(&RollingShutter, "readout_time_s", Value::Number(readout_s))
    }

    /// Checks that the lens can be inverted in the picture.
    ///
    /// # Errors
    /// [`Error::LensFolds`].
    pub fn check_lens(&self) -> Result<()> {
        Lens::new(self.intrinsics, self.distortion).map(|_| ())
    }

    /// The camera that a `camera.toml` describes.
    pub fn from_camera_file(camera: &CameraFile) -> Self {
        let name = camera.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mut settings = camera.settings.clone();
        let distortion = LensDistortion::distortion(&settings);
        settings.disable(LensDistortion.id());
        Self {
            distortion,
            rate_hz: Some(1.0 / camera.frame_period_s),
            settings,
            ..Self::new(name, camera.intrinsics)
        }
    }

    /// The `camera.toml` that says the same, and what has no place in it. `rate_hz` is for sources that know none.
    ///
    /// # Errors
    /// No frame rate at all; a coefficient outside the range of its parameter.
    pub fn to_camera_file(
        &self,
        path: &std::path::Path,
        rate_hz: Option<f64>,
    ) -> Result<(CameraFile, Vec<String>)> {
        let Some(rate_hz) = rate_hz.or(self.rate_hz) else {
            let expected = "one in the source, or --rate-hz: camera.toml states the frame period";
            return Err(Error::input(path, None, "no frame rate", expected));
        };
        let mut settings = self.settings.clone();
        let mut notes = Vec::new();
        if !self.distortion.is_identity() {
            LensDistortion::set(&mut settings, &self.distortion)?;
        }
        if self.body_from_camera.is_some() {
            notes.push(
                "the camera's place on its body has no place in camera.toml: trajectory.tum holds the camera's own \
                 poses"
                    .to_owned(),
            );
        }
        let pinhole = CameraFile::pinhole(path.to_owned(), self.intrinsics, 1.0 / rate_hz);
        let camera = CameraFile { settings, ..pinhole };
        Ok((camera, notes))
    }

    /// One line for each effect that a format without place for it leaves out. Neutral effects change nothing and are
    /// not mentioned; `held` are those that the format does hold.
    pub fn left_out(&self, target: &str, held: &[&str]) -> Vec<String> {
        let mut lines = Vec::new();
        for (effect, values) in self.settings.iter() {
            let specs = effects::by_id(effect).map(|e| e.specs()).unwrap_or_default();
            let differs: Vec<String> = values
                .iter()
                .filter(|(name, value)| specs.iter().any(|s| s.name == **name && !is_neutral(s, value)))
                .map(|(name, value)| format!("{name} = {}", written(value)))
                .collect();
            if !differs.is_empty() && !held.contains(&effect) {
                lines.push(format!("{effect} ({}) has no place in {target}", differs.join(", ")));
            }
        }
        lines
    }
}

fn is_neutral(spec: &ParamSpec, value: &Value) -> bool {
    *value == neutral(&spec.kind)
}

fn written(value: &Value) -> String {
    match value {
        Value::Number(n) => n.to_string(),
        Value::Choice(c) => (*c).to_owned(),
        Value::Vector3(v) => format!("{v:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_effects_that_change_something_are_left_out_aloud() {
        let k = Intrinsics { width: 64, height: 48, fx: 50.0, fy: 50.0, cx: 32.0, cy: 24.0 };
        let mut camera = CameraModel::new("c", k);
        camera.settings.enable(&effects::MotionBlur);
        assert!(camera.left_out("X", &[]).is_empty());
        camera.set_line_delay_s(1e-4).expect("in range");
        assert_eq!(camera.left_out("X", &[]).len(), 1);
        assert!(camera.left_out("X", &["rolling_shutter"]).is_empty());
        assert!((camera.line_delay_s().expect("rolling") - 1e-4).abs() < 1e-18);
        assert!(camera.set_line_delay_s(1.0).is_err());
    }
}
