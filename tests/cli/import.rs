//! `shutterbug import`: recordings that others wrote come out as they went in.

use std::fs;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use crate::import_support::{START_NS, compressed, import, last_line, mcap, message, pictures, text, topic};

/// tests/data/import/make.py has made these, with the writers of rosbags and of Foxglove.
const RECORDINGS: [&str; 7] = [
    "ros1_plain.bag",
    "ros1_bz2.bag",
    "ros1_lz4.bag",
    "ros2_lz4.mcap",
    "ros2_zstd.mcap",
    "ros2_plain.db3",
    "ros2_messages_zstd.db3",
];

pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/import").join(name)
}

fn rgb(path: &Path) -> (u32, u32, Vec<u8>) {
    let picture = image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).into_rgb8();
    (picture.width(), picture.height(), picture.into_raw())
}

/// The picture that make.py states.
fn truth(k: usize) -> Vec<u8> {
    let value = |i: usize| 7 * (i / 3 % 16) + 13 * (i / 48) + 50 * (i % 3) + 29 * k;
    (0..16 * 12 * 3).map(|i| (value(i) % 256) as u8).collect()
}

/// World from camera at step i of 20 ms: x, y, z, then the quaternion.
fn pose(i: i32) -> (DVec3, DQuat) {
    let turn = DQuat::from_rotation_z(0.05 * f64::from(i));
    let place = DVec3::new(0.1 * f64::from(i), 0.0, 0.0) + turn * DVec3::new(0.1, 0.0, 0.2);
    (place, turn * DQuat::from_xyzw(-0.5, 0.5, -0.5, 0.5))
}

#[test]
fn what_others_recorded_comes_out_bit_for_bit() {
    for name in RECORDINGS {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("out");
        let (code, _, said) = import(&[&text(&data(name)), "--out", &text(&out)]);
        assert_eq!(code, 0, "{name}: {said}");
        for k in 0..3 {
            let (width, height, values) = rgb(&out.join(format!("{k:06}.png")));
            assert_eq!((width, height), (16, 12));
            assert!(values == truth(k), "{name}: picture {k}");
            assert!(values != truth(k + 1), "control: another picture is not taken for it");
        }
        let frames = fs::read_to_string(out.join("frames.csv")).expect("there");
        let line = |k: u64| format!("{},{k:06}.png\n", START_NS + 3 + 40_000_000 * k);
        assert_eq!(frames, format!("#timestamp [ns],filename\n{}{}{}", line(0), line(1), line(2)), "{name}");
        let camera = fs::read_to_string(out.join("camera.toml")).expect("there");
        for part in [
            "width = 16\n",
            "fx = 15.0\n",
            "cx = 8.0\n",
            "cy = 6.0\n",
            "frame_period_s = 0.04\n",
            "k1 = -0.1\n",
        ] {
            assert!(camera.contains(part), "{name}: {part} in {camera}");
        }
        check_poses(&out.join("trajectory.tum"), name);
        check_imu(&out.join("imu.csv"), name);
    }
}

fn numbers(line: &str, by: char) -> Vec<f64> {
    line.split(by).map(|n| n.parse().expect("a number")).collect()
}

fn check_poses(path: &Path, name: &str) {
    let text = fs::read_to_string(path).expect("there");
    let lines: Vec<&str> = text.lines().filter(|l| !l.starts_with('#')).collect();
    assert_eq!(lines.len(), 9, "{name}");
    assert!(lines[0].starts_with("1699999999.980000000 "), "{name}: {}", lines[0]);
    for (i, line) in (-1..).zip(lines) {
        let v = numbers(line, ' ');
        let (place, turn) = pose(i);
        assert!((DVec3::new(v[1], v[2], v[3]) - place).length() < 1e-12, "{name}: {line}");
        let same = DQuat::from_xyzw(v[4], v[5], v[6], v[7]).dot(turn).abs();
        assert!((same - 1.0).abs() < 1e-12, "{name}: {line}");
        let other = pose(i + 1).1.dot(turn).abs();
        assert!((other - 1.0).abs() > 1e-5, "control: the pose of another step is told apart");
    }
}

/// The base spins about its z, which is the camera's -y; it stands, so up pushes along -y too.
fn check_imu(path: &Path, name: &str) {
    let text = fs::read_to_string(path).expect("there");
    assert!(text.starts_with("# axes of the camera `optical`"), "{name}: {text}");
    let lines: Vec<&str> = text.lines().filter(|l| !l.starts_with('#')).collect();
    assert_eq!(lines.len(), 9, "{name}");
    for line in lines {
        let v = numbers(line, ',');
        for (value, expected) in v[1..].iter().zip([0.0, -2.5, 0.0, 0.0, -9.8, 0.0]) {
            assert!((value - expected).abs() < 1e-12, "{name}: {line}");
        }
    }
}

