//! The shipped files are what the maker writes, and hold what the paper's scene held.

use std::path::{Path, PathBuf};

use glam::DVec3;
use shutterbug::capture::Capture;
use shutterbug::scene::Shading;

use super::{OBJECTS, TRIANGLES, files, hall, mesh, motion};

fn shipped() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenes/table1")
}

/// Files whose bytes differ from the shipped ones.
fn differing(made: &[(String, Vec<u8>)]) -> Vec<&str> {
    let differs = |(name, bytes): &&(String, Vec<u8>)| {
        let path = shipped().join(name);
        std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())) != *bytes
    };
    made.iter().filter(differs).map(|f| f.0.as_str()).collect()
}

#[test]
fn shipped_bytes_are_the_made_ones() {
    let mut made = files().expect("textures encode");
    assert_eq!(
        differing(&made),
        [""; 0],
        "run `cargo run --release -p shutterbug-tools -- table1-scene --out scenes/table1`"
    );
    // Control: one changed byte is found.
    let obj = made.iter().position(|f| f.0 == "scene.obj").expect("a scene");
    made[obj].1[300] ^= 1;
    assert_eq!(differing(&made), ["scene.obj"]);
}

/// Objects, triangles and lights of a capture, as the engine reads it.
fn counts(folder: &Path) -> (usize, usize, usize) {
    let capture = Capture::read(folder, None).expect("the shipped capture is valid");
    let Shading::Lit(lights) = &capture.scene.shading else { panic!("the scene is lit") };
    let named = capture.scene.objects.iter().filter(|o| !o.name.is_empty()).count();
    (named, capture.scene.triangle_count(), lights.len())
}

#[test]
fn it_holds_what_the_paper_says() {
    let (objects, triangles, lights) = counts(&shipped());
    assert_eq!((objects, lights), (OBJECTS, 5));
    let off = triangles.abs_diff(TRIANGLES) as f64 / TRIANGLES as f64;
    assert!(off <= 0.01, "{triangles} triangles");
    assert_eq!(triangles, mesh().triangle_count(), "the loader keeps every triangle");
    // Control: the demo's scene is another one.
    let (objects, triangles, lights) = counts(&shipped().join("../../demo/capture"));
    assert!(objects != OBJECTS && triangles.abs_diff(TRIANGLES) > TRIANGLES / 100 && lights == 5);
}

#[test]
fn every_object_has_a_name_of_its_own_and_what_moves_is_there() {
    let obj = mesh().obj("");
    let mut names: Vec<&str> = obj.lines().filter_map(|l| l.strip_prefix("o ")).collect();
    names.sort_unstable();
    let all = names.len();
    names.dedup();
    assert_eq!((names.len(), all), (OBJECTS, OBJECTS));
    for (name, _) in motion::objects() {
        assert!(names.contains(&name) && motion::resting(name).is_none(), "{name}");
    }
    for kind in ["room", "crate_1", "goal_blue", "goal_yellow", "ball_1", "robot_1", "field_lines"] {
        assert!(names.contains(&kind), "{kind}");
    }
}

#[test]
fn faces_are_planar_and_turned_outwards() {
    for corners in &mesh().polygons {
        let [a, b, c] = [0, 1, 2].map(|i| corners[i].0);
        let normal = (b - a).cross(c - b);
        assert!(normal.length() > 1e-9, "no face without area: {a} {b} {c}");
        for (position, _, vertex_normal) in corners {
            assert!((vertex_normal.length() - 1.0).abs() < 1e-9, "a unit normal at {position}");
            assert!(normal.normalize().dot(*vertex_normal) > 0.3, "winding at {position}");
            let off = normal.normalize().dot(*position - a).abs();
            assert!(off < 1e-9, "a face is planar: {position} is {off} m off");
        }
    }
}

#[test]
fn camera_and_movers_stay_in_the_room_and_the_camera_pans() {
    let [min, max] = hall::ROOM;
    let [first, last] = motion::SPAN_S;
    let at = |i: u32| first + (last - first) * f64::from(i) / 200.0;
    for i in 0..=200 {
        for (name, pose) in motion::objects() {
            let p = pose(at(i)).translation_m;
            assert!(p.cmpgt(min - 1e-9).all() && p.cmplt(max).all(), "{name}: {p}");
        }
    }
    let heading = |t: f64| {
        let forward = motion::camera(t).rotation * DVec3::Z;
        forward.y.atan2(forward.x)
    };
    let turned = heading(10.8) - heading(10.0);
    assert!((0.6..0.9).contains(&turned), "{turned} rad in the recording");
    assert!((motion::camera(10.0).translation_m - motion::camera(10.8).translation_m).length() > 0.05);
}
