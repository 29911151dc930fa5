//! The twelfth blind set: what charts and cameras say of each other, and inputs that changed between two runs.

use std::fs;

use super::sixth_charts::{Folder, board, boards, told};
use super::{assert_done, assert_refused, shutterbug};

const SIZE: [u32; 2] = [160, 128];

/// 128 lines in 20 ms under a lamp of 500 Hz, with `bars` black lines at the top and at the bottom.
fn light(y: u32, bars: u32) -> f64 {
    light_from(0.0, y, bars)
}

/// The same from another moment of the lamp on, in periods.
fn light_from(start: f64, y: u32, bars: u32) -> f64 {
    let cycles = start + 500.0 * 0.02 / 128.0 * f64::from(y);
    let is_bar = y < bars || y >= SIZE[1] - bars;
    if is_bar { 0.0 } else { 0.4 * (0.05 + if cycles.rem_euclid(1.0) < 0.5 { 1.0 } else { 0.0 }) }
}

fn camera(folder: &Folder, size: [u32; 2], more: &str) -> String {
    let path = folder.path("given.toml");
    let [w, h] = size;
    let text = format!(
        "width = {w}\nheight = {h}\nfx = 100.0\nfy = 100.0\ncx = {}\ncy = {}\nframe_period_s = 0.1\n{more}",
        w / 2,
        h / 2
    );
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn stripes_leave_the_scan_order_that_a_camera_has() {
    let folder = Folder::new();
    let rows = folder.save("rows", SIZE, &|_, y| light(y, 0));
    let columns = folder.save("columns", [SIZE[1], SIZE[0]], &|x, _| light(x, 0));
    let order_of = |photo, camera: Option<&str>| {
        let mut more = vec!["--led-hz", "500"];
        more.extend(camera.iter().flat_map(|c| ["--camera", c]));
        let done = folder.calibrate("readout", &[photo], &more);
        assert_done(&done);
        let written = fs::read_to_string(folder.path("out").join("camera.toml")).unwrap();
        let order = written
            .lines()
            .find_map(|l| l.strip_prefix("scan_order = "))
            .unwrap()
            .trim_matches('"')
            .to_owned();
        assert!(told(&done).contains(&format!("camera.toml has {order}")), "{}", told(&done));
        order
    };
    let table = "[rolling_shutter]\nreadout_time_s = 0.01\nscan_order = \"bottom_to_top\"\n";
    assert_eq!(order_of(rows.clone(), Some(&camera(&folder, SIZE, table))), "bottom_to_top");
    assert_eq!(order_of(rows, None), "top_to_bottom");
    assert_eq!(order_of(columns.clone(), None), "left_to_right");
    let turned = camera(&folder, [SIZE[1], SIZE[0]], table);
    assert_eq!(order_of(columns, Some(&turned)), "left_to_right", "an order of rows is none of columns");
}

#[test]
fn bars_are_no_lines_of_a_sensor_and_a_camera_is_one_of_the_pictures_size() {
    let folder = Folder::new();
    let barred = [("barred", 0.0), ("later", 0.4)]
        .map(|(name, start)| folder.save(name, SIZE, &|_, y| light_from(start, y, 12)));
    let words = ["barred.png: found a black bar: 12 rows at the top, 12 rows at the bottom"];
    assert_refused(&folder.calibrate("readout", &barred, &["--led-hz", "500"]), 1, &words);
    // Control: stripes that are as black are a light's.
    let dark = folder.save("dark", SIZE, &|_, y| (light(y, 0) - 0.02).max(0.0));
    assert_done(&folder.calibrate("readout", std::slice::from_ref(&dark), &["--led-hz", "500"]));
    let other = camera(&folder, [640, 480], "");
    for (command, more) in [("readout", &["--led-hz", "500"][..]), ("edge", &[])] {
        let more = [more, &["--camera", &other]].concat();
        let words = ["dark.png: found a picture of 160x128 px", "640x480 px, as", "given.toml"];
        assert_refused(&folder.calibrate(command, std::slice::from_ref(&dark), &more), 1, &words);
    }
}

#[test]
fn a_picture_of_a_board_that_is_far_worse_is_named() {
    let folder = Folder::new();
    let photos = boards(&folder, "photos", &|_| 1.0);
    let done = board(&folder, &photos, "7x4", &[]);
    assert_done(&done);
    assert!(!told(&done).contains("points are off in"), "control: {}", told(&done));
    // Its lower half lies elsewhere, as behind a puddle or in a glass.
    let path = photos.join("03.png");
    let photo = image::open(&path).unwrap().into_rgb8();
    let moved = image::RgbImage::from_fn(photo.width(), photo.height(), |x, y| {
        let by = if y > photo.height() / 2 { 7 } else { 0 };
        *photo.get_pixel((x + by).min(photo.width() - 1), y)
    });
    moved.save(&path).unwrap();
    let done = board(&folder, &photos, "7x4", &[]);
    assert!(told(&done).contains("WARNING: points are off in 03.png by"), "{}", told(&done));
}

/// Two pictures of a recording as a folder, and one of them another one before the import goes on.
#[test]
fn an_import_goes_on_with_the_same_pictures_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (root, out) = (folder.path().join("in"), folder.path().join("out"));
    fs::create_dir_all(root.join("rgb")).unwrap();
    fs::write(root.join("rgb.txt"), "# color images\n1.0 rgb/a.png\n1.1 rgb/b.png\n").unwrap();
    fs::write(root.join("groundtruth.txt"), "1.0 0 0 0 0 0 0 1\n1.2 0 0 1 0 0 0 1\n").unwrap();
    let picture = |name: &str, value: u8| {
        image::GrayImage::from_pixel(8, 6, image::Luma([value])).save(root.join("rgb").join(name)).unwrap();
    };
    picture("a.png", 10);
    picture("b.png", 20);
    let import = |more: &[&str]| {
        let mut run = shutterbug();
        run.arg("import").arg(&root).arg("--out").arg(&out).args(more).output().unwrap()
    };
    assert_done(&import(&[]));
    assert_done(&import(&["--resume"]));
    picture("b.png", 99);
    assert_refused(
        &import(&["--resume"]),
        1,
        &["import.json", "frames of an import with other input or options"],
    );
    assert_done(&import(&["--overwrite"]));
}

