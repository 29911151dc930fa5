//! Automatic exposure over the frames of `simulate`.

use std::path::Path;
use std::process::Command;

use crate::gpu_support::device;
use crate::gpu_support::frames::linear;
use shutterbug::plane::{Plane, read_rgb8};

#[test]
fn simulate_exposes_frame_after_frame_however_many_are_in_flight() {
    if device("simulate_exposes_frame_after_frame_however_many_are_in_flight").is_none() {
        return;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../demo");
    let folder = tempfile::tempdir().unwrap();
    let camera = folder.path().join("camera.toml");
    let text = std::fs::read_to_string(root.join("capture/camera.toml")).unwrap();
    let table = "\n[auto_exposure]\ntarget = 0.5\ndelay_frames = 2\nspeed = 0.7\n";
    std::fs::write(&camera, format!("{text}{table}")).unwrap();
    let run = |out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
        command.arg("simulate").arg(root.join("capture")).arg("--out").arg(&out);
        command.arg("--camera").arg(&camera).args(["--samples", "1", "--method", "fast"]).args(more);
        let done = command.output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let mut names: Vec<_> = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().path()).collect();
        names.retain(|p| p.extension().is_some_and(|e| e == "png"));
        names.sort();
        (names.iter().map(|p| read_rgb8(p).unwrap()).collect::<Vec<_>>(), names)
    };
    let (one, names) = run("one", &["--frames-in-flight", "1"]);
    let (four, _) = run("four", &["--frames-in-flight", "4"]);
    assert_eq!(one, four);
    let mean =
        |p: &Plane<u8>| linear(p).data.iter().map(|v| f64::from(*v)).sum::<f64>() / p.data.len() as f64;
    let means: Vec<f64> = one.iter().map(mean).collect();
    eprintln!("means {means:.3?}");
    assert!((means[0] / means[1] - 1.0).abs() < 0.1 && means[2] > 1.2 * means[1], "{means:?}");
    // What an interrupted run has finished is metered from the disk.
    for name in &names[3..] {
        std::fs::remove_file(name).unwrap();
    }
    let (resumed, _) = run("one", &["--resume", "--frames-in-flight", "2"]);
    assert_eq!(resumed, one);
}
