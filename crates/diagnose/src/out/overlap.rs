//! An output must not lie on an input.

use std::path::{Component, Path, PathBuf};

use shutterbug::error::{Error, Result};
use shutterbug::files::identity;

/// Refuses an output folder that is one of the inputs, contains one or lies inside one. Links are followed, and a
/// folder that is mounted twice is one; neither needs to exist.
///
/// # Errors
/// The first input that the folder overlaps.
pub fn refuse_overlap<'a>(out: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let whole = Place::of(out);
    for input in inputs {
        let other = Place::of(input);
        let how = if whole.is(&other) {
            "is"
        } else if whole.lies_below(&other) {
            "lies inside"
        } else if other.lies_below(&whole) {
            "contains"
        } else {
            continue;
        };
        let found = format!("a folder that {how} the input {}", input.display());
        return Err(Error::input(out, None, found, "an --out apart from what is read"));
    }
    Ok(())
}

/// Where a path leads.
struct Place {
    path: PathBuf,
    /// What it is and what the folders above it are, the nearest first.
    identities: Vec<Option<(u64, u64)>>,
}

impl Place {
    fn of(path: &Path) -> Self {
        let path = resolved(path);
        let identities = path.ancestors().map(identity).collect();
        Self { path, identities }
    }

    fn is(&self, other: &Self) -> bool {
        self.path == other.path || (self.identities[0].is_some() && self.identities[0] == other.identities[0])
    }

    fn lies_below(&self, other: &Self) -> bool {
        let folder = other.identities[0];
        self.path.starts_with(&other.path) || (folder.is_some() && self.identities[1..].contains(&folder))
    }
}

/// The path without links, as it will be when the folders of it that do not exist are made: `..` behind one of them
/// leads back.
pub(super) fn resolved(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut at = PathBuf::new();
    for part in absolute.components() {
        match part {
            Component::ParentDir => drop(at.pop()),
            part => {
                at.push(part);
                at = at.canonicalize().unwrap_or(at);
            }
        }
    }
    at
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
            ("new/../cap", "cap", "that is the input"),
            ("new/deep/../../cap/real/../new", "cap", "lies inside"),
            #[cfg(unix)]
            ("link/real/../..", "cap", "contains"),
            #[cfg(unix)]
            ("link/real", "cap", "lies inside"),
        ] {
            assert!(
                said(out, input).is_some_and(|s| s.contains(how)),
                "{out} on {input}: {:?}",
                said(out, input)
            );
        }
        for (out, input) in
            [("capture", "cap"), ("cap2/real", "cap"), ("out", "cap/camera.toml"), ("cap/../out", "cap")]
        {
            assert_eq!(said(out, input), None, "{out} on {input}");
        }
    }

    /// A second mount has another path without links, and the same folders; `/proc/self/fd` is such a path here.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_is_itself_by_any_path() {
        use std::os::fd::AsRawFd as _;
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("cap/real")).expect("made");
        let open = std::fs::File::open(at("cap")).expect("opened");
        let mounted = PathBuf::from(format!("/proc/self/fd/{}", open.as_raw_fd()));
        // As `resolved` leaves a mount: nothing of its path is the capture's.
        let place = |path: PathBuf| Place { identities: path.ancestors().map(identity).collect(), path };
        let (first, second) = (Place::of(&at("cap")), place(mounted.clone()));
        assert!(first.is(&second) && !first.path.starts_with(&second.path));
        assert!(place(mounted.join("real/new")).lies_below(&first));
        assert!(!first.lies_below(&place(mounted.join("real"))));
        assert!(Place::of(&at("cap/real")).lies_below(&second));
        assert!(!Place::of(&at("other")).lies_below(&second) && !Place::of(&at("other")).is(&second));
        assert!(!Place::of(&at("none")).is(&Place::of(&at("nothing"))));
    }
}