/// A file that may be absent is not taken for absent where a folder has its name.
#[test]
fn a_folder_in_the_place_of_a_file_that_may_be_absent_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("in");
    fs::create_dir_all(root.join("rgb")).unwrap();
    fs::write(root.join("rgb.txt"), "1.0 rgb/a.png\n1.1 rgb/b.png\n").unwrap();
    for name in ["a.png", "b.png"] {
        image::GrayImage::new(8, 6).save(root.join("rgb").join(name)).unwrap();
    }
    let import = |out: &str| {
        shutterbug().arg("import").arg(&root).arg("--out").arg(folder.path().join(out)).output().unwrap()
    };
    assert_done(&import("control"));
    fs::create_dir(root.join("groundtruth.txt")).unwrap();
    assert_refused(&import("out"), 1, &["groundtruth.txt: found a folder; expected a regular file"]);
}

/// A negative number is a value, and the option says what it expects.
#[test]
fn negative_values_are_told_by_their_option() {
    let run = |arguments: &[&str]| shutterbug().args(arguments).output().unwrap();
    let limit = run(&["diagnose", "nowhere", "--out", "out", "--time-limit-s", "-5"]);
    assert_refused(&limit, 2, &["invalid value '-5' for '--time-limit-s"]);
    assert_refused(&run(&["diagnose", "nowhere", "--out", "out", "-5"]), 2, &["unexpected argument '-5'"]);
}
