//! OBJ, MTL and textures that are broken on purpose: the error names file and line, and nothing panics.
#![allow(clippy::unwrap_used)]

use std::cell::RefCell;
use std::fs;
use std::path::Path;
use std::sync::Once;

use proptest::prelude::*;
use shutterbug::scene::{Scene, load_obj};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// A folder `capture` with these files, and what loading its `scene.obj` gives.
fn load_files(files: &[(&str, &[u8])]) -> Result<Scene, String> {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("capture");
    fs::create_dir(&root).unwrap();
    for (name, bytes) in files {
        fs::write(root.join(name), bytes).unwrap();
    }
    load_obj(&root.join("scene.obj"), &root)
        .map_err(|e| e.to_string().replace(&format!("{}/", root.display()), ""))
}

fn load_text(obj: &str) -> Result<Scene, String> {
    load_files(&[("scene.obj", obj.as_bytes())])
}

#[test]
fn errors_name_line_and_cause() {
    let cases = [
        ("f 1 2 4", "scene.obj:4: found vertex index 4 in `f 1 2 4`; expected at most 3"),
        ("f 1 2 0", "scene.obj:4: found vertex index 0 in"),
        ("f 1 2 -4", "scene.obj:4: found vertex index -4 in `f 1 2 -4`; expected at least -3"),
        ("f 1 2 9223372036854775807", "scene.obj:4: found vertex index 9223372036854775807"),
        ("f 1 2 -9223372036854775808", "scene.obj:4: found vertex index -9223372036854775808"),
        ("f 1 2 99999999999999999999", "scene.obj:4: found `99999999999999999999` in"),
        ("f 1/1 2/1 3/1", "scene.obj:4: found texture coordinate index 1 in"),
        ("f 1//1 2//1 3//1", "scene.obj:4: found normal index 1 in"),
        ("f 1 2 x", "scene.obj:4: found `x` in `f 1 2 x`; expected integers"),
        ("f 1 2 3.0", "scene.obj:4: found `3.0` in"),
        ("f 1///1 2 3", "scene.obj:4: found `1///1` in"),
        ("f /1 2 3", "scene.obj:4: found `/1` in"),
        ("v 1 2\nf 1 2 3", "scene.obj:4: found `v 1 2`; expected three numbers"),
        ("v 1 2 abc\nf 1 2 3", "scene.obj:4: found `v 1 2 abc`; expected three numbers"),
        (
            "v 0 0 inf\n\nf 1 2 4",
            "scene.obj:6: found a face with vertex 4, which line 4 gives as NaN or infinite",
        ),
        ("v 0 0 1e39\nf 1 2 4", "scene.obj:5: found a face with vertex 4, which line 4"),
        ("vt nan 0\nf 1/1 2/1 3/1", "scene.obj:5: found a face with texture coordinate 1, which line 4"),
        ("f 1 2 2", "scene.obj: found no triangle (1 face without area"),
        ("", "scene.obj: found no triangle"),
    ];
    for (rest, expected) in cases {
        let message = load_text(&format!("{TRIANGLE}{rest}\n")).map(|s| s.triangle_count()).unwrap_err();
        assert!(message.starts_with(expected), "{rest}: {message}");
    }
    // Control: the same beginning with a good face, and with bad values that no face uses, loads.
    for good in ["f 1 2 3", "f -3 -2 -1", "v 0 0 nan\nvn 0 inf 0\nf 1 2 3", "f 1 2 4\nv 5 5 5", "fo 1 2 3"] {
        assert_eq!(load_text(&format!("{TRIANGLE}{good}\n")).unwrap().triangle_count(), 1, "{good}");
    }
    let many = format!("{TRIANGLE}f{}", " 1 2 3".repeat(4000));
    assert!(load_text(&many).unwrap_err().contains("more than 10000 corners"));
}

