//! Captures that are wrong: each is refused with one line that names the file, the line, what was found and what was
//! expected. The control is the same capture before it was spoiled, which is read.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use proptest::prelude::*;
use shutterbug::camera::Trajectory;
use shutterbug::capture::{CameraFile, Capture, parse_frames, parse_lights};
use shutterbug::scene::{Object, Scene};

const CAMERA: &str = "width = 320\nheight = 240\nfx = 280.0\nfy = 280.0\ncx = 160.0\ncy = 120.0\nframe_period_s = 0.04\n\
                      background = \"ignore\"\nstatic = false\nshading = \"lit\"\n\n[rolling_shutter]\nreadout_time_s = 0.02\n\
                      scan_order = \"top_to_bottom\"\n\n[motion_blur]\nexposure_time_s = 0.01\n";
const LIGHTS: &str = "# one lamp\n[[light]]\nposition = [1.0, 2.0, 3.0]\ncolor = [1.0, 0.9, 0.8]\nattenuation = [1.0, 0.0, 0.1]\n";
const TRAJECTORY: &str = "# t tx ty tz qx qy qz qw\n1700000000.000000000 0 0 0 0 0 0 1\n1700000000.050000000 1 0 0 0 0 0 1\n\
                          1700000000.100000000 2 0 0 0 0 0 1\n";
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
fn names_that_camera_toml_does_not_know() {
    for (from, to, error) in [
        ("width", "widht", "camera.toml:1: unknown key `widht`; did you mean `width`?"),
        ("shading", "colour", "camera.toml:10: unknown key `colour`"),
        (
            "[rolling_shutter]",
            "[rolling_shuter]",
            "camera.toml:12: unknown effect `rolling_shuter`; did you mean `rolling_shutter`?",
        ),
        ("[rolling_shutter]", "[ghosting]", "camera.toml:12: unknown effect `ghosting`"),
        (
            "readout_time_s",
            "readout_s",
            "camera.toml:13: unknown parameter `readout_s`; did you mean `readout_time_s`?",
        ),
        (
            "static = false",
            "exposure_time_s = 0.01",
            "camera.toml:9: unknown key `exposure_time_s`; did you mean `motion_blur.exposure_time_s`?",
        ),
        (
            "exposure_time_s = 0.01",
            "static = true",
            "camera.toml:17: found `static` in the table [motion_blur]; expected it above the first table: it belongs to the camera",
        ),
    ] {
        Fixture::spoilt("camera.toml", from, to, error);
    }
}

