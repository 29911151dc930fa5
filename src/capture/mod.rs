//! A capture: the folder that holds a camera, a scene, a trajectory and the times of the frames (CAPTURE contract).

use std::path::{Path, PathBuf};

use crate::camera::{Intrinsics, Trajectory};
use crate::chain::Settings;
use crate::error::Result;
use crate::scene::Scene;

/// What `camera.toml` says.
#[derive(Clone, Debug)]
pub struct CameraFile {
    /// The file.
    pub path: PathBuf,
    /// Size and pinhole.
    pub intrinsics: Intrinsics,
    /// Time from one frame to the next, s.
    pub frame_period_s: f64,
    /// Pixels that no geometry covers are left out of every comparison (else they are black).
    pub background_ignored: bool,
    /// The camera rests during each frame: poses are looked up, never differenced.
    pub static_camera: bool,
    /// Whether the scene is lit by `lights.toml` (else `kd` is radiance).
    pub lit: bool,
    /// The modelled effects.
    pub settings: Settings,
}

/// One line of `frames.csv`.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameEntry {
    /// START of exposure of the first row exposed, as written, ns.
    pub timestamp_ns: i64,
    /// The same, s on the capture's clock.
    pub start_s: f64,
    /// File name, as written: `000000.png`.
    pub filename: String,
}

/// A whole capture. All times in s are on the capture's clock, which starts at `epoch_ns`: timestamps of 19 digits
/// keep their nanoseconds.
#[derive(Clone, Debug)]
pub struct Capture {
    /// The folder.
    pub root: PathBuf,
    /// `camera.toml`, or the file given in its stead.
    pub camera: CameraFile,
    /// `scene.obj` with its materials, textures, objects and lights.
    pub scene: Scene,
    /// World from camera over time.
    pub trajectory: Trajectory,
    /// The frames, in the order of `frames.csv`.
    pub frames: Vec<FrameEntry>,
    /// Zero of the capture's clock, ns.
    pub epoch_ns: i64,
}

impl Capture {
    /// Reads a capture; `camera` replaces its `camera.toml`.
    ///
    /// # Errors
    /// Everything that is missing or wrong, with file and line.
    pub fn read(_root: &Path, _camera: Option<&Path>) -> Result<Self> {
        unimplemented!()
    }
}
