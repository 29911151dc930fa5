//! Cameras as text, presets, and the command line.

use std::ffi::OsString;
use std::path::Path;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use shutterbug::capture::CameraFile;
use shutterbug_cli::formats::{self, Format};

use crate::status::input_error;

/// Checks a `camera.toml` and returns the same camera with every parameter written out, and what is worth saying of it.
#[pyfunction]
pub fn check_camera(py: Python<'_>, text: &str, name: &str) -> PyResult<(String, Vec<String>)> {
    let file = CameraFile::parse(Path::new(name), text).map_err(|e| input_error(py, &e))?;
    Ok((file.to_toml(), file.warnings))
}

/// A camera in another tool's format (`toml`, `ros`, `kalibr`, `euroc`, `gyroflow`; `None`: the content decides) as
/// `camera.toml`, and what that cannot hold. `rate_hz` counts where the text does not say it.
#[pyfunction]
#[pyo3(signature = (text, name, format=None, camera=None, rate_hz=None))]
pub fn import_camera(
    py: Python<'_>,
    text: &str,
    name: &str,
    format: Option<&str>,
    camera: Option<&str>,
    rate_hz: Option<f64>,
) -> PyResult<(String, Vec<String>)> {
    let path = Path::new(name);
    let format = format
        .map(|wanted| {
            let known = Format::ALL.into_iter().find(|f| f.name() == wanted);
            known.ok_or_else(|| PyValueError::new_err(format!("no such format: {wanted}")))
        })
        .transpose()?;
    let read = formats::parse_camera(path, text, format, camera).map_err(|e| input_error(py, &e))?;
    // Where it is mounted is the poses' affair.
    let rate_hz = read.camera.rate_hz.or(rate_hz);
    let model = formats::CameraModel { body_from_camera: None, ..read.camera };
    let (toml, left_out) =
        formats::write_camera(&model, Format::Toml, path, rate_hz).map_err(|e| input_error(py, &e))?;
    Ok((toml, read.notes.into_iter().chain(left_out).collect()))
}

/// Names of the presets, each with a line about it.
#[pyfunction]
pub fn presets() -> Vec<(&'static str, &'static str)> {
    formats::PRESETS.iter().map(|p| (&*p.name, p.about())).collect()
}

/// A preset's `camera.toml`, with the source of every number as comments.
#[pyfunction]
pub fn preset_text(py: Python<'_>, name: &str) -> PyResult<String> {
    formats::preset(name, None, "name").map(|p| p.toml.into_owned()).map_err(|e| input_error(py, &e))
}

/// Runs the command line in this process, whose signals it takes over, and returns its exit code. The first argument is
/// the program's name.
#[pyfunction]
pub fn run_command_line(py: Python<'_>, args: Vec<OsString>) -> u8 {
    py.detach(|| shutterbug_cli::cli::run_from(args))
}
