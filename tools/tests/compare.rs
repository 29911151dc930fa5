//! `tools/compare`: what changed between two commits is told from noise.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

/// Runs it on rounds that were measured before; none without Python.
fn compare(folder: &Path) -> Option<Output> {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("SKIPPED compare: no python3");
        return None;
    }
    let run =
        Command::new("tools/compare").arg("--figures").arg(folder).arg("--fail").current_dir("..").output();
    Some(run.unwrap())
}

/// Rounds of a pass whose time grows by a factor, and of one that does not change. The machine slows down in between,
/// and single runs are off by 3 %.
fn rounds(count: usize, factor: f64) -> TempDir {
    let folder = TempDir::new().unwrap();
    for i in 0..count {
        for (s, (side, by)) in [("old", 1.0), ("new", factor)].into_iter().enumerate() {
            let off = |k: usize| 1.0 + 0.03 * ((i * 7 + k * 5 + s * 11) as f64).sin();
            let slow = 1.0 + i as f64 / 4.0;
            let json = serde_json::json!({
                "device": "a device", "frames": 48,
                "passes": {
                    "gather": [2.0 * slow * by * off(1), 8.0 * slow * by * off(2)],
                    "noise": [3.0 * slow * off(3)],
                },
            });
            std::fs::write(folder.path().join(format!("{i:02}-{side}.json")), json.to_string()).unwrap();
        }
    }
    folder
}

#[test]
fn a_slower_pass_is_told_from_a_slower_machine() {
    let changed = rounds(8, 1.1);
    let Some(run) = compare(changed.path()) else { return };
    let text = String::from_utf8(run.stdout).unwrap();
    assert_eq!(run.status.code(), Some(3), "{text}");
    let row = |name: &str| text.lines().find(|l| l.contains(name)).unwrap().to_owned();
    assert!(row("gather / 0").contains("slower") && row("gather / 1").contains("slower"), "{text}");
    assert!(!row("noise / 0").contains("slower") && !row("noise / 0").contains("faster"), "{text}");
    assert!(!text.contains("frames"), "what is no time is none: {text}");
    assert!(changed.path().join("compare.md").is_file());
    // Control: nothing changed.
    let run = compare(rounds(8, 1.0).path()).unwrap();
    assert_eq!(run.status.code(), Some(0), "{}", String::from_utf8_lossy(&run.stdout));
}

#[test]
fn too_few_rounds_and_broken_ones_are_told() {
    let few = rounds(2, 1.0);
    let Some(run) = compare(few.path()) else { return };
    assert_eq!(run.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&run.stderr).contains("2 whole rounds"), "{:?}", run.stderr);
    let broken = rounds(4, 1.0);
    std::fs::write(broken.path().join("01-old.json"), "{").unwrap();
    let run = compare(broken.path()).unwrap();
    assert!(run.status.code() == Some(1) && String::from_utf8_lossy(&run.stderr).contains("01-old.json"));
}