#[test]
fn a_listing_names_topics_and_writes_nothing() {
    let (code, out, said) = import(&[&text(&data("ros1_bz2.bag"))]);
    assert_eq!((code, said.as_str()), (0, ""));
    let row = |topic: &str| {
        let line = out.lines().find(|l| l.split_whitespace().next() == Some(topic));
        line.unwrap_or_else(|| panic!("{topic} in {out}")).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert_eq!(
        row("/cam/image_raw"),
        "/cam/image_raw sensor_msgs/Image 3 25.00 Hz 0.021 s 0.101 s 16x12 bgr8"
    );
    assert_eq!(row("/imu"), "/imu sensor_msgs/Imu 9 50.00 Hz 0.000 s 0.160 s");
    let (code, out, _) = import(&[&text(&data("foxglove_json.mcap"))]);
    assert!(code == 0 && out.contains("foxglove.RawImage"), "{out}");
}

#[test]
fn foxgloves_pictures_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let (code, _, said) = import(&[&text(&data("foxglove_json.mcap")), "--out", &text(&out)]);
    assert_eq!(code, 0, "{said}");
    assert!((0..3).all(|k| rgb(&out.join(format!("{k:06}.png"))).2 == truth(k)));
    assert!(said.contains("no CameraInfo") && !out.join("camera.toml").exists(), "{said}");
}

#[test]
fn jpegs_keep_their_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut jpeg = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_fn(64, 48, |x, y| image::Rgb([(x * x) as u8, (x * y * 7) as u8, 77]))
        .write_to(&mut jpeg, image::ImageFormat::Jpeg)
        .expect("encoded");
    let jpeg = jpeg.into_inner();
    let shot = |k: u64, bytes: &[u8]| {
        let ns = START_NS + k * 33_000_000;
        message(1, ns, &compressed(ns, "rgb8; jpeg compressed bgr8", bytes))
    };
    // The second was cut off while it was recorded.
    let records = [
        topic(1, "/c", "sensor_msgs/CompressedImage"),
        shot(0, &jpeg),
        shot(1, &jpeg[..jpeg.len() / 2]),
        shot(2, &jpeg),
    ];
    let (file, out) = (folder.path().join("a.mcap"), folder.path().join("out"));
    fs::write(&file, mcap(&records)).expect("written");
    let (code, _, said) = import(&[&text(&file), "--out", &text(&out)]);
    assert_eq!(code, 1, "{said}");
    assert_eq!(fs::read(out.join("000002.jpg")).expect("there"), jpeg);
    assert!(last_line(&said).contains("found 1 of 3 pictures that cannot be used"), "{said}");
    assert!(
        last_line(&said).contains("what is whole was imported") && !out.join("000001.jpg").exists(),
        "{said}"
    );
    let frames = fs::read_to_string(out.join("frames.csv")).expect("there");
    assert!(
        frames.contains("000000.jpg") && !frames.contains("000001") && frames.contains("000002.jpg"),
        "{frames}"
    );
}

#[test]
fn what_is_asked_for_is_taken() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |name: &str, more: &[&str]| {
        let (bag, out) = (text(&data("ros2_zstd.mcap")), text(&folder.path().join(name)));
        import(&[&[bag.as_str(), "--out", &out][..], more].concat())
    };
    let read = |name: &str, file: &str| fs::read_to_string(folder.path().join(name).join(file)).ok();
    assert_eq!(run("tf", &["--poses", "tf:map->optical"]).0, 0);
    assert_eq!(run("odom", &["--poses", "/odom"]).0, 0);
    for name in ["tf", "odom"] {
        check_poses(&folder.path().join(name).join("trajectory.tum"), name);
    }
    assert_eq!(run("base", &["--poses", "tf:map->base"]).0, 0);
    assert_ne!(read("base", "trajectory.tum"), read("tf", "trajectory.tum"), "control: another frame");
    assert_eq!(run("none", &["--poses", "none", "--imu", "none", "--camera-info", "none", "--capture"]).0, 0);
    assert_eq!(
        read("none", "trajectory.tum").or(read("none", "imu.csv")).or(read("none", "camera.toml")),
        None
    );
    assert!(folder.path().join("none/real/000002.png").is_file());
    assert_eq!(run("half", &["--every", "2"]).0, 0);
    let half = read("half", "frames.csv").expect("there");
    assert!(
        half.lines().count() == 3 && read("half", "camera.toml").expect("there").contains("0.08"),
        "{half}"
    );
}

#[test]
fn an_interrupted_import_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("a.mcap"), folder.path().join("out"));
    fs::write(&file, mcap(&pictures(5))).expect("written");
    let run = |more: &[&str]| import(&[&[text(&file).as_str(), "--out", &text(&out)][..], more].concat());
    assert_eq!(run(&[]).0, 0);
    let whole = fs::read(out.join("000003.png")).expect("there");
    let about = |name: &str| fs::metadata(out.join(name)).and_then(|m| m.modified()).expect("there");
    let before = about("000001.png");
    // As a run that was killed leaves it: no table, a frame that is not there and one that is not whole.
    fs::remove_file(out.join("frames.csv")).expect("removed");
    fs::remove_file(out.join("000004.png")).expect("removed");
    fs::write(out.join("000003.png"), &whole[..20]).expect("written");
    let (code, _, said) = run(&["--resume"]);
    assert!(code == 0 && said.contains("5 frames"), "{said}");
    assert_eq!(fs::read(out.join("000003.png")).expect("there"), whole);
    assert_eq!(about("000001.png"), before, "what was whole is kept");
    let (code, _, said) = run(&["--resume", "--every", "2"]);
    assert!(code == 1 && said.contains("other input or options"), "{said}");
    let (code, _, said) = run(&[]);
    assert!(code == 1 && last_line(&said).contains("--resume or --overwrite"), "{said}");
    assert_eq!(run(&["--overwrite"]).0, 0);
    let inside = import(&[&text(&file), "--out", &text(folder.path())]);
    assert!(inside.0 == 1 && inside.2.contains("contains the input"), "{}", inside.2);
}