#[test]
fn values_that_camera_toml_cannot_hold() {
    let side = "expected a whole number of px, 1 to 16384";
    let focal = "expected a finite number of px, 0.001 to 10000000";
    let period = "expected a finite number of s above 0 (at most 86400)";
    for (from, to, error) in [
        (
            "width = 320\n",
            "",
            "camera.toml: found no `width`; expected `width = ` a whole number of px, 1 to 16384".to_owned(),
        ),
        (
            "fy = 280.0\n",
            "",
            "camera.toml: found no `fy`; expected `fy = ` a finite number of px, 0.001 to 10000000"
                .to_owned(),
        ),
        ("width = 320", "width = \"320\"", format!("camera.toml:1: found width = \"320\"; {side}")),
        ("width = 320", "width = 320.5", format!("camera.toml:1: found width = 320.5; {side}")),
        ("height = 240", "height = 0", format!("camera.toml:2: found height = 0; {side}")),
        ("height = 240", "height = -240", format!("camera.toml:2: found height = -240; {side}")),
        ("height = 240", "height = 16385", format!("camera.toml:2: found height = 16385; {side}")),
        (
            "height = 240",
            "height = 99999999999999999999",
            format!("camera.toml:2: found height = 99999999999999999999; {side}"),
        ),
        ("fx = 280.0", "fx = 0", format!("camera.toml:3: found fx = 0; {focal}")),
        ("fy = 280.0", "fy = -280.0", format!("camera.toml:4: found fy = -280.0; {focal}")),
        ("fy = 280.0", "fy = nan", format!("camera.toml:4: found fy = nan; {focal}")),
        (
            "cx = 160.0",
            "cx = -inf",
            "camera.toml:5: found cx = -inf; expected a finite number of px, -1000000 to 1000000".to_owned(),
        ),
        (
            "cx = 160.0",
            "cx = 1e400",
            "camera.toml:5: found cx = 1e400; expected a finite number of px, -1000000 to 1000000".to_owned(),
        ),
        (
            "cy = 120.0",
            "cy = [120.0]",
            "camera.toml:6: found cy = a list of 1; expected a finite number of px, -1000000 to 1000000"
                .to_owned(),
        ),
        ("0.04", "0", format!("camera.toml:7: found frame_period_s = 0; {period}")),
        ("0.04", "-0.04", format!("camera.toml:7: found frame_period_s = -0.04; {period}")),
        ("0.04", "nan", format!("camera.toml:7: found frame_period_s = nan; {period}")),
        ("0.04", "true", format!("camera.toml:7: found frame_period_s = true; {period}")),
        (
            "\"ignore\"",
            "\"white\"",
            "camera.toml:8: found background = \"white\"; expected \"black\" or \"ignore\"".to_owned(),
        ),
        (
            "static = false",
            "static = 1",
            "camera.toml:9: found static = 1; expected true or false".to_owned(),
        ),
        (
            "\"lit\"",
            "1979-05-27",
            "camera.toml:10: found shading = the date 1979-05-27; expected \"unlit\" or \"lit\"".to_owned(),
        ),
        (
            "static = false",
            "motion_blur = 0.01",
            "camera.toml:9: found motion_blur = 0.01; expected a table: `[motion_blur]` and its parameters"
                .to_owned(),
        ),
    ] {
        if to.starts_with("motion_blur") {
            // The key would otherwise stand there twice.
            let text = CAMERA.replace(from, to).replace("[motion_blur]\nexposure_time_s = 0.01\n", "");
            let error_found =
                CameraFile::parse(Path::new("camera.toml"), &text).expect_err("no table").to_string();
            assert_eq!(error_found, error);
        } else {
            Fixture::spoilt("camera.toml", from, to, &error);
        }
    }
}

#[test]
fn parameters_outside_their_range_name_the_unit_that_may_be_meant() {
    let exposure = "camera.toml:17: motion_blur.exposure_time_s";
    let range = "is outside 0 to 1 s";
    for (to, error) in [
        ("20", format!("{exposure} = 20 s {range}; is it in ms?")),
        ("20000", format!("{exposure} = 20000 s {range}; is it in us?")),
        ("2e7", format!("{exposure} = 20000000 s {range}; is it in ns?")),
        ("-0.01", format!("{exposure} = -0.01 s {range}")),
        ("nan", "camera.toml:17: found motion_blur.exposure_time_s = nan; expected a finite number of unit s, 0 to 1".to_owned()),
        ("\"10 ms\"", "camera.toml:17: found motion_blur.exposure_time_s = \"10 ms\"; expected a finite number of unit s, 0 to 1".to_owned()),
    ] {
        Fixture::spoilt("camera.toml", "0.01", to, &error);
    }
    let orders = "\"top_to_bottom\" or \"bottom_to_top\" or \"left_to_right\" or \"right_to_left\"";
    let error = format!("camera.toml:14: found rolling_shutter.scan_order = \"upwards\"; expected {orders}");
    Fixture::spoilt("camera.toml", "\"top_to_bottom\"", "\"upwards\"", &error);
}

#[test]
fn text_that_is_not_toml() {
    for (from, to, start) in [
        ("fx = 280.0", "fx 280.0", "camera.toml:3: found text that is not TOML ("),
        ("height = 240", "width = 240", "camera.toml:2: found text that is not TOML (duplicate key"),
        ("[motion_blur]", "[motion_blur", "camera.toml:16: found text that is not TOML ("),
    ] {
        let fixture = Fixture::new();
        fixture.write("camera.toml", CAMERA.replacen(from, to, 1));
        let error = fixture.read().expect_err("no TOML");
        assert!(
            error.starts_with(start) && error.ends_with("expected `key = value` lines and `[effect]` tables"),
            "{error}"
        );
    }
    let fixture = Fixture::new();
    fixture.write("camera.toml", b"width = 320\n# caf\xe9\n");
    assert_eq!(
        fixture.read().expect_err("Latin-1"),
        "camera.toml:2: found bytes that are not UTF-8; expected text in UTF-8"
    );
}

