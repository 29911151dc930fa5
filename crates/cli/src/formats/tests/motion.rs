//! Recorded motion: EuRoC and KITTI.

use std::fs;

use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::formats::motion::{parse_ground_truth, parse_kitti_poses, parse_times};
use crate::formats::{read_euroc, read_kitti};
use shutterbug::camera::Trajectory;

/// A recording of 1 s with poses at 100 Hz from 0.2 s on, and frames at 20 Hz. The body turns by 90 degrees about z.
fn recording() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: String| {
        let path = folder.path().join("mav0").join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, text).expect("written");
    };
    let stamp = |i: u64, step_ns: u64| 1_403_636_579_758_555_392 + i * step_ns;
    write("cam0/sensor.yaml", EUROC.to_owned());
    let frames = (0..20).map(|i| format!("{0},{0}.png\r\n", stamp(i, 50_000_000)));
    write("cam0/data.csv", "#timestamp [ns],filename\r\n".to_owned() + &frames.collect::<String>());
    let pose = |i: u64| {
        let half = i as f64 / 100.0 * std::f64::consts::FRAC_PI_4;
        let (w, z) = (half.cos(), half.sin());
        format!(
            "{},{},2.0,3.0,{w},0.0,0.0,{z},0.1,0.2,0.3,0,0,0,0,0,0\n",
            stamp(i, 10_000_000),
            i as f64 / 100.0
        )
    };
    let header =
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n";
    write(
        "state_groundtruth_estimate0/data.csv",
        header.to_owned() + &(20..=100).map(pose).collect::<String>(),
    );
    folder
}