#[test]
fn paths_that_leave_the_folder_are_refused_and_named() {
    let png = fs::read("tests/data/obj/checker.png").unwrap();
    let obj = format!("mtllib m.mtl\nusemtl a\n{TRIANGLE}f 1 2 3\n");
    let with_map = |name: &str| {
        let mtl = format!("newmtl a\nKd 1 1 1\nmap_Kd {name}\n");
        load_files(&[("scene.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes()), ("in.png", &png)])
    };
    for name in [
        "../in.png",
        "..\\..\\in.png",
        "/etc/hostname",
        "C:\\t\\in.png",
        "x/../../in.png",
        "-o 1 1 ../in.png",
    ] {
        let message = with_map(name).map(|s| s.textures.len()).unwrap_err();
        assert!(
            message.starts_with("m.mtl:3: found the path") && message.contains("outside"),
            "{name}: {message}"
        );
    }
    assert_eq!(with_map("./x/../IN.png").unwrap().textures.len(), 1, "control: inside");
    for name in ["../m.mtl", "/m.mtl", "a.mtl ../m.mtl", "D:/m.mtl"] {
        let message = load_text(&format!("\nmtllib {name}\n{TRIANGLE}f 1 2 3\n")).map(|_| ()).unwrap_err();
        assert!(message.starts_with("scene.obj:2: found the path"), "{name}: {message}");
    }
    assert!(
        load_text(&format!("mtllib a.mtl b.mtl\n{TRIANGLE}f 1 2 3\n")).is_ok(),
        "control: absent is no error"
    );
}

#[test]
fn an_obj_outside_its_root_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("capture")).unwrap();
    let outside = dir.path().join("scene.obj");
    fs::write(&outside, format!("{TRIANGLE}f 1 2 3\n")).unwrap();
    assert!(load_obj(&outside, &dir.path().join("capture")).is_err());
    assert!(load_obj(&outside, dir.path()).is_ok(), "control");
    assert!(
        load_obj(&dir.path().join("absent.obj"), dir.path()).unwrap_err().to_string().contains("absent.obj")
    );
}

#[test]
fn broken_and_oversized_textures_are_errors_and_absent_ones_are_not() {
    let obj = format!("mtllib m.mtl\nusemtl a\n{TRIANGLE}f 1 2 3\n");
    let mtl: &[u8] = b"newmtl a\nmap_Kd t.png\n";
    let wide = |width: u32| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::RgbImage::new(width, 1).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    };
    let load = |png: &[u8]| load_files(&[("scene.obj", obj.as_bytes()), ("m.mtl", mtl), ("t.png", png)]);
    let good = wide(16_384);
    assert_eq!(load(&good).unwrap().textures[0].width, 16_384, "control: the limit itself");
    for bad in [wide(16_385), b"not a picture".to_vec(), Vec::new(), good[..good.len() / 2].to_vec()] {
        let message = load(&bad).map(|_| ()).unwrap_err();
        assert!(message.starts_with("t.png: cannot decode"), "{message}");
    }
    let absent = load_files(&[("scene.obj", obj.as_bytes()), ("m.mtl", mtl)]).unwrap();
    assert_eq!((absent.textures.len(), absent.materials[0].kd), (0, [1.0; 3]));
}

thread_local! {
    static LOG: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// What this thread's calls log.
struct Log;

impl std::io::Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        LOG.with_borrow_mut(|log| log.extend_from_slice(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// One subscriber for the process, not one for a call: `tracing` keeps what it learns of a place in the code when a
/// thread first passes it, and a test beside this one, with no subscriber, would teach it that nobody listens.
fn listen() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let subscriber = tracing_subscriber::fmt().with_ansi(false).with_writer(|| Log).finish();
        tracing::subscriber::set_global_default(subscriber).expect("nobody else installs one");
    });
}

