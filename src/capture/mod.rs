//! A capture: the folder that holds a camera, a scene, a trajectory and the times of the frames
//! (docs/reference/capture.md).

mod camera_toml;
mod columns;
mod effect_tables;
mod frames_csv;
mod gaps;
mod json;
mod lights;
mod text;
mod tum;
mod units;

use std::path::{Path, PathBuf};

pub use camera_toml::CameraFile;
pub use columns::{IMU_COLUMNS, check_columns, check_rates, is_header};
pub use frames_csv::{FrameEntry, clock_epoch_ns, is_plain_name, parse_frames};
pub use json::{JsonFault, parse_json};
pub use lights::parse_lights;

use crate::camera::{Intrinsics, Lens, Pose, ShutterTiming, Trajectory};
use crate::effects::{FocalLengthError, LensDistortion, PoseOffset, TimeOffset};
use crate::error::{Error, Result};
use crate::files::Limit;
use crate::scene::{Scene, Shading, load_obj};
pub use text::read_text;
pub use units::of_period;

/// A whole capture. All times in s are on the capture's clock (see [`clock_epoch_ns`]), so that timestamps of 19 digits
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
    /// Zero of the capture's clock, ns: see [`clock_epoch_ns`].
    pub epoch_ns: i64,
}

impl Capture {
    /// Reads a capture; `camera` replaces its `camera.toml`. Warnings (see [`CameraFile::warnings`]) are emitted.
    ///
    /// # Errors
    /// Everything that is missing or wrong, with file and line.
    pub fn read(root: &Path, camera: Option<&Path>) -> Result<Self> {
        Self::read_with(root, camera, CameraFile::read)
    }

    /// Reads a capture whose camera is read by `read_camera`: from another format, or with a preset's effects.
    ///
    /// # Errors
    /// As [`Self::read`], and those of `read_camera`.
    pub fn read_with(
        root: &Path,
        camera: Option<&Path>,
        read_camera: impl FnOnce(&Path) -> Result<CameraFile>,
    ) -> Result<Self> {
        let camera_path = camera.map_or_else(|| root.join("camera.toml"), Path::to_owned);
        check_present(root, &camera_path)?;
        let mut camera = read_camera(&camera_path)?;
        if camera.linear {
            let warning = "`linear = true` says how a simulator's pictures are encoded; a capture has none of them, \
                           and its frames are read as sRGB";
            tracing::warn!("{}: {warning}", camera_path.display());
            camera.warnings.push(warning.to_owned());
        }
        let mut scene = load_obj(&root.join("scene.obj"), root)?;
        if camera.lit {
            let path = root.join("lights.toml");
            let text =
                read_text(&path, "the point lights, as the camera says shading = \"lit\"", Limit::SETTINGS)?;
            scene.shading = Shading::Lit(parse_lights(&path, &text)?);
        }
        Self::with_scene(root, camera, scene)
    }

    /// Reads the times and poses of a capture whose camera and scene are at hand.
    ///
    /// # Errors
    /// As [`Self::read`], for `frames.csv`, `trajectory.tum` and `objects/`.
    pub fn with_scene(root: &Path, mut camera: CameraFile, mut scene: Scene) -> Result<Self> {
        check_lens(&camera)?;
        let path = root.join("frames.csv");
        let text = read_text(&path, "the frames: lines of `timestamp in ns,file name`", Limit::TABLE)?;
        let frames = parse_frames(&path, &text)?;
        let epoch_ns = clock_epoch_ns(frames[0].timestamp_ns);
        if let Some(warning) = spacing_warning(&frames, camera.frame_period_s) {
            tracing::warn!("{}: {warning}", path.display());
            camera.warnings.push(warning);
        }
        let trajectory = tum::read_trajectory(&root.join("trajectory.tum"), epoch_ns)?;
        tum::bind_objects(root, epoch_ns, &mut scene)?;
        let mut capture = Self { root: root.to_owned(), camera, scene, trajectory, frames, epoch_ns };
        capture.check_coverage()?;
        if let Some(warning) = units::unused_poses(&capture) {
            tracing::warn!("{warning}");
            capture.camera.warnings.push(warning);
        }
        Ok(capture)
    }

    /// The camera that took the frames: `camera.toml`'s, with its `focal_length_error`.
    pub fn true_intrinsics(&self) -> Intrinsics {
        FocalLengthError::apply(&self.camera.settings, &self.camera.intrinsics)
    }

    /// The path of the camera that took the frames: `trajectory.tum`, with the camera's `pose_offset`.
    pub fn true_trajectory(&self) -> Trajectory {
        PoseOffset::apply(&self.camera.settings, &self.trajectory)
    }

    /// When a frame truly starts, s: its timestamp with the camera's `time_offset`.
    fn start_s(&self, frame: usize) -> f64 {
        self.frames[frame].start_s + TimeOffset::offset_s(&self.camera.settings)
    }

