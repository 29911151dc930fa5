//! What lies beside the frames of a simulator, and whether it is whole: a folder that is there is meant.

use std::path::Path;

use super::matched::{Matched, stem};
use shutterbug::error::{Error, Result, counted};

/// Checks the folders of planes beside simulated frames; notes on what is not read.
///
/// # Errors
/// `depth/` that is no folder or lacks a frame; `motion/` or `mask/` that is no folder or has none of the frames.
pub(super) fn notes(sim: &Path, real: &Path, matched: &[Matched]) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    for (name, ending, of_all) in [("depth", "exr", true), ("motion", "exr", false), ("mask", "png", false)] {
        let folder = sim.join(name);
        if folder.symlink_metadata().is_err() {
            continue;
        }
        let wanted = |m: &Matched| format!("{}.{ending}", stem(&m.sim));
        let missing: Vec<String> = matched.iter().map(wanted).filter(|n| !folder.join(n).is_file()).collect();
        if !folder.is_dir() || missing.len() == matched.len() || (of_all && !missing.is_empty()) {
            let lacking = missing.first().map_or_else(String::new, |n| format!(" without {n}"));
            let found = if folder.is_dir() { format!("a folder{lacking}") } else { "no folder".to_owned() };
            let expected = format!("one .{ending} a frame, named as the frames; or no {name}/ at all");
            return Err(Error::input(&folder, None, found, expected));
        }
        if name == "mask" && !missing.is_empty() {
            notes.push(format!(
                "mask/ has nothing for {} of {}, {} the first: they are compared as a whole",
                missing.len(),
                counted(matched.len(), "frame", "frames"),
                missing[0]
            ));
        }
    }
    for name in ["depth", "motion", "mask"] {
        if real.join(name).is_dir() {
            let ask = if sim.join(name).is_dir() { "" } else { "; are --sim and --real exchanged?" };
            notes.push(format!(
                "{name}/ beside the real frames is not read: it belongs to the simulated ones{ask}"
            ));
        }
    }
    Ok(notes)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_folder_of_planes_is_whole_or_refused() {
        let at = tempfile::tempdir().expect("a folder");
        let (sim, real) = (at.path().join("sim"), at.path().join("real"));
        fs::create_dir_all(real.join("mask")).expect("made");
        fs::create_dir_all(sim.join("depth")).expect("made");
        let one = |name: &str| Matched { sim: format!("{name}.png"), real: format!("{name}.png") };
        let matched = [one("a"), one("b")];
        let said = || notes(&sim, &real, &matched).map_err(|e| e.to_string());
        assert!(said().expect_err("an empty folder").contains("a folder without a.exr"));
        fs::write(sim.join("depth/a.exr"), "").expect("written");
        assert!(said().expect_err("one is missing").contains("a folder without b.exr"));
        fs::write(sim.join("depth/b.exr"), "").expect("written");
        // Control: whole folders, and a motion that the last frame does not have.
        fs::create_dir(sim.join("motion")).expect("made");
        fs::write(sim.join("motion/a.exr"), "").expect("written");
        let whole = said().expect("whole");
        assert!(whole.len() == 1 && whole[0].starts_with("mask/ beside the real"), "{whole:?}");
        assert!(whole[0].contains("exchanged?"), "the simulated frames have none: {whole:?}");
        fs::create_dir(sim.join("mask")).expect("made");
        fs::write(sim.join("mask/a.png"), "").expect("written");
        let some = said().expect("some masks");
        assert!(some[0].contains("nothing for 1 of 2 frames, b.png the first"), "{some:?}");
        assert!(!some[1].contains("exchanged"), "control: {some:?}");
        fs::remove_dir_all(sim.join("mask")).expect("removed");
        fs::write(sim.join("mask"), "").expect("written");
        assert!(said().expect_err("a file").contains("no folder"));
    }
}