#[test]
fn cameras_that_are_odd_but_possible_are_read_with_a_warning() {
    let fixture = Fixture::new();
    fixture.write("camera.toml", CAMERA.replace("0.04", "0.015"));
    let warnings = fixture.read().expect("allowed").camera.warnings;
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0]
            .starts_with("rolling_shutter.readout_time_s = 0.02 s is longer than frame_period_s = 0.015 s")
    );
    fixture.write("camera.toml", CAMERA.replace("0.04", "40"));
    let warnings = fixture.read().expect("allowed").camera.warnings;
    assert_eq!(warnings, ["frames are as near as 0.04 s, but frame_period_s = 40 s; is the period in s?"]);
}

#[test]
fn trajectories_that_are_wrong() {
    let format = "expected eight numbers: t tx ty tz qx qy qz qw";
    let line = "1700000000.050000000 1 0 0 0 0 0 1";
    for (to, error) in [
        ("1700000000.050000000 1 0 0 0 0 0", format!("trajectory.tum:3: found 7 values; {format}")),
        ("1700000000.050000000 1 0 0 0 0 0 1 9", format!("trajectory.tum:3: found 9 values; {format}")),
        ("1700000000.05,1,0,0,0,0,0,1", format!("trajectory.tum:3: found 1 value; {format}")),
        ("1700000000.050000000 1 0 x 0 0 0 1", "trajectory.tum:3: found tz = `x`; expected a finite number".to_owned()),
        ("1700000000.050000000 nan 0 0 0 0 0 1", "trajectory.tum:3: found tx = `nan`; expected a finite number".to_owned()),
        ("1700000000.050000000 1 0 0 0 0 inf 1", "trajectory.tum:3: found qz = `inf`; expected a finite number".to_owned()),
        ("nan 1 0 0 0 0 0 1", "trajectory.tum:3: found time `nan`; expected a finite number of seconds".to_owned()),
        (
            "1700000000050000000 1 0 0 0 0 0 1",
            "trajectory.tum:3: found time 1700000000050000000 s; expected seconds within 292 years of zero; is it in ns?".to_owned(),
        ),
        (
            "1699999999.999999999 1 0 0 0 0 0 1",
            "trajectory.tum:3: found time 1699999999.999999999 s after 1700000000.000000000 s in line 2; expected times that increase".to_owned(),
        ),
        (
            "1.7e9 1 0 0 0 0 0 1",
            "trajectory.tum:3: found time 1.7e9 s after 1700000000.000000000 s in line 2; expected times that increase".to_owned(),
        ),
        (
            "1700000000.050000000 1 0 0 0 0 0 0.5",
            "trajectory.tum:3: found a quaternion of length 0.500000; expected a unit quaternion qx qy qz qw (length 1 within 0.001)".to_owned(),
        ),
        (
            "1700000000.050000000 1 0 0 0 0 0 0",
            "trajectory.tum:3: found a quaternion of length 0.000000; expected a unit quaternion qx qy qz qw (length 1 within 0.001)".to_owned(),
        ),
        (
            "1700000000.050000000 1e300 0 0 0 0 0 1",
            format!("trajectory.tum:3: found a coordinate of {} m; expected metres, at most 1e9", 1e300),
        ),
    ] {
        Fixture::spoilt("trajectory.tum", line, to, &error);
    }
    Fixture::spoilt(
        "trajectory.tum",
        TRAJECTORY,
        "# nothing\n\n",
        &format!("trajectory.tum: found no pose; expected lines of {}", &format[9..]),
    );
}