    /// When each line of a frame is exposed: the frame's true start, and the camera's shutter.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn shutter(&self, frame: usize) -> ShutterTiming {
        self.camera.shutter_at(self.frames[frame].start_s)
    }

    /// The true camera's pose at an instant of a frame's exposure. A camera that rests during each frame
    /// ([`CameraFile::static_camera`]) has the pose of the frame's timestamp all the while.
    ///
    /// # Panics
    /// If there is no such frame, or the time lies outside the trajectory (see [`Self::check_coverage`]).
    pub fn world_from_camera(&self, frame: usize, time_s: f64) -> Pose {
        let at_s = if self.camera.static_camera { self.start_s(frame) } else { time_s };
        let pose = self.trajectory.pose_at(at_s);
        Pose { rotation: pose.rotation * PoseOffset::rotation(&self.camera.settings), ..pose }
    }

    /// Checks that poses exist from the start of every frame's first line to the end of its last line's exposure: the
    /// camera's (of a resting camera: at every timestamp) and those of every object that moves.
    ///
    /// # Errors
    /// [`Error::TrajectoryTooShort`] with the first frame that is not covered and the span that is missing;
    /// [`Error::Input`] for a single pose where time passes.
    pub fn check_coverage(&self) -> Result<()> {
        let objects = self.scene.objects.iter().filter_map(|o| o.trajectory.as_deref());
        let trajectories: Vec<_> = std::iter::once((&self.trajectory, self.camera.static_camera))
            .chain(objects.map(|t| (t, false)))
            .collect();
        for (index, frame) in self.frames.iter().enumerate() {
            let shutter = self.shutter(index);
            for &(trajectory, rests) in &trajectories {
                let to_s = if rests { shutter.start_s } else { shutter.end_s() };
                require(trajectory, shutter.start_s, to_s, &format!("frame {index} ({})", frame.filename))?;
            }
        }
        Ok(())
    }
}

/// Refuses a lens that folds inside the picture: which pixel has no ray depends on the picture as well as on the lens.
fn check_lens(camera: &CameraFile) -> Result<()> {
    // The picture's rays are those of the camera that took it.
    let intrinsics = FocalLengthError::apply(&camera.settings, &camera.intrinsics);
    let lens = Lens::new(intrinsics, LensDistortion::distortion(&camera.settings));
    lens.map(|_| ()).map_err(|problem| Error::At {
        path: camera.path.clone(),
        line: None,
        problem: Box::new(problem),
        hint: String::new(),
    })
}

fn require(trajectory: &Trajectory, from_s: f64, to_s: f64, what: &str) -> Result<()> {
    if trajectory.pose_count() == 1 && !trajectory.covers(from_s, to_s) {
        let found = format!("a single pose, at {:.9} s", trajectory.span_s().0);
        let expected = format!("at least two, as {what} needs poses from {from_s:.9} s to {to_s:.9} s");
        return Err(Error::input(trajectory.path(), None, found, expected));
    }
    trajectory.require(from_s, to_s, what).map_err(|problem| {
        match units::of_poses(trajectory, [from_s, to_s]) {
            Some(hint) => {
                Error::At { path: trajectory.path().to_owned(), line: None, problem: Box::new(problem), hint }
            }
            None => problem,
        }
    })
}

/// What is wrong with a frame period, s: frames may be left out of a list, but none can follow another in less than
/// the period. Up to a hundredth is the jitter of recorded stamps.
pub fn spacing_warning(frames: &[FrameEntry], frame_period_s: f64) -> Option<String> {
    let closest_s = frames.windows(2).map(|pair| pair[1].start_s - pair[0].start_s).min_by(f64::total_cmp)?;
    if closest_s < 0.99 * frame_period_s {
        let hint = units::of_spacing(closest_s, frame_period_s);
        return Some(format!(
            "frames are as near as {closest_s} s, but frame_period_s = {frame_period_s} s{hint}"
        ));
    }
    // A frame that is missing here or there is no wonder. That no two follow each other is.
    (frames.len() > 2 && closest_s > 1.5 * frame_period_s).then(|| {
        format!(
            "no frame follows another in less than {closest_s:.4} s, but frame_period_s = {frame_period_s} s: true \
             only if frames between them were left out everywhere"
        )
    })
}

/// Refuses a folder that is no capture, naming all that it lacks at once.
fn check_present(root: &Path, camera: &Path) -> Result<()> {
    if !root.is_dir() {
        let there = root.try_exists().map_err(|e| Error::io(root, "read", e))?;
        let found = if there { "a file" } else { "no such folder" };
        return Err(Error::input(root, None, found, "a capture: a folder with camera.toml, scene.obj, ..."));
    }
    let wanted = [
        (camera.to_owned(), "the camera: its size, pinhole, frame period and effects"),
        (root.join("scene.obj"), "what the camera looks at: triangles in metres, z up"),
        (root.join("trajectory.tum"), "the camera's poses over time: lines of t tx ty tz qx qy qz qw"),
        (root.join("frames.csv"), "the frames: lines of `timestamp in ns,file name`"),
    ];
    let mut missing = Vec::new();
    for entry in &wanted {
        // A folder that may not be entered and links in a circle are no missing files.
        if !entry.0.try_exists().map_err(|e| Error::io(&entry.0, "read", e))? {
            missing.push(entry);
        }
    }
    match missing.as_slice() {
        [] => Ok(()),
        [(path, purpose)] => Err(Error::input(path, None, "no such file", *purpose)),
        several => {
            let name = |path: &Path| path.strip_prefix(root).unwrap_or(path).display().to_string();
            let names: Vec<_> = several.iter().map(|(path, _)| name(path)).collect();
            let purposes: Vec<_> = several.iter().map(|(path, p)| format!("{} ({p})", name(path))).collect();
            Err(Error::input(root, None, format!("no {}", names.join(", no ")), purposes.join(", ")))
        }
    }
}
