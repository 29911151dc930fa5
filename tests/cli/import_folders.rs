//! `shutterbug import` of data sets that are folders.

use std::fs;
use std::path::Path;

use crate::import_support::{import, last_line, text};

fn picture(path: &Path, value: u8) {
    fs::create_dir_all(path.parent().expect("a folder")).expect("made");
    image::GrayImage::from_pixel(8, 6, image::Luma([value])).save(path).expect("written");
}

fn write(root: &Path, name: &str, content: &str) {
    let path = root.join(name);
    fs::create_dir_all(path.parent().expect("a folder")).expect("made");
    fs::write(path, content).expect("written");
}

fn read(root: &Path, name: &str) -> String {
    fs::read_to_string(root.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

const SENSOR: &str = "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  \
                      data: [0.0, -1.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n\
                      rate_hz: 20\nresolution: [8, 6]\ncamera_model: pinhole\nintrinsics: [9.0, 9.0, 3.5, 2.5]\n\
                      distortion_model: radial-tangential\ndistortion_coefficients: [0.0, 0.0, 0.0, 0.0]\n";
const IMU: &str = "sensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  \
                   data: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n";

fn euroc(root: &Path) {
    write(root, "mav0/cam0/sensor.yaml", SENSOR);
    let line = |k: u64| format!("{},{}.png\n", 100 + 50_000_000 * k, 100 + 50_000_000 * k);
    write(
        root,
        "mav0/cam0/data.csv",
        &format!("#timestamp [ns],filename\n{}{}{}", line(0), line(1), line(2)),
    );
    for k in 0..3 {
        picture(&root.join(format!("mav0/cam0/data/{}.png", 100 + 50_000_000 * k)), 40 + k as u8);
    }
    write(root, "mav0/imu0/sensor.yaml", IMU);
    write(
        root,
        "mav0/imu0/data.csv",
        "#timestamp [ns],w,w,w,a,a,a\n100,1.0,2.0,3.0,4.0,5.0,6.0\n200,1,2,3,4,5,6\n",
    );
}

#[test]
fn euroc_gives_pictures_and_the_gyro_in_the_cameras_axes() {
    let folder = tempfile::tempdir().expect("a folder");
    let (root, out) = (folder.path().join("in"), folder.path().join("out"));
    euroc(&root);
    let (code, _, said) = import(&[&text(&root), "--out", &text(&out)]);
    assert!(code == 0 && said.contains("3 frames and 0 poses"), "{said}");
    assert_eq!(
        fs::read(out.join("50000100.png")).ok(),
        fs::read(root.join("mav0/cam0/data/50000100.png")).ok()
    );
    // The camera is turned by 90 degrees about z: what is x for the body is -y for the camera.
    let imu = read(&out, "imu.csv");
    let row = imu.lines().find(|l| l.starts_with("100,")).expect("a row");
    let row: Vec<f64> = row.split(',').map(|n| n.parse().expect("a number")).collect();
    let expected = [100.0, 2.0, -1.0, 3.0, 5.0, -4.0, 6.0];
    assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{imu}");
    assert!(read(&out, "camera.toml").contains("frame_period_s = 0.05"));
    // With poses for the first two frames alone, the third is left out.
    let pose = |ns: u64| format!("{ns},1,2,3,1,0,0,0\n");
    write(&root, "mav0/state_groundtruth_estimate0/data.csv", &[pose(0), pose(101_000_000)].concat());
    let (code, _, said) = import(&[&text(&root.join("mav0")), "--out", &text(&out), "--overwrite"]);
    assert!(code == 0 && said.contains("2 frames and 2 poses"), "{said}");
    assert!(!out.join("100000100.png").exists() && said.contains("1 of 3 frames are left out"), "{said}");
    fs::remove_file(root.join("mav0/cam0/data/50000100.png")).expect("removed");
    let (code, _, said) = import(&[&text(&root), "--out", &text(&out), "--overwrite"]);
    assert!(
        code == 1 && last_line(&said).contains("50000100.png: found no such file, as 1 of 2 pictures"),
        "{said}"
    );
}

#[test]
fn tum_gives_pictures_and_ground_truth() {
    let folder = tempfile::tempdir().expect("a folder");
    let (root, out) = (folder.path().join("in"), folder.path().join("out"));
    for name in ["1.000100", "1.033333", "1.066700"] {
        picture(&root.join(format!("rgb/{name}.png")), 9);
    }
    let list =
        "# color images\n1.000100 rgb/1.000100.png\n1.033333 rgb/1.033333.png\n1.066700 rgb/1.066700.png\n";
    write(&root, "rgb.txt", list);
    write(&root, "depth.txt", "1.0 depth/1.png\n");
    write(&root, "groundtruth.txt", "# t\n0.9 1 2 3 0 0 0 1\n1.2 2 2 3 0 0 0.7071 0.7071\n");
    let run = || import(&[&text(&root), "--out", &text(&out), "--overwrite"]);
    let (code, _, said) = run();
    assert!(
        code == 0 && said.contains("3 frames and 2 poses") && said.contains("depth.txt is left out"),
        "{said}"
    );
    assert!(read(&out, "frames.csv").contains("\n1033333000,1.033333.png\n"));
    assert!(read(&out, "trajectory.tum").contains("\n1.200000000 2.0 2.0 3.0 0.0 0.0 0.70710"));
    assert!(out.join("1.066700.png").is_file());
    for (list, part) in [
        ("1.0 rgb/a.png\n0.9 rgb/b.png\n", "rgb.txt:2: found time 900000000 ns after 1000000000 ns"),
        ("1.0 ../a.png\n", "rgb.txt:1: found file `../a.png`"),
        ("now rgb/a.png\n", "rgb.txt:1: found time `now`"),
        ("# none\n", "found no picture"),
    ] {
        write(&root, "rgb.txt", list);
        let (code, _, said) = run();
        assert!(code == 1 && said.contains(part), "{said}");
    }
}

#[test]
fn kitti_gives_pictures_the_cameras_place_and_its_pinhole() {
    let folder = tempfile::tempdir().expect("a folder");
    let (root, out) = (folder.path().join("sequences/00"), folder.path().join("out"));
    let rest = "0 100 3.5 0 0 0 1 0";
    let calib =
        format!("P0: 120 0 2.5 0 {rest}\nP1: 120 0 2.5 0 {rest}\nP2: 120 0 2.5 -60 {rest}\nP3: 1 2\n");
    write(&root, "calib.txt", &calib);
    write(&root, "times.txt", "0\n0.1\n0.2\n");
    for k in 0..3 {
        picture(&root.join(format!("image_2/00000{k}.png")), k);
    }
    let run = |more: &[&str]| {
        import(&[&[text(&root).as_str(), "--out", &text(&out), "--overwrite"][..], more].concat())
    };
    let (code, _, said) = run(&[]);
    assert!(code == 0 && said.contains("3 frames and 0 poses"), "{said}");
    let camera = read(&out, "camera.toml");
    for part in ["width = 8\n", "fx = 120.0\n", "fy = 100.0\n", "cx = 3.0\n", "cy = 4.0\n"] {
        assert!(camera.contains(part), "{camera}");
    }
    let line = |x: f64| format!("1 0 0 {x} 0 1 0 0 0 0 1 0\n");
    write(folder.path(), "poses/00.txt", &[line(0.0), line(1.0), line(2.0)].concat());
    let (code, _, said) = run(&[]);
    assert!(code == 0 && said.contains("2 frames and 3 poses"), "{said}");
    // 60 px over 120 px: camera 2 sits half a metre to the right of camera 0.
    assert!(read(&out, "trajectory.tum").contains("\n0.100000000 1.5 "), "{}", read(&out, "trajectory.tum"));
    let (code, _, said) = run(&["--name", "image_3"]);
    assert!(code == 1 && said.contains("calib.txt:4: found 2 numbers"), "{said}");
    assert_eq!(run(&["--name", "left"]).0, 2);
}

#[test]
fn a_folder_of_no_known_kind_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let (code, _, said) = import(&[&text(folder.path())]);
    assert!(
        code == 1 && said.contains("a folder of no known kind; expected mav0 (EuRoC), rgb.txt (TUM)"),
        "{said}"
    );
}