#[test]
fn frames_that_are_wrong() {
    let plain = "expected a plain name such as 000000.png, without folders";
    for (to, error) in [
        ("1700000000040000000", "frames.csv:3: found `1700000000040000000`; expected `timestamp in ns,file name`".to_owned()),
        (
            "1700000000.04,000001.png",
            "frames.csv:3: found timestamp `1700000000.04`; expected a whole number of ns that fits in 64 bits; is it in s?".to_owned(),
        ),
        ("later,000001.png", "frames.csv:3: found timestamp `later`; expected a whole number of ns that fits in 64 bits".to_owned()),
        ("nan,000001.png", "frames.csv:3: found timestamp `nan`; expected a whole number of ns that fits in 64 bits".to_owned()),
        (
            "1699999999999999999,000001.png",
            "frames.csv:3: found timestamp 1699999999999999999 ns after 1700000000000000000 ns in line 2; expected timestamps that increase".to_owned(),
        ),
        (
            "1700000000000000000,000001.png",
            "frames.csv:3: found timestamp 1700000000000000000 ns after 1700000000000000000 ns in line 2; expected timestamps that increase".to_owned(),
        ),
        (
            "1700000000040000000,000000.png",
            "frames.csv:3: found file name `000000.png` again, after line 2; expected names that differ, leaving the extension aside".to_owned(),
        ),
        (
            "1700000000040000000,000000.jpg",
            "frames.csv:3: found file name `000000.jpg` again, after line 2; expected names that differ, leaving the extension aside".to_owned(),
        ),
        ("1700000000040000000,../000001.png", format!("frames.csv:3: found file name `../000001.png`; {plain}")),
        ("1700000000040000000,real/1.png", format!("frames.csv:3: found file name `real/1.png`; {plain}")),
        ("1700000000040000000,real\\1.png", format!("frames.csv:3: found file name `real\\\\1.png`; {plain}")),
        ("1700000000040000000,..", format!("frames.csv:3: found file name `..`; {plain}")),
        ("1700000000040000000,", format!("frames.csv:3: found file name ``; {plain}")),
        ("1700000000040000000,a\0.png", format!("frames.csv:3: found file name `a\\0.png`; {plain}")),
    ] {
        Fixture::spoilt("frames.csv", "1700000000040000000,000001.png", to, &error);
    }
    let none = "frames.csv: found no frame; expected at least one line `timestamp in ns,file name`";
    Fixture::spoilt("frames.csv", FRAMES, "#timestamp [ns],filename\n", none);
}

