//! Cameras and motion in the files that users have: ROS `camera_info`, Kalibr camchain, EuRoC `sensor.yaml` and `mav0`,
//! Gyroflow's lens profiles, KITTI poses in; the cameras and Gazebo's SDF out; and presets of real cameras.
//!
//! Nothing is dropped silently: what a format cannot hold comes back as a list of sentences, and stands as comments in
//! a written file. OpenCV, ROS, Kalibr and EuRoC put pixel centres at whole numbers, this program at halves: cx and cy
//! differ by 0.5.

mod capture;
mod common;
mod euroc;
mod gyroflow;
mod kalibr;
mod kalibr_target;
mod model;
mod motion;
mod presets;
mod profiles;
mod refit;
mod ros;
mod sdf;
#[cfg(test)]
mod tests;
mod yaml;

use std::path::Path;

pub use capture::read_capture;
pub use kalibr_target::{KalibrTarget, read_target};
pub use model::{CameraModel, Imported};
pub use motion::{Motion, body_from_sensor, read_euroc, read_kitti, read_times};
pub use presets::{PRESETS, Preset, apply_preset};
pub use profiles::{Profile, Profiles, preset};

use shutterbug::capture::{CameraFile, read_text};
use shutterbug::error::{Error, Result};
use shutterbug::files::Limit;
use yaml::Field;

/// Frame rates that a file can state: about one frame a day, to a frame a microsecond.
const RATE_HZ: (f64, f64) = (1e-5, 1e6);

/// A format of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// `camera.toml`.
    Toml,
    /// ROS `camera_info` YAML.
    Ros,
    /// Kalibr camchain YAML.
    Kalibr,
    /// EuRoC / ASL `sensor.yaml`.
    Euroc,
    /// Gyroflow's lens profile, JSON.
    Gyroflow,
    /// Gazebo's SDF; written only.
    Sdf,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 6] = [Self::Toml, Self::Ros, Self::Kalibr, Self::Euroc, Self::Gyroflow, Self::Sdf];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Toml => "toml",
            Self::Ros => "ros",
            Self::Kalibr => "kalibr",
            Self::Euroc => "euroc",
            Self::Gyroflow => "gyroflow",
            Self::Sdf => "sdf",
        }
    }
}

/// Reads a camera. Without `format` the content decides; `camera` chooses one of several in a camchain.
///
/// # Errors
/// A file that is missing, is of no known format or holds something unusable; with file and line.
pub fn read_camera(path: &Path, format: Option<Format>, camera: Option<&str>) -> Result<Imported> {
    let purpose =
        "a camera: camera.toml, ROS camera_info, Kalibr camchain, EuRoC sensor.yaml or a lens profile";
    let text = read_text(path, purpose, Limit::SETTINGS)?;
    parse_camera(path, &text, format, camera)
}

/// Reads a camera's text; `path` is what errors name.
///
/// # Errors
/// As [`read_camera`].
pub fn parse_camera(
    path: &Path,
    text: &str,
    format: Option<Format>,
    camera: Option<&str>,
) -> Result<Imported> {
    let toml_name = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    if format == Some(Format::Toml) || (format.is_none() && toml_name) {
        refuse_name(path, camera)?;
        let file = CameraFile::parse(path, text)?;
        let camera = CameraModel::from_camera_file(&file);
        camera.check_lens().map_err(|problem| Error::At {
            path: path.to_owned(),
            line: None,
            problem: Box::new(problem),
            hint: String::new(),
        })?;
        return Ok(Imported { camera, notes: file.warnings });
    }
    if format == Some(Format::Sdf) {
        let expected = "toml, ros, kalibr, euroc or gyroflow: SDF is written only";
        return Err(Error::input(Path::new("--from"), None, "sdf", expected));
    }
    if text.trim_start_matches('\u{feff}').trim_start().starts_with('<') {
        let expected = "camera.toml, or the YAML of ROS, Kalibr or EuRoC: SDF is written only";
        return Err(Error::input(path, None, "XML (Gazebo's SDF?)", expected));
    }
    let documents = yaml::parse(path, text)?;
    let top = Field::top(path, &documents[0]);
    let format = match format {
        Some(format) => format,
        None => detect(&top)?,
    };
    refuse_name(path, camera.filter(|_| format != Format::Kalibr))?;
    let mut imported = match format {
        Format::Kalibr => kalibr::import(&top, camera)?,
        Format::Euroc => euroc::import(&top)?,
        Format::Gyroflow => gyroflow::import(&top)?,
        _ => ros::import(&top)?,
    };
    imported.notes.extend(imported.camera.intrinsics.doubts());
    if documents.len() > 1 {
        let others = documents.len() - 1;
        imported.notes.push(format!("{others} further YAML document(s) in the file are left out"));
    }
    Ok(imported)
}

/// A file of one camera has none to choose.
fn refuse_name(path: &Path, camera: Option<&str>) -> Result<()> {
    let Some(name) = camera else { return Ok(()) };
    let found = format!("one camera, and a request for `{name}`");
    Err(Error::input(path, None, found, "a Kalibr camchain, or no name"))
}

fn detect(top: &Field) -> Result<Format> {
    if ros::recognises(top) {
        return Ok(Format::Ros);
    }
    if gyroflow::recognises(top) {
        return Ok(Format::Gyroflow);
    }
    if euroc::recognises(top) {
        return Ok(Format::Euroc);
    }
    if kalibr::recognises(top) {
        return Ok(Format::Kalibr);
    }
    let keys: Vec<_> = top.keys().into_iter().take(5).map(yaml::shortened).collect();
    let found = format!("YAML of no known format (keys: {})", keys.join(", "));
    let expected = "`camera_matrix` or `K` (ROS), `cam0` (Kalibr), `sensor_type: camera` (EuRoC) or `fisheye_params` \
                    (Gyroflow)";
    Err(Error::input(top.path(), top.line(), found, expected))
}

/// The text of a camera in a format, and what the format cannot hold (which also stands in the text as comments).
/// `path` is what errors name; `rate_hz` is for cameras without a frame rate of their own.
///
/// # Errors
/// `camera.toml` without any frame rate, or with a value outside its range.
pub fn write_camera(
    camera: &CameraModel,
    format: Format,
    path: &Path,
    rate_hz: Option<f64>,
) -> Result<(String, Vec<String>)> {
    if let Some((asked, stated)) = rate_hz.zip(camera.rate_hz)
        && (asked / stated - 1.0).abs() > 1e-6
    {
        let found = format!("{asked} Hz, and {} states {stated:.6}", path.display());
        return Err(Error::input(Path::new("--rate-hz"), None, found, "the source's rate, or none"));
    }
    let camera = CameraModel { rate_hz: rate_hz.or(camera.rate_hz), ..camera.clone() };
    match format {
        Format::Toml => {
            let (file, notes) = camera.to_camera_file(path, rate_hz)?;
            Ok((common::comments(&notes) + &file.to_toml(), notes))
        }
        Format::Ros => Ok(ros::export(&camera)),
        Format::Kalibr => Ok(kalibr::export(&camera)),
        Format::Euroc => Ok(euroc::export(&camera)),
        Format::Gyroflow => Ok(gyroflow::export(&camera)),
        Format::Sdf => Ok(sdf::export(&camera)),
    }
}
