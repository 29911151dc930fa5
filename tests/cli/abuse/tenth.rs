//! The tenth blind set: boards whose pictures no camera takes, and names and times that the capture could not hold.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;

use serde_json::Value;

use super::sixth_charts::{Folder, board, boards, told};
use super::{assert_done, assert_refused, shutterbug};

#[test]
fn a_camera_whose_pixels_are_not_square_is_doubted_and_frames_in_motion_are_not_judged() {
    let folder = Folder::new();
    let photos = boards(&folder, "photos", &|_| 1.0);
    for entry in fs::read_dir(&photos).unwrap() {
        let path = entry.unwrap().path();
        let picture = image::open(&path).unwrap();
        let (w, h) = (picture.width() * 5 / 4, picture.height());
        picture.resize_exact(w, h, image::imageops::FilterType::CatmullRom).save(&path).unwrap();
    }
    let output = board(&folder, &photos, "7x4", &["--fps", "5"]);
    assert_done(&output);
    assert!(told(&output).contains("pixels of cameras are square"), "{}", told(&output));
    let report: Value =
        serde_json::from_slice(&fs::read(folder.path("board").join("board.json")).unwrap()).unwrap();
    assert!(report["one_camera"].is_null(), "{report}");
}

#[test]
fn names_and_times_that_no_capture_can_hold_are_refused() {
    let folder = Folder::new();
    let photos = boards(&folder, "photos", &|_| 1.0);
    for name in [&b"a,b.png"[..], b"a\"b.png", b"a\nb.png", b"\xff.png"] {
        let path = photos.join(OsStr::from_bytes(name));
        fs::copy(photos.join("00.png"), &path).unwrap();
        assert_refused(
            &board(&folder, &photos, "7x4", &[]),
            1,
            &["found a name that cannot stand in a frames.csv"],
        );
        fs::remove_file(path).unwrap();
    }
    let lines: String = (0..7).map(|i| format!("{i},{i:02}.png\n")).collect();
    fs::write(photos.join("frames.csv"), format!("#timestamp [ns],filename\n{lines}")).unwrap();
    assert_refused(
        &board(&folder, &photos, "7x4", &[]),
        1,
        &["frames.csv: found frames 1 ns apart", "timestamps in ns"],
    );
}

#[test]
fn a_board_of_another_kind_is_named_with_its_option() {
    let folder = Folder::new();
    let photos = boards(&folder, "photos", &|_| 1.0);
    for kind in ["aprilgrid", "charuco"] {
        let output = board(&folder, &photos, "8x5", &["--pattern", kind]);
        assert_refused(&output, 1, &["00.png", "squares with 7x4 inner corners: --pattern checkerboard"]);
    }
}

/// The folder that was made for it goes, and what an earlier run made in one stays.
#[test]
fn board_that_is_stopped_says_so_and_leaves_nothing() {
    let folder = Folder::new();
    let photos = folder.path("photos");
    fs::create_dir(&photos).unwrap();
    let noise =
        |x: u32, y: u32| image::Luma([(x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503)) as u8]);
    image::GrayImage::from_fn(1600, 1200, noise).save(photos.join("000.png")).unwrap();
    for i in 1..400 {
        fs::hard_link(photos.join("000.png"), photos.join(format!("{i:03}.png"))).unwrap();
    }
    let out = folder.path("board");
    let mut command = shutterbug();
    command.arg("board").arg(&photos).arg("--out").arg(&out).args(["--size", "7x4"]);
    let child = command.stderr(std::process::Stdio::piped()).spawn().unwrap();
    while !out.join(".shutterbug.lock").exists() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let killed = std::process::Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
    assert!(killed.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_refused(&output, 1, &["interrupted after ", " of 400 pictures; nothing was written"]);
    assert!(!out.exists());
}
