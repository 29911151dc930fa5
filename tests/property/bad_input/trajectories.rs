//! Poses that are wrong, or missing when a frame needs them.

use std::fs;
use std::sync::Arc;

use super::{CAMERA, Fixture, OBJECT, TRAJECTORY};

#[test]
fn trajectories_that_are_wrong() {
    let format = "expected eight numbers: t tx ty tz qx qy qz qw";
    let line = "1700000000.050000000 1 0 0 0 0 0 1";
    for (to, error) in [
        ("1700000000.050000000 1 0 0 0 0 0", format!("trajectory.tum:3: found 7 values; {format}")),
        ("1700000000.050000000 1 0 0 0 0 0 1 9", format!("trajectory.tum:3: found 9 values; {format}")),
        ("1700000000.05,1,0,0,0,0,0,1", format!("trajectory.tum:3: found 1 value; {format}")),
        ("1700000000.050000000 1 0 x 0 0 0 1", "trajectory.tum:3: found tz = `x`; expected a finite number".to_owned()),
        ("1700000000.050000000 nan 0 0 0 0 0 1", "trajectory.tum:3: found tx = `nan`; expected a finite \
            number".to_owned()),
        ("1700000000.050000000 1 0 0 0 0 inf 1", "trajectory.tum:3: found qz = `inf`; expected a finite \
            number".to_owned()),
        ("nan 1 0 0 0 0 0 1", "trajectory.tum:3: found time `nan`; expected a finite number of seconds".to_owned()),
        (
            "1700000000050000000 1 0 0 0 0 0 1",
            "trajectory.tum:3: found time 1700000000050000000 s; expected seconds within 292 years of zero; is it in \
             ns?".to_owned(),
        ),
        (
            "1699999999.999999999 1 0 0 0 0 0 1",
            "trajectory.tum:3: found time 1699999999.999999999 s after 1700000000.000000000 s in line 2; expected \
             times that increase".to_owned(),
        ),
        (
            "1.7e9 1 0 0 0 0 0 1",
            "trajectory.tum:3: found time 1.7e9 s after 1700000000.000000000 s in line 2; expected times that \
             increase".to_owned(),
        ),
        (
            "1700000000.050000000 1e300 0 0 0 0 0 1",
            "trajectory.tum:3: found a coordinate of 1e300 m; expected metres, at most 1e9".to_owned(),
        ),
        (
            "1700000000.050000000 1 0 0 0 0 0 1e150",
            "trajectory.tum:3: found a quaternion of length 1.000000e150; expected a unit quaternion qx qy qz \
             qw (length 1 within 0.001)".to_owned(),
        ),
        (
            "1700000000.050000000 1 0 0 0 0 0 0.5",
            "trajectory.tum:3: found a quaternion of length 0.500000; expected a unit quaternion qx qy qz qw (length \
             1 within 0.001)".to_owned(),
        ),
        (
            "1700000000.050000000 1 0 0 0 0 0 0",
            "trajectory.tum:3: found a quaternion of length 0.000000; expected a unit quaternion qx qy qz qw (length \
             1 within 0.001)".to_owned(),
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
fn trajectories_that_do_not_cover_a_frame() {
    // Line 239 of 240 starts at 0.04 + 0.02 * 239/240 and integrates for 0.01: until 0.069916667.
    let tail = "(times on the frames' clock; poses are never extrapolated)";
    let error = format!(
        "trajectory.tum: frame 1 (000001.png) needs poses from 0.040000000 s to 0.069916667 s, but the trajectory \
         covers only 0.000000000 s to 0.069900000 s: missing 0.069900000 s to 0.069916667 s {tail}"
    );
    Fixture::spoilt("trajectory.tum", "1700000000.100000000", "1700000000.069900000", &error);
    let fixture = Fixture::new();
    fixture.write("trajectory.tum", TRAJECTORY.replace("00.100000000", "00.069916667"));
    fixture.read().unwrap_or_else(|e| panic!("just enough: {e}"));
    let error = format!(
        "trajectory.tum: frame 0 (000000.png) needs poses from 0.000000000 s to 0.029916667 s, but the trajectory \
         covers only 0.000000002 s to 0.100000000 s: missing 0.000000000 s to 0.000000002 s {tail}"
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
    assert_eq!(
        unknown(&["table"]),
        "objects/cup.tum: unknown object of scene.obj `cup`; expected one of table"
    );
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
