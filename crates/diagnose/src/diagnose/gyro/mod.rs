//! Footage of a far scene and what a gyro measured meanwhile, without a scene: readout time, exposure and the offset
//! of the clocks, from rotation alone.
//!
//! ```text
//! frames ─ displacements from each to the next ─┐
//! gyro ─ turn between the times of two lines ───┴─ time of each line (paths) ─ blur of neighbours (blur) ─ Report
//! ```
//!
//! What a frame shows is known from the frame beside it. A far point seen in a line of one frame is seen in a line of
//! the next, and the gyro says how far the camera turned between the times of both; the times that fit all points are
//! those of the lines. They are the middles of exposures. How long these are follows from how blurred two neighbours
//! are against each other, as their speeds differ.

mod axes;
mod blur;
mod input;
mod outcome;
mod paths;
mod step;
mod turn;

use std::path::Path;
use std::time::Instant;

use crate::diagnose::evidence::budget::Budget;
use crate::diagnose::expect::options::{DiagnoseOptions, Progress, candidates};
use crate::diagnose::report::Report;
use shutterbug::capture::CameraFile;
use shutterbug::error::{Error, Result};

/// A finished diagnosis of footage beside a gyro.
pub struct Gyroed {
    /// What was found.
    pub report: Report,
    /// The given camera with what was found.
    pub camera: CameraFile,
    shown: Vec<outcome::Shown>,
}

/// Diagnoses the footage of a folder with `frames.csv`, `camera.toml` and `imu.csv`. No device is needed.
///
/// # Errors
/// Files that are not there or cannot be read, with what was expected; too few frames that the gyro covers; names in
/// `without` that are no candidate's.
pub fn diagnose_gyro(real: &Path, options: &DiagnoseOptions, progress: &mut dyn Progress) -> Result<Gyroed> {
    let begun = options.begun.unwrap_or_else(Instant::now);
    let budget = Budget::new(begun, options.time_limit);
    let names = candidates(options)?;
    let footage = input::Footage::read(real)?;
    let count = footage.pairs.len();
    let mut steps = Vec::new();
    for (k, pair) in footage.pairs.iter().enumerate() {
        budget.go_on()?;
        if options.stop.as_ref().is_some_and(|s| s.load(std::sync::atomic::Ordering::Relaxed)) {
            return Err(Error::DiagnosisInterrupted { at: "displacements".to_owned(), kept: None });
        }
        progress.step("displacements", &footage.frames[pair[0]].name, k + 1, count);
        steps.push(step::Step::of(&footage, *pair, &|| budget.go_on())?);
    }
    progress.step("times of lines", "all pairs of frames", 1, 1);
    let timed = paths::fit(&footage, &steps);
    let blurred = match &timed {
        Some(timed) if timed.is_trusted() => {
            progress.step("exposure", "blur of neighbouring frames", 1, 1);
            blur::exposure(&footage, &steps, timed, &budget)?
        }
        _ => None,
    };
    let (mut report, theta, set) =
        outcome::report(&footage, &steps, timed.as_ref(), blurred.as_ref(), &names);
    report.input.seed = options.seed;
    report.input.seconds = begun.elapsed().as_secs_f64();
    let mut camera = footage.camera.clone();
    crate::diagnose::expect::settings::apply(&mut camera.settings, &theta, &set)?;
    let shown = outcome::shown(&footage, &steps, timed.as_ref())?;
    Ok(Gyroed { report, camera, shown })
}
