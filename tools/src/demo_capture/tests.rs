//! The shipped files are what the maker writes, and they show what they are meant to show.

use std::path::PathBuf;

use glam::{DVec3, dvec3};
use shutterbug::camera::Pose;

use super::{INTRINSICS, field, files, mesh::MAX_SIDE_M, motion};

fn demo() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../demo")
}

/// Files whose bytes differ from the shipped ones.
fn differing(made: &[(&'static str, Vec<u8>)]) -> Vec<&'static str> {
    let differs = |(name, bytes): &&(&str, Vec<u8>)| {
        let path = demo().join("capture").join(name);
        std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())) != *bytes
    };
    made.iter().filter(differs).map(|f| f.0).collect()
}

#[test]
fn shipped_bytes_are_the_made_ones() {
    let mut made = files().expect("textures encode");
    assert_eq!(
        differing(&made),
        [""; 0],
        "run `cargo run --release -p shutterbug-tools -- demo-capture --out demo/capture`"
    );
    let total: usize = made.iter().map(|f| f.1.len()).sum();
    assert!(total < 400 * 1024, "{total} bytes");
    // Control: one changed byte is found.
    made[3].1[200] ^= 1;
    assert_eq!(differing(&made), ["scene.obj"]);
}

/// Where a world point falls, px, if it is on the picture.
fn seen(camera: &Pose, point_m: DVec3) -> Option<glam::DVec2> {
    let px = INTRINSICS.project(camera.inverse().transform(point_m))?;
    let inside = (0.0..320.0).contains(&px.x) && (0.0..240.0).contains(&px.y);
    inside.then_some(px)
}

#[test]
fn goals_ball_and_robot_are_seen_in_every_frame() {
    for frame in 0..motion::FRAMES {
        // From the first line's start to the end of the last exposure of the demo's slowest camera.
        for step in 0..=10 {
            let time_s =
                motion::START_S + f64::from(frame) / motion::FRAME_RATE_HZ + 0.0042 * f64::from(step);
            let camera = motion::camera(time_s);
            let [half, height, _] = field::GOAL;
            for x in [-field::FIELD_HALF[0], field::FIELD_HALF[0]] {
                for y in [-half, half] {
                    let posts = [dvec3(x, y, 0.0), dvec3(x, y, height)].map(|p| seen(&camera, p));
                    let [Some(foot), Some(top)] = posts else {
                        panic!("frame {frame}: post at {x}, {y}: {posts:?}")
                    };
                    assert!(foot.y > top.y + 30.0, "frame {frame}: upright posts stand upright");
                }
                let [left, right] = [half, -half].map(|y| seen(&camera, dvec3(x, y, 0.5)).expect("seen").x);
                assert!(left < right, "frame {frame}: +y is to the left of a camera that looks along +x");
            }
            assert!(seen(&camera, motion::ball(time_s).translation_m).is_some(), "frame {frame}: ball");
            for z in [0.0, 0.6] {
                let point = motion::robot(time_s).transform(dvec3(0.0, 0.0, z));
                assert!(seen(&camera, point).is_some(), "frame {frame}: robot");
            }
            // Control: what lies behind the camera is not seen.
            assert!(seen(&camera, dvec3(-5.4, 0.0, 0.6)).is_none());
        }
    }
}

#[test]
fn the_head_pans_as_fast_as_it_should_and_stays_in_the_room() {
    let speed = |t: f64| (motion::pan_rad(t + 1e-5) - motion::pan_rad(t - 1e-5)) / 2e-5;
    let [first, last] = motion::SPAN_S;
    let fastest =
        (0..1000).map(|i| speed(first + (last - first) * f64::from(i) / 1000.0).abs()).fold(0.0, f64::max);
    assert!((2.0..3.0).contains(&fastest), "{fastest} rad/s");
    let frame_start = |i: u32| motion::START_S + f64::from(i) / motion::FRAME_RATE_HZ;
    let gain = speed(frame_start(0) + 0.030) - speed(frame_start(0));
    assert!(gain > 0.8, "the pan accelerates inside frame 0: {gain} rad/s");
    let [min, max] = field::ROOM;
    for i in 0..=500 {
        let p = motion::camera(first + (last - first) * f64::from(i) / 500.0).translation_m;
        assert!(p.cmpgt(min + 0.5).all() && p.cmplt(max - 0.5).all(), "{p}");
    }
}

#[test]
fn the_ball_rolls_without_slipping() {
    let t = motion::START_S + 0.05;
    let (a, b) = (motion::ball(t - 1e-6), motion::ball(t + 1e-6));
    // The point that touches the ground stands still; the one on top moves twice as fast as the ball.
    let contact = a.inverse().transform(a.translation_m - DVec3::Z * field::BALL_RADIUS_M);
    let top = a.inverse().transform(a.translation_m + DVec3::Z * field::BALL_RADIUS_M);
    let speed = |p: DVec3| (b.transform(p) - a.transform(p)).length() / 2e-6;
    assert!(speed(contact) < 1e-3, "{}", speed(contact));
    assert!((speed(top) - 4.0).abs() < 1e-3, "{}", speed(top));
}

#[test]
fn faces_are_small_and_turned_outwards() {
    let mesh = field::mesh();
    for corners in &mesh.polygons {
        let [a, b, c] = [0, 1, 2].map(|i| corners[i].0);
        let normal = (b - a).cross(c - b);
        assert!(normal.length() > 1e-9, "no face without area: {a} {b} {c}");
        for (position, _, vertex_normal) in corners {
            assert!(normal.normalize().dot(*vertex_normal) > 0.8, "winding at {position}");
            let off = normal.normalize().dot(*position - a).abs();
            assert!(off < 1e-9, "a face is planar: {position} is {off} m off");
        }
        for i in 0..corners.len() {
            let side = (corners[(i + 1) % corners.len()].0 - corners[i].0).length();
            assert!(side <= MAX_SIDE_M + 1e-9, "{side} m");
        }
    }
}

#[test]
fn light_is_neither_dim_nor_blinding() {
    let received = |(point, normal): (DVec3, DVec3)| -> f64 {
        let one = |light: &DVec3| {
            let to = *light - point;
            let d = to.length();
            let [constant, linear, quadratic] = field::ATTENUATION;
            (to / d).dot(normal).max(0.0) * field::LIGHT_COLOR / (constant + linear * d + quadratic * d * d)
        };
        field::LIGHTS.iter().map(one).sum()
    };
    let on_field = received((dvec3(-1.5, 0.0, 0.0), DVec3::Z));
    let far_wall = received((dvec3(4.0, 0.0, 1.0), -DVec3::X));
    assert!((0.6..1.1).contains(&on_field), "{on_field}");
    assert!((0.4..1.1).contains(&far_wall), "{far_wall}");
}

#[test]
fn the_demo_cameras_differ_only_in_their_effects() {
    let pinhole = |path: PathBuf| -> Vec<String> {
        let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let head = text.split("\n[").next().expect("split gives at least one part");
        let lines = head.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
        lines.map(str::to_owned).collect()
    };
    let of_capture = pinhole(demo().join("capture/camera.toml"));
    assert_eq!(of_capture.len(), 8);
    for name in ["ideal", "rolling_shutter", "blur", "both", "noise"] {
        assert_eq!(pinhole(demo().join(format!("cameras/{name}.toml"))), of_capture, "{name}");
    }
}
