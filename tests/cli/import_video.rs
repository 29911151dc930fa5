//! `shutterbug import` of videos, which the installed ffmpeg decodes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::import_support::{import, last_line, text};

/// Whether ffmpeg is there; a test that needs it says so where it is not.
fn has_ffmpeg(test: &str) -> bool {
    let there =
        |program: &str| Command::new(program).arg("-version").output().is_ok_and(|o| o.status.success());
    let both = there("ffmpeg") && there("ffprobe");
    if !both {
        eprintln!("SKIPPED {test}: ffmpeg and ffprobe are not installed");
    }
    both
}

fn ffmpeg(arguments: &[&str]) {
    let output = Command::new("ffmpeg").args(["-v", "error", "-y"]).args(arguments).output().expect("runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Ten frames, of which two are left out: their times are not even. Without loss.
fn uneven(folder: &Path) -> PathBuf {
    for k in 0..10u8 {
        let value = |x: u32, y: u32| image::Rgb([20 * k, (x * x + 7 * y * y) as u8, 200]);
        image::RgbImage::from_fn(160, 120, value).save(folder.join(format!("{k}.png"))).expect("written");
    }
    let video = folder.join("uneven.mkv");
    let frames = folder.join("%d.png");
    let select = "select='not(eq(n,2)+eq(n,3))'";
    ffmpeg(&[
        "-framerate",
        "25",
        "-start_number",
        "0",
        "-i",
        &text(&frames),
        "-vf",
        select,
        "-vsync",
        "vfr",
        "-c:v",
        "ffv1",
        &text(&video),
    ]);
    video
}

#[test]
fn frames_have_their_own_times() {
    if !has_ffmpeg("frames_have_their_own_times") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (video, out) = (uneven(folder.path()), folder.path().join("out"));
    let (code, listed, _) = import(&[&text(&video)]);
    assert!(code == 0 && listed.contains("ffv1") && listed.contains("160x120, 8 frames"), "{listed}");
    assert!(listed.contains("steps of 40.000 to 120.000 ms"), "{listed}");
    let (code, _, said) = import(&[&text(&video), "--out", &text(&out)]);
    assert_eq!(code, 0, "{said}");
    let frames = fs::read_to_string(out.join("frames.csv")).expect("there");
    let times: Vec<&str> = frames.lines().skip(1).filter_map(|l| l.split(',').next()).collect();
    assert_eq!(
        times,
        ["0", "40000000", "160000000", "200000000", "240000000", "280000000", "320000000", "360000000"]
    );
    let value = |k: usize| {
        image::open(out.join(format!("{k:06}.png"))).expect("there").into_rgb8().as_raw()[..3].to_vec()
    };
    assert_eq!((value(1), value(2)), (vec![20, 0, 200], vec![80, 0, 200]));
}

#[test]
fn a_video_that_breaks_off_gives_the_frames_it_had() {
    if !has_ffmpeg("a_video_that_breaks_off_gives_the_frames_it_had") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (video, out) = (uneven(folder.path()), folder.path().join("out"));
    let bytes = fs::read(&video).expect("there");
    fs::write(&video, &bytes[..bytes.len() * 6 / 10]).expect("written");
    let (code, _, said) = import(&[&text(&video), "--out", &text(&out)]);
    let frames = fs::read_to_string(out.join("frames.csv")).expect("there").lines().count() - 1;
    assert!(code == 1 && (1..8).contains(&frames), "{frames}: {said}");
    let line = last_line(&said);
    assert!(
        line.contains(&format!("a video that breaks off or is damaged, after {frames} frames")),
        "{line}"
    );
    assert!(
        line.contains("what can be read was imported; expected a whole video") && !line.contains("0x"),
        "{line}"
    );
}

#[test]
fn what_is_no_video_or_has_no_ffmpeg_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mp4");
    fs::write(&path, "no video").expect("written");
    let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
    let output = command.args(["import", &text(&path)]).env("PATH", folder.path()).output().expect("runs");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains("no program `ffprobe` on this machine; expected ffmpeg with ffprobe"), "{said}");
    if has_ffmpeg("what_is_no_video_or_has_no_ffmpeg_is_said, its second half") {
        let (code, _, said) = import(&[&text(&path)]);
        assert!(code == 1 && said.contains("no video that ffprobe reads ("), "{said}");
    }
}

/// ffmpeg chooses some readers by a file's name, and these read anything: random bytes are a screen full of characters
/// to them.
#[test]
fn bytes_that_a_name_alone_makes_a_video_are_refused() {
    if !has_ffmpeg("bytes_that_a_name_alone_makes_a_video_are_refused") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let bytes: Vec<u8> = (0..20_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    for name in ["a.bin", "a.xb", "a.idf", "a.ans", "a.nfo", "a.adf"] {
        let path = folder.path().join(name);
        fs::write(&path, &bytes).expect("written");
        let out = folder.path().join(format!("{name}.out"));
        let (code, _, said) = import(&[&text(&path), "--out", &text(&out)]);
        assert!(code == 1 && said.contains("no video") && said.contains("expected MCAP"), "{name}: {said}");
        assert!(!out.join("frames.csv").exists(), "{name}");
    }
    // What is called .txt is read as KITTI's poses.
    let path = folder.path().join("a.txt");
    fs::write(&path, &bytes).expect("written");
    let (code, _, said) = import(&[&text(&path)]);
    assert!(code == 1 && said.contains("not UTF-8"), "{said}");
    let (code, listed, _) = import(&[&text(&uneven(folder.path()))]);
    assert!(code == 0 && listed.contains("8 frames"), "control: {listed}");
}
