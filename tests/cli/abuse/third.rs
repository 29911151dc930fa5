//! A third set of bad inputs, on the commands of 2026-11-23: arguments, lens profiles, charts, boards. Recordings are
//! in `import_hostile`.

use super::*;

/// Escape sequences of an argument reach no terminal, not even where colours are forced.
#[test]
fn arguments_steer_no_terminal() {
    for arguments in [
        ["simulate", "x", "--\u{1b}]0;title\u{7}"],
        ["calibrate", "edge", "--region=\u{1b}[2J"],
        ["\u{1b}[2J", "x", "y"],
        ["simulate", "x", "--method=\u{1b}[2J"],
    ] {
        let mut command = shutterbug();
        let output =
            command.args(arguments).env("CLICOLOR_FORCE", "1").env("TERM", "xterm").output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(said(&output).starts_with("error: ") && !said(&output).contains(['\u{1b}', '\u{7}']));
    }
}

/// Help that a full disk swallowed was not printed.
#[test]
fn help_on_a_full_disk_is_an_error() {
    for asked in ["--help", "--version", "simulate --help"] {
        let full = shell(&format!("\"$0\" {asked} > /dev/full"), &[]);
        assert_refused(&full, 1, &["standard output: cannot write"]);
        let gone = shell(&format!("\"$0\" {asked} | true"), &[]);
        assert!(gone.status.success() && said(&gone).is_empty(), "{asked}: {}", said(&gone));
        let printed = shell(&format!("\"$0\" {asked}"), &[]);
        assert!(
            printed.status.success() && printed.stdout.starts_with(b"shutterbug 0") == (asked == "--version")
        );
    }
}

#[test]
fn a_region_of_which_a_part_is_no_number_is_refused() {
    for region in ["1,junk,2,3,4", "1,2,3", "1,2,3,4,5", "1,,2,3,4", "-1,2,30,40"] {
        let mut command = shutterbug();
        command.args(["calibrate", "edge", "a.png", "--out", "b", &format!("--region={region}")]);
        assert_refused(&command.output().unwrap(), 2, &["--region", "left,top,width,height"]);
    }
}

const COLUMNS: &str = "brand,model,lens,setting,width_px,height_px,fps,readout_ms,distortion_model,\
                       fx_px,fy_px,cx_px,cy_px,d1,d2,d3,d4,rms_px,images\n";
const ROW: &str = "A,B,,,64,48,25,8.5,opencv_fisheye,50,50,32,24,0.01,0,0,0,0.5,20\n";

/// One file that cannot be read leaves the others usable.
#[test]
fn one_spoiled_profile_does_not_hide_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    write("a.csv", format!("{COLUMNS}{ROW}").as_bytes());
    write("b.json", &vec![b'x'; 5 << 20]);
    write("c.csv", b"\xff\xfe");
    assert!(Command::new("mkfifo").arg(folder.path().join("LICENSE")).status().unwrap().success());
    std::os::unix::fs::symlink(".", folder.path().join("loop")).unwrap();
    let search = |word: &str| {
        let mut command = shutterbug();
        command.args(["presets", "search", word, "--profiles"]).arg(folder.path()).output().unwrap()
    };
    let output = search("a-b");
    assert_done(&output);
    assert!(String::from_utf8_lossy(&output.stdout).contains("a-b-64x48-25fps\n"), "{output:?}");
    assert!(said(&output).contains("2 entries are no usable profiles, such as: "), "{}", said(&output));
}

/// What a table says beyond what a camera can have is refused where it is read, and not shown as a camera that nothing
/// takes.
#[test]
fn profiles_out_of_range_are_no_presets() {
    let folder = tempfile::tempdir().unwrap();
    let rows = [
        ROW.replace("25,8.5", "1e300,8.5"),
        ROW.replace("25,8.5", "-25,8.5"),
        ROW.replace("50,50", "1e-300,50"),
        ROW.replace("50,50", "50,1e300"),
        ROW.replace("32,24", "32,1e9"),
    ];
    for row in &rows {
        fs::write(folder.path().join("a.csv"), format!("{COLUMNS}{row}{ROW}")).unwrap();
        let mut command = shutterbug();
        let output =
            command.args(["presets", "search", "a-b", "--profiles"]).arg(folder.path()).output().unwrap();
        assert_done(&output);
        assert!(
            said(&output).contains("1 entry is no usable profile,") && said(&output).contains("a.csv:2"),
            "{row}"
        );
        assert_eq!(String::from_utf8_lossy(&output.stdout).lines().count(), 2, "{row}: {output:?}");
    }
}

