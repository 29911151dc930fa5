//! What hostile or unlucky input does to the command line: nothing of the user's is lost, nothing waits or grows
//! without bound, nothing is claimed that was not seen, and messages are one line each.
#![allow(clippy::unwrap_used)]

mod diagnosis;
mod disk;
mod effects;
mod eighth;
mod eleventh;
mod fifth;
mod fourth;
mod leftovers;
mod messages;
mod mutations;
mod ninth;
mod output;
mod reading;
mod seventh;
mod seventh_charts;
mod sixth_charts;
mod streams;
mod tenth;
mod third;
mod twelfth;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::device_is_there;

const CAMERA: &str =
    "width = 32\nheight = 24\nfx = 30.0\nfy = 30.0\ncx = 16.0\ncy = 12.0\nframe_period_s = 0.04\n";
const SCENE: &str = "mtllib colours.mtl\no wall\nv 3 -4 -4\nv 3 4 -4\nv 3 4 4\nv 3 -4 4\nv 2 -1 -1\nv 2 1 -1\nv 2 0 1\n\
                     usemtl grey\nf 1 2 3 4\nusemtl red\nf 5 6 7\n";
const MATERIALS: &str = "newmtl grey\nKd 0.4 0.5 0.6\nnewmtl red\nKd 0.6 0.1 0.1\n";

/// The capture that the project brings.
const DEMO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../demo/capture");

/// All candidates but those that a test asks of, as `--without` takes them.
fn all_but(asked: &[&str]) -> String {
    let names = shutterbug_diagnose::diagnose::effect_names();
    names.into_iter().filter(|n| !asked.contains(n)).collect::<Vec<_>>().join(",")
}

/// Copies a folder and all in it.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() { copy(&path, &target) } else { assert!(fs::copy(&path, target).unwrap() > 0) }
    }
}

/// A capture of four frames of 32x24 px: a camera that looks along +x and moves to the side.
struct Capture {
    folder: tempfile::TempDir,
}

impl Capture {
    fn new() -> Self {
        let capture = Self { folder: tempfile::tempdir().unwrap() };
        fs::create_dir(capture.root()).unwrap();
        let poses: String = (-2..12)
            .map(|i| {
                format!("{} 0 {} 0 0.5 -0.5 0.5 -0.5\n", 10.0 + 0.04 * f64::from(i), 0.05 * f64::from(i))
            })
            .collect();
        for (name, text) in [
            ("camera.toml", CAMERA),
            ("scene.obj", SCENE),
            ("colours.mtl", MATERIALS),
            ("trajectory.tum", &poses),
        ] {
            capture.write(name, text);
        }
        capture.write("frames.csv", frames_csv(4));
        capture
    }

    fn root(&self) -> PathBuf {
        self.folder.path().join("capture")
    }

    /// A path beside the capture.
    fn beside(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        let path = self.root().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn simulate(&self, out: &Path, more: &[&str]) -> Output {
        self.command(out, more).output().unwrap()
    }

    fn command(&self, out: &Path, more: &[&str]) -> Command {
        let mut command = shutterbug();
        command.arg("simulate").arg(self.root()).arg("--out").arg(out).args(["--samples", "1"]).args(more);
        command
    }
}

fn frames_csv(count: usize) -> String {
    (0..count).map(|i| format!("{},{i:06}.png\n", 10_000_000_000u64 + 40_000_000 * i as u64)).collect()
}

fn shutterbug() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shutterbug"));
    command.env_remove("RUST_LOG").env_remove("NO_COLOR").stdin(Stdio::null());
    command
}

/// The program under a shell that sets limits or ties streams: `"$0"` is the program.
fn shell(script: &str, arguments: &[&Path]) -> Output {
    let mut command = Command::new("bash");
    command.args(["-c", script, env!("CARGO_BIN_EXE_shutterbug")]).args(arguments).stdin(Stdio::null());
    command.output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[track_caller]
fn assert_done(output: &Output) {
    assert_eq!(output.status.code(), Some(0), "{}", said(output));
}

/// One line of error with all the words, and that exit code.
#[track_caller]
fn assert_refused(output: &Output, code: i32, words: &[&str]) {
    let message = said(output);
    assert_eq!(output.status.code(), Some(code), "{message}");
    for word in words {
        assert!(message.contains(word), "`{word}` is not in: {message}");
    }
    let errors: Vec<_> = message.lines().filter(|l| l.contains("error: ")).collect();
    assert_eq!(errors.len(), 1, "one line is enough: {message}");
}

/// Name and bytes of every file below a folder.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(contents(&path));
        } else {
            found.push((path.clone(), fs::read(&path).unwrap_or_default()));
        }
    }
    found.sort();
    found
}
