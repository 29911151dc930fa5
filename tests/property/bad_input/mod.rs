//! Captures that are wrong: each is refused with one line that names the file, the line, what was found and what was
//! expected. The control is the same capture before it was spoiled, which is read.

mod camera_toml;
mod frames_and_lights;
mod fuzz;
mod trajectories;

use std::fs;
use std::path::{Path, PathBuf};

use shutterbug::capture::{CameraFile, Capture};
use shutterbug::scene::{Object, Scene};

const CAMERA: &str = "width = 320\nheight = 240\nfx = 280.0\nfy = 280.0\ncx = 160.0\ncy = 120.0\n\
                      frame_period_s = 0.04\nbackground = \"ignore\"\nstatic = false\nshading = \"lit\"\n\n\
                      [rolling_shutter]\nreadout_time_s = 0.02\nscan_order = \"top_to_bottom\"\n\n[motion_blur]\n\
                      exposure_time_s = 0.01\n";
const LIGHTS: &str = "# one lamp\n[[light]]\nposition = [1.0, 2.0, 3.0]\ncolor = [1.0, 0.9, 0.8]\n\
                      attenuation = [1.0, 0.0, 0.1]\n";
const TRAJECTORY: &str = "# t tx ty tz qx qy qz qw\n1700000000.000000000 0 0 0 0 0 0 1\n\
                          1700000000.050000000 1 0 0 0 0 0 1\n1700000000.100000000 2 0 0 0 0 0 1\n";
const FRAMES: &str =
    "#timestamp [ns],filename\n1700000000000000000,000000.png\n1700000000040000000,000001.png\n";
const SCENE: &str = "o cup\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\n";
const OBJECT: &str = "1700000000 0 0 0 0 0 0 1\n1700000000.1 1 0 0 0 0 0 1\n";

/// A valid capture in a folder of its own.
struct Fixture {
    folder: tempfile::TempDir,
}

impl Fixture {
    fn new() -> Self {
        let fixture = Self { folder: tempfile::tempdir().expect("a folder") };
        let files = [("camera.toml", CAMERA), ("lights.toml", LIGHTS), ("trajectory.tum", TRAJECTORY)];
        for (name, text) in files.into_iter().chain([("frames.csv", FRAMES), ("scene.obj", SCENE)]) {
            fixture.write(name, text);
        }
        fixture
    }

    fn root(&self) -> &Path {
        self.folder.path()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.root().join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(name), text).expect("written");
    }

    /// The control of every case: before it is spoiled, the capture is read.
    fn read(&self) -> Result<Capture, String> {
        Capture::read(self.root(), None).map_err(|e| self.one_line(&e))
    }

    /// As [`Self::read`], with a scene that holds these objects.
    fn read_with(&self, objects: &[&str]) -> Result<Capture, String> {
        let camera = CameraFile::read(&self.path("camera.toml")).expect("valid");
        let objects = objects.iter().map(|o| Object { name: (*o).to_owned(), trajectory: None }).collect();
        let scene = Scene { objects, ..Scene::default() };
        Capture::with_scene(self.root(), camera, scene).map_err(|e| self.one_line(&e))
    }

    fn one_line(&self, error: &shutterbug::Error) -> String {
        let text = error.to_string();
        assert!(!text.contains('\n'), "an error is one line: {text}");
        let root = self.root().display().to_string();
        assert!(text.starts_with(&root), "the file comes first: {text}");
        text[root.len()..].trim_start_matches('/').to_owned()
    }

    /// Replaces `from`, which must be there, by `to` in a file, and expects exactly this error.
    fn spoilt(file: &str, from: &str, to: &str, error: &str) {
        let fixture = Self::new();
        fixture.read().unwrap_or_else(|e| panic!("control: {e}"));
        let text = fs::read_to_string(fixture.path(file)).expect("readable");
        assert!(text.contains(from), "{file} holds no {from:?}");
        fixture.write(file, text.replacen(from, to, 1));
        match fixture.read() {
            Ok(_) => panic!("{file} with {to:?} in place of {from:?} was read; expected: {error}"),
            Err(found) => assert_eq!(found, error, "{file}: {from:?} -> {to:?}"),
        }
    }
}

#[test]
fn the_unspoilt_capture_is_read() {
    let capture = Fixture::new().read().unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((capture.frames.len(), capture.trajectory.pose_count()), (2, 3));
    assert!(capture.camera.warnings.is_empty());
    let shutter = capture.shutter(1);
    assert_eq!(
        (shutter.start_s, shutter.readout_time_s, shutter.exposure_time_s, shutter.line_count),
        (0.04, 0.02, 0.01, 240)
    );
    assert!(
        matches!(capture.scene.shading, shutterbug::scene::Shading::Lit(ref lights) if lights.len() == 1)
    );
}

#[test]
fn files_that_are_missing() {
    for (file, purpose) in [
        ("camera.toml", "the camera: its size, pinhole, frame period and effects"),
        ("scene.obj", "what the camera looks at: triangles in metres, z up"),
        ("trajectory.tum", "the camera's poses over time: lines of t tx ty tz qx qy qz qw"),
        ("frames.csv", "the frames: lines of `timestamp in ns,file name`"),
        ("lights.toml", "the point lights, as the camera says shading = \"lit\""),
    ] {
        let fixture = Fixture::new();
        fs::remove_file(fixture.path(file)).expect("removed");
        assert_eq!(
            fixture.read().expect_err(file),
            format!("{file}: found no such file; expected {purpose}")
        );
    }
    // Control: without lights the same capture is read when nothing is lit.
    let fixture = Fixture::new();
    fs::remove_file(fixture.path("lights.toml")).expect("removed");
    fixture.write("camera.toml", CAMERA.replace("\"lit\"", "\"unlit\""));
    fixture.read().unwrap_or_else(|e| panic!("{e}"));
    let empty = tempfile::tempdir().expect("a folder");
    let error = Capture::read(empty.path(), None).expect_err("empty").to_string();
    assert!(
        error.contains(
            ": found no camera.toml, no scene.obj, no trajectory.tum, no frames.csv; expected \
        camera.toml (the camera"
        ),
        "{error}"
    );
    for (path, found) in [("none", "no such folder"), ("scene.obj", "a file")] {
        let error = Capture::read(&fixture.path(path), None).expect_err(path).to_string();
        assert!(
            error.ends_with(&format!(
                "{path}: found {found}; expected a capture: a folder with camera.toml, scene.obj, ..."
            )),
            "{error}"
        );
    }
    let other = fixture.path("other.toml");
    let error = Capture::read(fixture.root(), Some(&other)).expect_err("no such camera").to_string();
    assert!(error.contains("other.toml: found no such file; expected the camera"), "{error}");
}
