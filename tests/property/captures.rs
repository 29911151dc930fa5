//! Captures of others are read as they are: `../shared/data/cycles-dev` and the recordings in
//! `../shared/data/trajectories`. What the scene holds is not looked at here.

use std::path::{Path, PathBuf};

use shutterbug::camera::Trajectory;
use shutterbug::capture::{CameraFile, Capture};
use shutterbug::scene::{Object, Scene};

/// A folder of the shared data, or `None` with a line that says what was not tested.
fn shared(test: &str, folder: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(folder);
    if path.is_dir() {
        return Some(path);
    }
    eprintln!("SKIPPED {test}: ../shared/data/{folder} is absent");
    None
}

/// Name, focal length px, cx px, cy px, frame period s, frames, poses.
type Known = (&'static str, f64, f64, f64, f64, usize, usize);

/// Copied by hand from the files: `head camera.toml`, and `wc -l` of the others less their headers.
const KNOWN: [Known; 10] = [
    ("d00", 280.82, 158.77, 120.83, 0.04, 19, 482),
    ("d01", 265.62, 156.83, 120.76, 0.04, 16, 422),
    ("d02", 236.11, 160.69, 123.94, 0.04, 22, 542),
    ("d03", 298.44, 156.93, 117.47, 0.033333333, 23, 469),
    ("d04", 264.77, 159.43, 116.95, 0.04, 10, 302),
    ("d05", 282.53, 156.41, 123.86, 0.05, 12, 427),
    ("d06", 243.2, 158.27, 123.18, 0.05, 12, 427),
    ("d07", 245.45, 160.0, 123.66, 0.033333333, 12, 285),
    ("d08", 265.15, 159.77, 119.74, 0.033333333, 12, 285),
    ("d09", 279.88, 161.63, 121.32, 0.033333333, 12, 285),
];

/// A scene with the one object that moves in d08.
fn scene_with(object: &str) -> Scene {
    let objects = ["floor", object].map(|name| Object { name: name.to_owned(), trajectory: None });
    Scene { objects: objects.to_vec(), ..Scene::default() }
}

#[test]
fn every_capture_of_cycles_dev_is_read() {
    let Some(folder) = shared("every_capture_of_cycles_dev_is_read", "cycles-dev") else { return };
    for (name, f, cx, cy, period_s, frames, poses) in KNOWN {
        let root = folder.join(name);
        let camera = CameraFile::read(&root.join("camera.toml")).unwrap_or_else(|e| panic!("{e}"));
        let k = camera.intrinsics;
        assert_eq!((k.width, k.height, k.fx, k.fy, k.cx, k.cy), (320, 240, f, f, cx, cy), "{name}");
        assert_eq!(camera.frame_period_s, period_s, "{name}");
        assert!(!camera.background_ignored && !camera.static_camera && !camera.lit, "{name}");
        assert_eq!(camera.settings.iter().count(), 0, "{name} names no effect");
        assert!(camera.warnings.is_empty(), "{name}: {:?}", camera.warnings);
        // Only d08 has an object that moves; the other captures must not care that it is there.
        let capture =
            Capture::with_scene(&root, camera, scene_with("moving0")).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(capture.frames.len(), frames, "{name}");
        assert_eq!(capture.trajectory.pose_count(), poses, "{name}");
        assert_eq!(capture.frames[0].start_s, capture.frames[0].timestamp_ns as f64 / 1e9);
        assert_eq!(capture.frames[0].filename, "000000.png");
        // The README: the trajectory starts two frame periods before the first frame.
        let lead_s = capture.frames[0].start_s - capture.trajectory.span_s().0;
        assert!((lead_s - 2.0 * period_s).abs() < 2e-9, "{name}");
        assert_eq!(capture.scene.objects[1].trajectory.is_some(), name == "d08");
    }
}

#[test]
fn a_capture_is_read_by_its_folder_alone() {
    let Some(folder) = shared("a_capture_is_read_by_its_folder_alone", "cycles-dev") else { return };
    let capture = Capture::read(&folder.join("d04"), None).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((capture.epoch_ns, capture.frames.len()), (0, 10));
    let other = folder.join("d01/camera.toml");
    let capture = Capture::read(&folder.join("d04"), Some(&other)).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(capture.camera.intrinsics.fx, 265.62);
}

#[test]
fn the_moving_object_of_d08_must_be_in_the_scene() {
    let Some(folder) = shared("the_moving_object_of_d08_must_be_in_the_scene", "cycles-dev") else { return };
    let root = folder.join("d08");
    let camera = CameraFile::read(&root.join("camera.toml")).expect("readable");
    let error =
        Capture::with_scene(&root, camera, scene_with("moving1")).expect_err("no such object").to_string();
    assert!(
        error.contains("moving0.tum: unknown object of scene.obj `moving0`; did you mean `moving1`?"),
        "{error}"
    );
}

#[test]
fn recorded_trajectories_of_others_are_read() {
    let Some(folder) = shared("recorded_trajectories_of_others_are_read", "trajectories") else { return };
    for (name, epoch_ns, poses, last_s) in [
        ("tum_fr1_xyz_groundtruth.txt", 1_305_031_098_665_900_000, 3000, 30.0896),
        ("tum_fr2_desk_groundtruth_first4000.txt", 1_311_868_163_869_700_000, 4000, 18.3709),
    ] {
        let path = folder.join(name);
        let text = std::fs::read_to_string(&path).expect("readable");
        let trajectory = Trajectory::parse(&path, &text, epoch_ns).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(trajectory.pose_count(), poses, "{name}");
        assert_eq!(trajectory.span_s(), (0.0, last_s), "{name}");
        // Four decimals in the file: only after normalising is it a rotation.
        assert!((trajectory.pose_at(0.0).rotation.length() - 1.0).abs() < 1e-15, "{name}");
    }
    // The robot's walks are no TUM files: refused with the line and what was expected.
    for name in ["nao_2013062101_positions.csv", "nao_2013062102_positions.csv"] {
        let path = folder.join(name);
        let text = std::fs::read_to_string(&path).expect("readable");
        let error = Trajectory::parse(&path, &text, 0).expect_err("not TUM").to_string();
        assert!(error.contains(&format!("{name}:2: found 1 value; expected eight numbers")), "{error}");
    }
}