#[test]
fn what_is_left_out_is_warned_of_with_its_number() {
    listen();
    let warnings = |rest: &str| {
        LOG.take();
        let loaded = load_text(&format!("{TRIANGLE}{rest}f 1 2 3\n"));
        assert_eq!(loaded.unwrap().triangle_count(), 1, "{rest}");
        String::from_utf8(LOG.take()).unwrap()
    };
    for (rest, expected) in [
        ("usemtl a\np 1\nl 1 2\nf 1 2\n", "3 points and lines are left out"),
        ("usemtl a\nf 1 2 1\nf 1 1 1 1\n", "scene.obj:5: 2 faces without area"),
        ("usemtl a\nv nan 0 0\n", "1 value that no face uses is NaN"),
        ("usemtl a\ncurv 1 2\nparm 3\n", "scene.obj:5: 2 lines are not supported, such as `curv`"),
        ("mtllib no.mtl\nusemtl a\n", "scene.obj:4: no material file `no.mtl`"),
        ("usemtl a\n", "scene.obj:5: material `a` is defined nowhere"),
        ("", "scene.obj:4: faces before any `usemtl` are grey"),
    ] {
        let log = warnings(rest);
        assert!(log.contains(expected), "{rest}: {log}");
    }
    assert_eq!(warnings("usemtl a\n").lines().count(), 1, "control: nothing else is warned of");
}

/// What holds for every scene that loads.
fn check(scene: &Scene) -> Result<(), TestCaseError> {
    let mut at = 0;
    let mut last_run = None;
    for draw in &scene.draws {
        prop_assert_eq!(draw.first_index, at);
        prop_assert!(draw.index_count > 0 && draw.index_count % 3 == 0);
        // One run for each texture and gloss, in order.
        let first = scene.vertices[scene.indices[at as usize] as usize];
        let run = Some((draw.texture, scene.materials[first.material as usize].is_glossy()));
        prop_assert!(run > last_run, "{:?} after {:?}", run, last_run);
        last_run = run;
        at += draw.index_count;
        for index in &scene.indices[draw.first_index as usize..at as usize] {
            let vertex = scene.vertices[*index as usize];
            prop_assert_eq!(scene.materials[vertex.material as usize].texture, draw.texture);
            prop_assert!((vertex.object as usize) < scene.objects.len());
            prop_assert!(vertex.position_m.iter().chain(&vertex.uv).all(|v| v.is_finite()));
            prop_assert!((glam::Vec3::from(vertex.normal).length() - 1.0).abs() < 1e-5);
        }
    }
    prop_assert_eq!(at as usize, scene.indices.len());
    prop_assert!(at > 0);
    Ok(())
}

fn check_outcome(outcome: Result<Scene, String>) -> Result<(), TestCaseError> {
    match outcome {
        Ok(scene) => check(&scene),
        Err(message) => {
            let named = ["scene.obj", "shapes.mtl", "checker.png"].iter().any(|f| message.starts_with(f));
            prop_assert!(named, "{}", message);
            Ok(())
        }
    }
}

/// A change at a place in a text: bytes taken out, bytes put in.
fn mutations() -> impl Strategy<Value = Vec<(prop::sample::Index, usize, Vec<u8>)>> {
    let words: Vec<&[u8]> = vec![
        b"nan",
        b"-1",
        b"0",
        b"1e38",
        b"-3.4e38",
        b"99999999999999999999",
        b"/",
        b"//",
        b" ",
        b"\n",
        b"\\\n",
        b"\0",
        b"#",
        b"f ",
        b"\nf 1 2 3 4 5 6 7",
        b"\nv 1 2",
        b"\ns 1\n",
        b"\no a\n",
        b"..",
        b"\xff",
        b"-",
        b"inf",
        b"\nmtllib ",
    ];
    let insert = prop_oneof![
        prop::sample::select(words).prop_map(<[u8]>::to_vec),
        prop::collection::vec(any::<u8>(), 0..4)
    ];
    prop::collection::vec((any::<prop::sample::Index>(), 0..6_usize, insert), 1..6)
}