/// A stranger's words reach the terminal and files as text, and the files can be read again.
#[test]
fn words_of_a_profile_are_text() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let row = ROW.replace("A,B", "\"A\u{1b}[2J\u{b}\u{202e}\",B");
    fs::write(at("a.csv"), format!("{COLUMNS}{row}")).unwrap();
    fs::write(at("LICENSE"), "\u{1b}[2J\u{7}free\u{85}\u{2028}fx = 3").unwrap();
    let presets = |arguments: &[&str]| {
        let mut command = shutterbug();
        let output =
            command.arg("presets").args(arguments).arg("--profiles").arg(folder.path()).output().unwrap();
        assert_done(&output);
        let text = String::from_utf8(output.stdout).unwrap();
        let steers = |c: char| c != '\n' && (c.is_control() || ['\u{202e}', '\u{2028}'].contains(&c));
        assert!(!text.contains(steers), "{text:?}");
        text
    };
    assert!(presets(&["search", "2j"]).contains("A\\u{1b}[2J"));
    fs::write(at("shown.toml"), presets(&["show", "a-2j-b-64x48-25fps"])).unwrap();
    let mut convert = shutterbug();
    assert_done(&convert.args(["camera", "convert", "--to", "ros"]).arg(at("shown.toml")).output().unwrap());
}

/// A camera matrix that is more than a pinhole's is not taken for one.
#[test]
fn what_a_lens_profile_says_is_not_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.json");
    let convert = |matrix: &str, more: &str| {
        let text = format!(
            "{{\"calib_dimension\":{{\"w\":64,\"h\":48}},\"fps\":25,{more}\
             \"fisheye_params\":{{\"camera_matrix\":{matrix},\
             \"distortion_coeffs\":[0.01,0,0,0]}}}}"
        );
        fs::write(&path, text).unwrap();
        shutterbug().args(["camera", "convert", "--to", "toml"]).arg(&path).output().unwrap()
    };
    assert_refused(
        &convert("[[50,0,32],[3,50,24],[0,0,1]]", ""),
        1,
        &["a.json:1", "zeros below the diagonal"],
    );
    assert_refused(
        &convert("[[50,0,32],[0,50,24],[1,1,7]]", ""),
        1,
        &["a.json:1", "zeros below the diagonal"],
    );
    let skewed = convert("[[50,9,32],[0,50,24],[0,0,1]]", "");
    assert_done(&skewed);
    assert!(said(&skewed).contains("the skew 9 px"), "{}", said(&skewed));
    let stretched = convert("[[50,0,32],[0,50,24],[0,0,1]]", "\"input_vertical_stretch\":\"wide\",");
    assert_refused(&stretched, 1, &["input_vertical_stretch", "a factor"]);
    let plain = convert("[[50,0,32],[0,50,24],[0,0,1]]", "");
    assert_done(&plain);
    assert!(!said(&plain).contains("skew"), "control");
}

/// A grey picture of these values.
fn picture(path: &Path, [width, height]: [u32; 2], value: impl Fn(f64, f64) -> f64) {
    image::GrayImage::from_fn(width, height, |x, y| image::Luma([value(f64::from(x), f64::from(y)) as u8]))
        .save(path)
        .unwrap();
}

/// White noise, 0 to 255.
fn noise(x: f64, y: f64, seed: u64) -> f64 {
    mutations::Dice((x as u64) << 32 | (y as u64) << 8 | seed).roll(256) as f64
}

/// The share of a pixel beyond a slanted line, softened.
fn slanted(x: f64, y: f64) -> f64 {
    (0.5 + (x - 80.0 - 0.1 * (y - 60.0)) / 3.0).clamp(0.0, 1.0)
}

