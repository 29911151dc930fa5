//! An output must not lie on an input.

use std::path::{Path, PathBuf};

use shutterbug::error::{Error, Result};

/// Refuses an output folder that is one of the inputs, contains one or lies inside one. Links are followed; neither
/// needs to exist.
///
/// # Errors
/// The first input that the folder overlaps.
pub fn refuse_overlap<'a>(out: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let whole = resolved(out);
    for input in inputs {
        let other = resolved(input);
        let how = if whole == other {
            "is"
        } else if whole.starts_with(&other) {
            "lies inside"
        } else if other.starts_with(&whole) {
            "contains"
        } else {
            continue;
        };
        let found = format!("a folder that {how} the input {}", input.display());
        return Err(Error::input(out, None, found, "an --out apart from what is read"));
    }
    Ok(())
}

/// The path without links: of what does not exist yet, that of the nearest folder that does.
fn resolved(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut missing = Vec::new();
    let mut at = absolute.as_path();
    loop {
        if let Ok(found) = at.canonicalize() {
            return missing.iter().rev().fold(found, |folder, name| folder.join(name));
        }
        let (Some(parent), Some(name)) = (at.parent(), at.file_name()) else { return absolute };
        missing.push(name);
        at = parent;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_overlaps_is_told_from_what_only_looks_alike() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("cap/real")).expect("made");
        std::fs::write(at("cap/camera.toml"), "").expect("written");
        #[cfg(unix)]
        std::os::unix::fs::symlink(at("cap"), at("link")).expect("linked");
        let said = |out: &str, input: &str| {
            let input = at(input);
            refuse_overlap(&at(out), [input.as_path()]).err().map(|e| e.to_string())
        };
        for (out, input, how) in [
            ("cap", "cap", "that is the input"),
            ("cap/real", "cap", "lies inside"),
            ("cap/new/deep", "cap", "lies inside"),
            ("cap", "cap/camera.toml", "contains"),
            (".", "cap", "contains"),
            #[cfg(unix)]
            ("link/real", "cap", "lies inside"),
        ] {
            assert!(
                said(out, input).is_some_and(|s| s.contains(how)),
                "{out} on {input}: {:?}",
                said(out, input)
            );
        }
        for (out, input) in [("capture", "cap"), ("cap2/real", "cap"), ("out", "cap/camera.toml")] {
            assert_eq!(said(out, input), None, "{out} on {input}");
        }
    }
}
