//! Captures whose camera stands in another tool's file, or takes a preset's effects.

use std::path::{Path, PathBuf};

use super::presets::{Preset, apply_preset};
use super::read_camera;
use shutterbug::capture::{CameraFile, Capture, parse_frames, read_text};
use shutterbug::error::{Error, Result};
use shutterbug::files::{Limit, is_there};

/// Files that stand for `camera.toml` in a capture without one, as ROS, Kalibr and EuRoC call them.
const STAND_INS: [&str; 3] = ["camera_info.yaml", "camchain.yaml", "sensor.yaml"];

/// Reads a capture. `camera` replaces its `camera.toml` and may be ROS, Kalibr or EuRoC YAML or Gyroflow's JSON;
/// without both, the one of `camera_info.yaml`, `camchain.yaml` and `sensor.yaml` that is there is taken. `preset` adds
/// effects that the camera does not have itself. What has no place is emitted as a warning.
///
/// A YAML camera knows nothing of `background`, `static` and `shading`: those are the capture's own `camera.toml`'s, if
/// it has one, and so is the frame period where the YAML states no rate (else the median step of `frames.csv`).
///
/// # Errors
/// As [`Capture::read`], [`read_camera`] and [`apply_preset`].
pub fn read_capture(root: &Path, camera: Option<&Path>, preset: Option<&Preset>) -> Result<Capture> {
    let stand_in = if camera.is_none() { stand_in(root) } else { None };
    Capture::read_with(root, camera.or(stand_in.as_deref()), |path| {
        let mut camera = if is_yaml(path) { from_yaml(path, root)? } else { CameraFile::read(path)? };
        if let Some(preset) = preset {
            for note in apply_preset(preset, &mut camera)? {
                tracing::warn!("preset {}: {note}", preset.name);
            }
        }
        Ok(camera)
    })
}

fn is_yaml(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| ["yaml", "yml", "json"].iter().any(|known| e.eq_ignore_ascii_case(known)))
}

fn stand_in(root: &Path) -> Option<PathBuf> {
    if root.join("camera.toml").exists() {
        return None;
    }
    STAND_INS.iter().map(|name| root.join(name)).find(|path| is_there(path))
}

fn from_yaml(path: &Path, root: &Path) -> Result<CameraFile> {
    let imported = read_camera(path, None, None)?;
    let own_path = root.join("camera.toml");
    let own = if is_there(&own_path) { Some(CameraFile::read(&own_path)?) } else { None };
    let rate_hz = match (imported.camera.rate_hz, &own) {
        (Some(rate), _) => rate,
        (None, Some(own)) => 1.0 / own.frame_period_s,
        (None, None) => 1.0 / median_period_s(path, root)?,
    };
    let (mut camera, left_out) = imported.camera.to_camera_file(path, Some(rate_hz))?;
    for note in imported.notes.iter().chain(&left_out) {
        tracing::warn!("{}: {note}", path.display());
    }
    if let Some(own) = own {
        camera.background_ignored = own.background_ignored;
        camera.static_camera = own.static_camera;
        camera.lit = own.lit;
    }
    Ok(camera)
}

/// Median step of the capture's frames, s.
fn median_period_s(camera: &Path, root: &Path) -> Result<f64> {
    let path = root.join("frames.csv");
    let frames = parse_frames(
        &path,
        &read_text(&path, "the frames: lines of `timestamp in ns,file name`", Limit::TABLE)?,
    )?;
    let mut steps: Vec<f64> = frames.windows(2).map(|w| w[1].start_s - w[0].start_s).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().ok_or_else(|| {
        let expected = "a rate in it, a camera.toml beside it, or two frames in frames.csv";
        Error::input(camera, None, "no frame rate", expected)
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::formats::preset;

    const ROS: &str = "image_width: 64\nimage_height: 48\ncamera_matrix:\n  \
                       data: [50.0, 0.0, 31.5, 0.0, 50.0, 23.5, 0.0, 0.0, 1.0]\ndistortion_model: plumb_bob\n\
                       distortion_coefficients:\n  data: [0.0, 0.0, 0.0, 0.0, 0.0]\n";

    /// A capture of two frames, 0.04 s apart, without a camera.
    fn capture() -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("written");
        write("scene.obj", "v 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\n");
        write("trajectory.tum", "-1 0 0 0 0 0 0 1\n3 1 0 0 0 0 0 1\n");
        write("frames.csv", "1000000000,000000.png\n1040000000,000001.png\n");
        folder
    }

    #[test]
    fn a_ros_file_stands_for_camera_toml() {
        let folder = capture();
        let missing = read_capture(folder.path(), None, None).expect_err("no camera").to_string();
        assert!(missing.contains("camera.toml"), "{missing}");
        fs::write(folder.path().join("camera_info.yaml"), ROS).expect("written");
        let camera = read_capture(folder.path(), None, None).unwrap_or_else(|e| panic!("{e}")).camera;
        assert_eq!((camera.intrinsics.cx, camera.intrinsics.cy), (32.0, 24.0));
        assert!((camera.frame_period_s - 0.04).abs() < 1e-15, "the step of frames.csv");
        // A camera.toml wins over it; given by name, the YAML takes what it does not know from there.
        let toml = "width = 32\nheight = 24\nfx = 20\nfy = 20\ncx = 16\ncy = 12\nframe_period_s = 0.03\n\
                    static = true\n";
        fs::write(folder.path().join("camera.toml"), toml).expect("written");
        let own = read_capture(folder.path(), None, None).unwrap_or_else(|e| panic!("{e}")).camera;
        assert_eq!(own.intrinsics.width, 32);
        let yaml = folder.path().join("camera_info.yaml");
        let given = read_capture(folder.path(), Some(&yaml), None).unwrap_or_else(|e| panic!("{e}")).camera;
        assert_eq!((given.intrinsics.width, given.static_camera), (64, true));
        assert!((given.frame_period_s - 0.03).abs() < 1e-15);
    }

    #[test]
    fn a_presets_shutter_counts_when_poses_are_checked() {
        let folder = capture();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("written");
        write("camera_info.yaml", ROS);
        // Poses to 20 ms after the last frame: enough for an instant, not for a readout of 31 ms.
        write("trajectory.tum", "0.9 0 0 0 0 0 0 1\n1.06 1 0 0 0 0 0 1\n");
        assert!(read_capture(folder.path(), None, None).is_ok());
        let humanoid = preset("humanoid-2008", None, "").expect("known");
        let error = read_capture(folder.path(), None, Some(&humanoid)).expect_err("too short").to_string();
        assert!(error.contains("frame 1 (000001.png)"), "{error}");
    }
}