#[test]
fn lights_that_are_wrong() {
    let numbers = "expected a list of three finite numbers";
    for (from, to, error) in [
        ("color", "colour", "lights.toml:4: unknown key `colour`; did you mean `color`?".to_owned()),
        ("[[light]]", "[[lights]]", "lights.toml:2: unknown key `lights`; did you mean `light`?".to_owned()),
        ("[[light]]", "[light]", "lights.toml:2: found light = a table; expected `[[light]]` tables".to_owned()),
        (LIGHTS, "", "lights.toml: found no light; expected at least one `[[light]]` table".to_owned()),
        (LIGHTS, "light = []", "lights.toml: found no light; expected at least one `[[light]]` table".to_owned()),
        (LIGHTS, "light = [1]", "lights.toml:1: found light = 1; expected `[[light]]` tables".to_owned()),
        ("color = [1.0, 0.9, 0.8]\n", "", format!("lights.toml:2: found a light without `color`; {numbers}: linear red, green, blue, at least 0")),
        ("[1.0, 2.0, 3.0]", "[1.0, 2.0]", format!("lights.toml:3: found position = a list of 2; {numbers}: m, in world coordinates")),
        ("[1.0, 2.0, 3.0]", "[1.0, nan, 3.0]", format!("lights.toml:3: found position = nan; {numbers}: m, in world coordinates")),
        ("0.9", "-0.9", "lights.toml:4: found color with -0.9; expected 0e0 to 1e9".to_owned()),
        ("0.9", "2e9", "lights.toml:4: found color with 2000000000; expected 0e0 to 1e9".to_owned()),
        (
            "[1.0, 0.0, 0.1]",
            "[0, 0, 0]",
            "lights.toml:5: found attenuation = [0, 0, 0]; expected at least one term above 0: the light is divided by their sum".to_owned(),
        ),
    ] {
        Fixture::spoilt("lights.toml", from, to, &error);
    }
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
    assert!(error.contains(": found no camera.toml, no scene.obj, no trajectory.tum, no frames.csv; expected camera.toml (the camera"), "{error}");
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

#[test]
fn trajectories_that_do_not_cover_a_frame() {
    // Line 239 of 240 starts at 0.04 + 0.02 * 239/240 and integrates for 0.01: until 0.069916667.
    let tail = "(0 s is the first frame's timestamp; poses are never extrapolated)";
    let error = format!(
        "trajectory.tum: frame 1 (000001.png) needs poses from 0.040000000 s to 0.069916667 s, but the trajectory covers only \
         0.000000000 s to 0.069900000 s: missing 0.069900000 s to 0.069916667 s {tail}"
    );
    Fixture::spoilt("trajectory.tum", "1700000000.100000000", "1700000000.069900000", &error);
    let fixture = Fixture::new();
    fixture.write("trajectory.tum", TRAJECTORY.replace("00.100000000", "00.069916667"));
    fixture.read().unwrap_or_else(|e| panic!("just enough: {e}"));
    let error = format!(
        "trajectory.tum: frame 0 (000000.png) needs poses from 0.000000000 s to 0.029916667 s, but the trajectory covers only \
         0.000000002 s to 0.100000000 s: missing 0.000000000 s to 0.000000002 s {tail}"
    );
    Fixture::spoilt("trajectory.tum", "1700000000.000000000", "1700000000.000000002", &error);
    // Read by columns, the last line is another one: 320 lines.
    let fixture = Fixture::new();
    fixture.write("camera.toml", CAMERA.replace("top_to_bottom", "left_to_right"));
    fixture.write("trajectory.tum", TRAJECTORY.replace("00.100000000", "00.069916667"));
    let error = fixture.read().expect_err("too short by 21 us");
    assert!(error.contains("missing 0.069916667 s to 0.069937500 s"), "{error}");
}

#[test]
fn a_single_pose_serves_only_a_single_instant() {
    let fixture = Fixture::new();
    fixture.write("trajectory.tum", "1700000000 1 2 3 0 0 0 1\n");
    let error = fixture.read().expect_err("time passes");
    let expected = "at least two, as frame 0 (000000.png) needs poses from 0.000000000 s to 0.029916667 s";
    assert_eq!(error, format!("trajectory.tum: found a single pose, at 0.000000000 s; expected {expected}"));
    let instant = CAMERA.split("\n[rolling_shutter]").next().expect("a start");
    fixture.write("camera.toml", instant);
    assert!(fixture.read().expect_err("the second frame is later").contains("as frame 1 (000001.png) needs"));
    fixture.write("frames.csv", "1700000000000000000,000000.png\n");
    let capture = fixture.read().unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(capture.world_from_camera(0, capture.shutter(0).end_s()).translation_m.z, 3.0);
}

#[test]
fn a_resting_camera_needs_a_pose_at_each_timestamp_only() {
    let fixture = Fixture::new();
    fixture.write("trajectory.tum", TRAJECTORY.replace("00.100000000", "00.050000001"));
    assert!(fixture.read().expect_err("a moving camera needs more").contains("frame 1"));
    fixture.write("camera.toml", CAMERA.replace("static = false", "static = true"));
    let capture = fixture.read().unwrap_or_else(|e| panic!("{e}"));
    let (start, end) = (capture.shutter(1).start_s, capture.shutter(1).end_s());
    assert_eq!(capture.world_from_camera(1, start), capture.world_from_camera(1, end));
    // Control: the pose is that of frame 1, not of frame 0.
    assert_ne!(capture.world_from_camera(1, start), capture.world_from_camera(0, start));
}

#[test]
fn objects_are_bound_by_name() {
    let fixture = Fixture::new();
    fs::create_dir(fixture.path("objects")).expect("a folder");
    fixture.write("objects/cup.tum", OBJECT);
    fixture.write("objects/notes.txt", "not a trajectory");
    let capture = fixture.read_with(&["table", "cup", "cup"]).unwrap_or_else(|e| panic!("{e}"));
    assert!(capture.scene.objects[0].trajectory.is_none(), "objects without a file rest");
    let [first, second] = [1, 2].map(|i| capture.scene.objects[i].trajectory.clone().expect("bound"));
    assert!(Arc::ptr_eq(&first, &second));
    assert!((first.pose_at(0.05).translation_m.x - 0.5).abs() < 1e-12, "on the capture's clock");
    let unknown = |objects: &[&str]| fixture.read_with(objects).expect_err("no such object");
    assert_eq!(
        unknown(&["table", "cups"]),
        "objects/cup.tum: unknown object of scene.obj `cup`; did you mean `cups`?"
    );
    assert_eq!(unknown(&["table"]), "objects/cup.tum: unknown object of scene.obj `cup`");
    fixture.write("objects/cup.tum", OBJECT.replace("00.1", "00.05"));
    let error = unknown(&["cup"]);
    assert!(error.starts_with("objects/cup.tum: frame 1 (000001.png) needs poses from"), "{error}");
    // The camera may rest, the object does not.
    fixture.write("camera.toml", CAMERA.replace("static = false", "static = true"));
    assert_eq!(unknown(&["cup"]), error);
    fixture.write("objects/cup.tum", OBJECT.replace("0 0 0 1", "0 0 0 2"));
    assert!(
        unknown(&["cup"]).starts_with("objects/cup.tum:1: found a quaternion of length 2.000000"),
        "{error}"
    );
}

/// Text that was valid before one piece of it was replaced by another.
fn mutated(text: &'static str) -> impl Strategy<Value = String> {
    let piece = prop_oneof![
        "[ -~\\n]{0,6}",
        Just("\n".to_owned()),
        Just("nan".to_owned()),
        Just("-1e400".to_owned()),
        Just("99999999999999999999".to_owned()),
        Just("\u{0}\u{feff}".to_owned()),
        any::<String>(),
    ];
    (any::<prop::sample::Index>(), 0usize..12, piece).prop_map(move |(at, length, piece)| {
        let start = at.index(text.len());
        let end = (start + length).min(text.len());
        format!("{}{piece}{}", &text[..start], &text[end..])
    })
}

/// No panic; an error is one that names the file and fits on a line.
fn judge<T>(result: shutterbug::Result<T>) -> Result<(), TestCaseError> {
    if let Err(error) = result {
        let text = error.to_string();
        prop_assert!(text.starts_with("the/file") && !text.contains('\n'), "{}", text);
    }
    Ok(())
}

fn parse_all(text: &str) -> Result<(), TestCaseError> {
    let path = Path::new("the/file");
    judge(CameraFile::parse(path, text))?;
    judge(parse_lights(path, text))?;
    judge(parse_frames(path, text))?;
    judge(Trajectory::parse(path, text, 1_700_000_000_000_000_000))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn random_text_never_panics(text: String) {
        parse_all(&text)?;
    }

    #[test]
    fn random_bytes_in_a_file_never_panic(bytes: Vec<u8>, which in 0usize..4) {
        let fixture = Fixture::new();
        fixture.write(["camera.toml", "lights.toml", "frames.csv", "trajectory.tum"][which], bytes);
        let _ = fixture.read();
    }

    #[test]
    fn mutated_text_never_panics(text in prop_oneof![mutated(CAMERA), mutated(LIGHTS), mutated(FRAMES), mutated(TRAJECTORY)]) {
        parse_all(&text)?;
    }

    #[test]
    fn whatever_camera_is_read_is_written_and_read_the_same(text in mutated(CAMERA)) {
        if let Ok(camera) = CameraFile::parse(Path::new("the/file"), &text) {
            let back = CameraFile::parse(Path::new("the/file"), &camera.to_toml()).expect("its own text");
            prop_assert_eq!(back.intrinsics, camera.intrinsics);
            prop_assert_eq!(back.frame_period_s, camera.frame_period_s);
            prop_assert_eq!(&back.settings, &camera.settings);
            prop_assert_eq!(back.to_toml(), camera.to_toml());
        }
    }
}

#[test]
fn a_lens_that_folds_inside_the_picture_is_refused_with_the_pixel() {
    let fixture = Fixture::new();
    fixture.write("camera.toml", format!("{CAMERA}\n[lens_distortion]\nk1 = -0.1\n"));
    fixture.read().expect("a lens that can be inverted");
    fixture.write("camera.toml", format!("{CAMERA}\n[lens_distortion]\nk1 = -1.9\n"));
    let refused = fixture.read().expect_err("folds");
    for part in ["camera.toml", "k1 = -1.9", "no ray reaches pixel (", "turns back at"] {
        assert!(refused.contains(part), "{part} in {refused}");
    }
}