/// An edge is measured where there is one, and nothing is told of pictures without.
#[test]
fn pictures_without_an_edge_have_no_sharpness() {
    let folder = tempfile::tempdir().unwrap();
    let photo = folder.path().join("a.png");
    let edge = |value: &dyn Fn(f64, f64) -> f64, more: &[&str]| {
        picture(&photo, [160, 120], value);
        let mut command = shutterbug();
        command.args(["calibrate", "edge", "--overwrite"]).arg(&photo).args(more);
        command.arg("--out").arg(folder.path().join("out")).output().unwrap()
    };
    let round = |x: f64, y: f64| if (x - 80.0).hypot(y - 60.0) < 35.0 { 200.0 } else { 40.0 };
    let bar = |x: f64, y: f64| if (70.0..76.0).contains(&(x - 0.1 * y)) { 200.0 } else { 40.0 };
    assert_refused(&edge(&|x, y| noise(x, y, 1), &[]), 1, &["a.png: found no slanted edge"]);
    assert_refused(&edge(&|x, y| 120.0 + noise(x, y, 1) / 64.0, &[]), 1, &["a.png: found "]);
    assert_refused(
        &edge(&|x, y| noise(x, y, 1), &["--region", "10,10,64,64"]),
        1,
        &["a.png: found no edge, but noise"],
    );
    assert_refused(&edge(&round, &[]), 1, &["a.png: found "]);
    assert_refused(&edge(&bar, &[]), 1, &["a.png: found "]);
    assert_refused(&edge(&|x, y| 60.0 + 400.0 * slanted(x, y), &[]), 1, &["black or white cut them off"]);
    let wide = |x: f64, y: f64| 120.0 + 90.0 * ((x - 80.0 - 0.1 * y) / 40.0).tanh();
    assert_refused(&edge(&wide, &[]), 1, &["px wide, of which no side is in reach"]);
    let control = edge(&|x, y| 60.0 + 120.0 * slanted(x, y), &[]);
    assert_done(&control);
    assert!(String::from_utf8_lossy(&control.stdout).contains("defocus: sigma "), "{control:?}");
}

/// A single step is not three stripes.
#[test]
fn an_edge_is_no_stripe() {
    let folder = tempfile::tempdir().unwrap();
    let photo = folder.path().join("a.png");
    picture(&photo, [160, 120], |x, y| 20.0 + 200.0 * slanted(x, y));
    let out = folder.path().join("out");
    let mut command = shutterbug();
    command.args(["calibrate", "readout", "--led-hz", "100"]).arg(&photo).arg("--out").arg(&out);
    let output = command.output().unwrap();
    assert_done(&output);
    assert!(output.stdout.starts_with(b"no stripes"), "{output:?}");
    assert!(!fs::read_to_string(out.join("camera.toml")).unwrap().contains("readout_time_s"));
}

/// Frames of two scenes have no noise in common.
#[test]
fn the_noise_of_two_scenes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let frame = |name: &str, scene: u64, seed: u64| {
        let path = folder.path().join(name);
        let tile = |x: f64, y: f64| noise((x / 12.0).floor(), (y / 12.0).floor(), scene) / 2.0;
        picture(&path, [320, 240], |x, y| 50.0 + tile(x, y) + noise(x, y, seed) / 40.0);
        path
    };
    let calibrate = |a: &Path, b: &Path| {
        let mut command = shutterbug();
        command.args(["calibrate", "noise", "--overwrite"]).arg(a).arg(b);
        command.arg("--out").arg(folder.path().join("out")).output().unwrap()
    };
    let (first, again, other) = (frame("a.png", 7, 1), frame("b.png", 7, 2), frame("c.png", 8, 3));
    assert_refused(&calibrate(&first, &other), 1, &["c.png: found ", "the static scene of"]);
    assert_done(&calibrate(&first, &again));
}

/// Pictures in which no board fits, and corners that say nothing.
#[test]
fn boards_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = |name: &str, size: [u32; 2]| {
        let path = folder.path().join(name);
        fs::create_dir_all(&path).unwrap();
        (0..5).for_each(|i| picture(&path.join(format!("{i}.png")), size, |x, y| noise(x, y, i)));
        path
    };
    let board = |frames: &Path, more: &[&str]| {
        let mut command = shutterbug();
        command.arg("board").arg(frames).args(["--size", "7x5", "--overwrite"]).args(more);
        command.arg("--out").arg(folder.path().join("out")).output().unwrap()
    };
    for (name, size) in [("dots", [1, 1]), ("lines", [2000, 1]), ("strips", [5000, 9])] {
        let frames = pictures(name, size);
        assert_refused(&board(&frames, &[]), 1, &["in 0 pictures"]);
        assert_refused(&board(&frames, &["--pattern", "charuco"]), 1, &["in 0 pictures"]);
    }
    let frames = pictures("photographs", [320, 240]);
    let corners = folder.path().join("corners.csv");
    let on_a_line =
        |k: usize, i: usize| format!("{k}.png,{},{},{},{}\n", i % 7, i / 7, 10 * (i % 7) + k, 10 * (i % 7));
    fs::write(&corners, (0..5 * 35).map(|i| on_a_line(i / 35, i % 35)).collect::<String>()).unwrap();
    let said = board(&frames, &["--corners", corners.to_str().unwrap()]);
    assert_refused(&said, 1, &["corners that are not where squares meet"]);
    // Of tags that is not asked.
    let of_tags = ["--pattern", "aprilgrid", "--corners", corners.to_str().unwrap()];
    assert_refused(&board(&frames, &of_tags), 1, &["a view whose points lie on a line"]);
}