fn mutate(text: &mut Vec<u8>, mutations: Vec<(prop::sample::Index, usize, Vec<u8>)>) {
    for (place, out, put_in) in mutations {
        let from = place.index(text.len() + 1);
        let to = text.len().min(from + out);
        text.splice(from..to, put_in);
    }
}

/// A line of OBJ with numbers that are often small and sometimes absurd.
fn line() -> impl Strategy<Value = String> {
    let number = prop_oneof![
        8 => (-3..4_i32).prop_map(|v| v.to_string()),
        3 => any::<f32>().prop_map(|v| v.to_string()),
        1 => Just("nan".to_owned()),
    ];
    let corner = (-4..9_i64, -1..3_i64, -1..3_i64).prop_map(|(v, t, n)| match (t, n) {
        (0, 0) => format!("{v}"),
        (t, 0) => format!("{v}/{t}"),
        (0, n) => format!("{v}//{n}"),
        (t, n) => format!("{v}/{t}/{n}"),
    });
    let plain = (1..9_i64).prop_map(|v| v.to_string());
    prop_oneof![
        4 => prop::collection::vec(number.clone(), 3..5).prop_map(|n| format!("v {}", n.join(" "))),
        1 => prop::collection::vec(number.clone(), 1..4).prop_map(|n| format!("vt {}", n.join(" "))),
        1 => prop::collection::vec(number, 3..4).prop_map(|n| format!("vn {}", n.join(" "))),
        1 => prop::collection::vec(corner, 1..9).prop_map(|c| format!("f {}", c.join(" "))),
        4 => prop::collection::vec(plain, 3..9).prop_map(|c| format!("f {}", c.join(" "))),
        1 => prop::sample::select(vec!["o a", "g b", "s 1", "s off", "usemtl checked", "mtllib shapes.mtl", "p 1"])
            .prop_map(str::to_owned),
    ]
}

fn with_shapes(obj: &[u8], mtl: &[u8]) -> Result<Scene, String> {
    let png = fs::read("tests/data/obj/checker.png").unwrap();
    load_files(&[("scene.obj", obj), ("shapes.mtl", mtl), ("checker.png", &png)])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        check_outcome(load_files(&[("scene.obj", &bytes)]))?;
    }

    #[test]
    fn mutated_obj_files_load_soundly_or_are_refused(changes in mutations()) {
        let mut obj = fs::read("tests/data/obj/shapes.obj").unwrap();
        mutate(&mut obj, changes);
        check_outcome(with_shapes(&obj, &fs::read("tests/data/obj/shapes.mtl").unwrap()))?;
    }

    #[test]
    fn mutated_mtl_files_load_soundly_or_are_refused(changes in mutations()) {
        let mut mtl = fs::read("tests/data/obj/shapes.mtl").unwrap();
        mutate(&mut mtl, changes);
        check_outcome(with_shapes(&fs::read("tests/data/obj/shapes.obj").unwrap(), &mtl))?;
    }

    #[test]
    fn random_statements_load_soundly_or_are_refused(lines in prop::collection::vec(line(), 5..40)) {
        check_outcome(with_shapes(lines.join("\n").as_bytes(), b"newmtl checked\nmap_Kd checker.png\n"))?;
    }
}

#[test]
fn the_invariants_reject_wrong_scenes() {
    let good = load_obj(Path::new("tests/data/obj/shapes.obj"), Path::new("tests/data/obj")).unwrap();
    check(&good).unwrap();
    let mut wrong = good.clone();
    wrong.vertices[0].position_m[1] = f32::NAN;
    assert!(check(&wrong).is_err());
    let mut wrong = good.clone();
    wrong.draws.swap(0, 1);
    assert!(check(&wrong).is_err());
    let mut wrong = good;
    wrong.indices.truncate(3);
    wrong.draws.truncate(1);
    wrong.draws[0].index_count = 3;
    wrong.vertices[wrong.indices[0] as usize].normal = [0.0; 3];
    assert!(check(&wrong).is_err());
}