#[test]
fn the_cameras_pose_is_the_bodys_times_t_bs() {
    let folder = recording();
    let motion = read_euroc(folder.path(), None).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(motion.poses.len(), 81);
    // At the last pose the body stands at (1, 2, 3), turned by 90 degrees: (x, y, z) is at (1 - y, 2 + x, 3 + z). T_BS
    // puts the camera's (x, y, z) at the body's (-y - 0.02, x - 0.06, z + 0.01).
    let (ns, pose) = motion.poses[80];
    assert_eq!(ns, 1_403_636_580_758_555_392);
    let (x, y, z) = (0.3, -0.4, 2.0);
    let (bx, by, bz) = (-y - 0.02, x - 0.06, z + 0.01);
    let want = DVec3::new(1.0 - by, 2.0 + bx, 3.0 + bz);
    let got = pose.transform(DVec3::new(x, y, z));
    assert!((got - want).length() < 1e-12, "{got} {want}");
    // Control: the body's pose alone is elsewhere.
    assert!((DVec3::new(1.0 - y, 2.0 + x, 3.0 + z) - want).length() > 0.1);
    // Frames at 0.20 to 0.95 s are covered for a whole period; four come before the first pose.
    assert_eq!(motion.frames.len(), 16);
    assert!(motion.notes.iter().any(|n| n.contains("4 of 20 frames are left out")), "{:#?}", motion.notes);
    // The folder above and the folder itself are the same recording.
    let inner = read_euroc(&folder.path().join("mav0"), Some("cam0")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(inner.frames, motion.frames);
}

#[test]
fn what_is_written_is_what_a_capture_reads() {
    let folder = recording();
    let motion = read_euroc(folder.path(), None).unwrap_or_else(|e| panic!("{e}"));
    let frames = shutterbug::capture::parse_frames(Path::new("frames.csv"), &motion.frames_csv());
    let frames = frames.unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(frames.len(), 16);
    let epoch_ns = shutterbug::capture::clock_epoch_ns(frames[0].timestamp_ns);
    let path = Trajectory::parse(Path::new("t.tum"), &motion.trajectory_tum(), epoch_ns);
    let path = path.unwrap_or_else(|e| panic!("{e}"));
    assert!(path.covers(frames[15].start_s, frames[15].start_s + 0.05));
    for &(ns, pose) in &motion.poses {
        let got = path.pose_at((ns - epoch_ns) as f64 * 1e-9);
        assert!((got.translation_m - pose.translation_m).length() < 1e-12);
        assert!(got.rotation.dot(pose.rotation).abs() > 1.0 - 1e-12);
    }
}

#[test]
fn the_tracked_sensors_own_place_counts() {
    let folder = recording();
    let before = read_euroc(folder.path(), None).unwrap_or_else(|e| panic!("{e}"));
    let file = folder.path().join("mav0/state_groundtruth_estimate0/sensor.yaml");
    fs::write(
        file,
        "sensor_type: visual-inertial\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, 0.5, \
        0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n",
    )
    .expect("written");
    let after = read_euroc(folder.path(), None).unwrap_or_else(|e| panic!("{e}"));
    // The sensor sits 0.5 m ahead on the body, which itself is then 0.5 m back; turned by 90 degrees that is along y.
    let moved = after.poses[80].1.translation_m - before.poses[80].1.translation_m;
    assert!((moved - DVec3::new(0.0, -0.5, 0.0)).length() < 1e-12, "{moved}");
}

#[test]
fn bad_recordings_are_refused_with_their_line() {
    let refused = |text: &str| parse_ground_truth(Path::new("g.csv"), text).expect_err("bad").to_string();
    let good = "1,0,0,0,1,0,0,0\n";
    assert_eq!(
        refused(&format!("#h\n{good}1,0,0,0,1,0,0,0\n")),
        "g.csv:3: found time 1 ns after 1 ns; expected times that increase"
    );
    assert!(refused("1,0,0,0,1,0,0").starts_with("g.csv:1: found 7 values"));
    assert!(refused("1,0,0,0,0,0,0,0").contains("a quaternion of length 0.000000"));
    assert!(refused("1.5,0,0,0,1,0,0,0").contains("a whole number of ns"));
    assert!(refused("1,0,0,inf,1,0,0,0").contains("`inf`"));
    assert!(refused("# nothing\n").contains("no pose"));
    let folder = recording();
    let poses = folder.path().join("mav0/state_groundtruth_estimate0/data.csv");
    fs::write(&poses, "5,0,0,0,1,0,0,0\n6,0,0,0,1,0,0,0\n").expect("written");
    let error = read_euroc(folder.path(), None).expect_err("another clock").to_string();
    assert!(error.contains("are both on one clock?"), "{error}");
    fs::remove_file(poses).expect("removed");
    assert!(read_euroc(folder.path(), None).expect_err("gone").to_string().contains("no such file"));
}

#[test]
fn kitti_poses_and_times_make_a_trajectory() {
    let folder = tempfile::tempdir().expect("a folder");
    let poses = folder.path().join("00.txt");
    fs::write(&poses, "1 0 0 0 0 1 0 0 0 0 1 0\n0 0 1 0.5 0 1 0 -0.25 -1 0 0 2\n0 0 1 1 0 1 0 0 -1 0 0 3\n")
        .expect("written");
    fs::write(folder.path().join("times.txt"), "0.000000e+00\n1.036224e-01\n2.072449e-01\n")
        .expect("written");
    let motion = read_kitti(&poses, None).unwrap_or_else(|e| panic!("{e}"));
    // The last frame has no pose after it.
    assert_eq!((motion.frames.len(), motion.poses.len()), (2, 3));
    assert_eq!(
        (motion.frames[1].timestamp_ns, motion.frames[1].filename.as_str()),
        (103_622_400, "000001.png")
    );
    // Row by row: x goes to -z, z to x.
    let got = motion.poses[1].1.transform(DVec3::new(1.0, 2.0, 3.0));
    assert!((got - DVec3::new(3.5, 1.75, 1.0)).length() < 1e-12, "{got}");
    // Control: read column by column it would be elsewhere.
    assert!((got - DVec3::new(-2.5, 1.75, 3.0)).length() > 1.0);
    fs::write(folder.path().join("times.txt"), "0\n0.1\n").expect("written");
    assert!(read_kitti(&poses, None).expect_err("two times").to_string().contains("2 times for 3 poses"));
    let refused = |text: &str| parse_kitti_poses(Path::new("p"), text).expect_err("bad").to_string();
    assert!(refused("1 0 0 0 0 1 0 0 0 0 1").contains("p:1: found 11 values"));
    assert!(refused("2 0 0 0 0 1 0 0 0 0 1 0").contains("orthonormal"));
    assert!(parse_times(Path::new("t"), "0\n0\n").is_err() && parse_times(Path::new("t"), "x").is_err());
}

proptest! {
    #[test]
    fn motion_parsers_never_panic(text in "([-+0-9.eE, \n#a]|nan|inf){0,200}", any: String) {
        for text in [&text, &any] {
            let _ = parse_ground_truth(Path::new("g"), text);
            let _ = parse_kitti_poses(Path::new("p"), text);
            let _ = parse_times(Path::new("t"), text);
        }
    }

    #[test]
    fn extreme_stamps_are_written_and_read(ns in prop_oneof![any::<i64>(), -5i64..5]) {
        prop_assume!(ns != i64::MIN);
        let motion = crate::formats::Motion {
            camera: None,
            frames: Vec::new(),
            poses: vec![(ns, shutterbug::camera::Pose::IDENTITY)],
            notes: Vec::new(),
        };
        let text = motion.trajectory_tum();
        let read = Trajectory::parse(Path::new("t"), &text, ns);
        prop_assert!(read.is_ok_and(|t| t.span_s() == (0.0, 0.0)), "{}", text);
    }
}

#[test]
fn a_quaternion_whose_columns_are_named_in_another_order_is_refused() {
    let table =
        |q: &str| format!("#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], {q}\n1,0,0,0,1,0,0,0\n");
    let read = |q: &str| parse_ground_truth(Path::new("data.csv"), &table(q));
    let error = read("q_RS_x [], q_RS_y [], q_RS_z [], q_RS_w []").expect_err("another order").to_string();
    assert!(error.contains("data.csv:1") && error.contains("expected q_RS_w there"), "{error}");
    assert!(read("q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []").is_ok(), "control");
}
