//! File names inside OBJ and MTL files: written on other systems, and not to be trusted.

use std::fs;
use std::path::{Component, Path, PathBuf};

use crate::error::{Error, Result};

/// Where a file name stands, for error messages.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    /// The file that names it.
    pub path: &'a Path,
    /// Its line, from 1.
    pub line: usize,
}

/// The folder that no file may lie outside of.
pub(super) struct Root {
    /// As the caller wrote it: error messages and results use this one.
    shown: PathBuf,
    /// Absolute, without symbolic links.
    canonical: PathBuf,
}

impl Root {
    /// # Errors
    /// A folder that does not exist.
    pub(super) fn new(root: &Path) -> Result<Self> {
        // "" is how `Path::parent` writes the current folder.
        let folder = if root.as_os_str().is_empty() { Path::new(".") } else { root };
        let canonical = folder.canonicalize().map_err(|e| Error::io(folder, "read", e))?;
        Ok(Self { shown: root.to_owned(), canonical })
    }

    /// The canonical form of a file that the caller named.
    ///
    /// # Errors
    /// A file that does not exist or lies outside.
    pub(super) fn enter(&self, path: &Path) -> Result<PathBuf> {
        let canonical = path.canonicalize().map_err(|e| Error::io(path, "read", e))?;
        if !canonical.starts_with(&self.canonical) {
            let found = format!("a file at {}", canonical.display());
            return Err(Error::input(path, None, found, format!("a file inside {}", self.shown.display())));
        }
        Ok(canonical)
    }

    /// Refuses a name that leads to what is there but cannot be read as a file.
    ///
    /// # Errors
    /// A folder, pipe, socket or device; as [`Self::resolve`].
    pub(super) fn refuse_irregular(&self, referrer: &Path, name: &str, place: Place<'_>) -> Result<()> {
        match self.located(referrer, name, place)? {
            Some(path) if !path.is_file() => {
                let what = if path.is_dir() { "a folder" } else { "a pipe, socket or device" };
                let found = format!("`{name}`, which is {what}");
                Err(Error::input(place.path, place.line, found, "a regular file"))
            }
            _ => Ok(()),
        }
    }

    /// The canonical path of the regular file called `name` beside `referrer` (canonical, inside the root); `None` if
    /// there is none. Backslashes separate folders as slashes do. Where the exact name is absent, one that differs in
    /// case only is taken (the first in byte order).
    ///
    /// # Errors
    /// A name that leads outside the root by `..`, by an absolute path, by a drive letter or by a symbolic link,
    /// whether that file exists or not: the answer must not tell what exists outside.
    pub(super) fn resolve(&self, referrer: &Path, name: &str, place: Place<'_>) -> Result<Option<PathBuf>> {
        // A pipe or a device would block or never end.
        Ok(self.located(referrer, name, place)?.filter(|path| path.is_file()))
    }

    /// As [`Self::resolve`], of whatever is there.
    fn located(&self, referrer: &Path, name: &str, place: Place<'_>) -> Result<Option<PathBuf>> {
        let outside = || {
            let found = format!("the path `{}`, which leads outside {}", name, self.shown.display());
            Error::input(place.path, place.line, found, "a file inside the capture's folder")
        };
        let slashed = name.replace('\\', "/");
        let drive = slashed.as_bytes().get(1) == Some(&b':') && slashed.as_bytes()[0].is_ascii_alphabetic();
        let inside = referrer.parent().and_then(|folder| folder.strip_prefix(&self.canonical).ok());
        let start = if slashed.starts_with('/') { Path::new("") } else { inside.ok_or_else(outside)? };
        let wanted = match Path::new(&slashed).strip_prefix(&self.canonical) {
            Ok(below) => lexical(Path::new(""), below),
            Err(_) if drive || slashed.starts_with('/') => None,
            Err(_) => lexical(start, Path::new(&slashed)),
        };
        let Some(found) = self.find(&wanted.ok_or_else(outside)?) else { return Ok(None) };
        let Ok(canonical) = found.canonicalize() else { return Ok(None) };
        if !canonical.starts_with(&self.canonical) {
            return Err(outside());
        }
        Ok(Some(canonical))
    }

    /// How a canonical path inside the root is shown.
    pub(super) fn show(&self, canonical: &Path) -> PathBuf {
        canonical
            .strip_prefix(&self.canonical)
            .map_or_else(|_| canonical.to_owned(), |below| self.shown.join(below))
    }

    fn find(&self, below: &Path) -> Option<PathBuf> {
        let exact = self.canonical.join(below);
        if exact.symlink_metadata().is_ok() {
            return Some(exact);
        }
        let mut at = self.canonical.clone();
        for component in below.components() {
            let exact = at.join(component);
            at = if exact.symlink_metadata().is_ok() { exact } else { same_but_case(&at, component)? };
            // A link to a folder outside must not be searched: its names would tell what exists there.
            if !at.canonicalize().ok()?.starts_with(&self.canonical) {
                return Some(at);
            }
        }
        Some(at)
    }
}

/// `below` walked from `start` without touching the disk; `None` if `..` climbs above the root.
fn lexical(start: &Path, below: &Path) -> Option<PathBuf> {
    let mut walked = start.to_owned();
    for component in below.components() {
        match component {
            Component::Normal(name) => walked.push(name),
            Component::CurDir => {}
            Component::ParentDir => {
                if !walked.pop() {
                    return None;
                }
            }
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(walked)
}

fn same_but_case(folder: &Path, name: Component<'_>) -> Option<PathBuf> {
    let wanted = name.as_os_str().to_str()?.to_lowercase();
    let names = fs::read_dir(folder).ok()?.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    names.filter(|n| n.to_lowercase() == wanted).min().map(|n| folder.join(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_inside_and_refused_outside() {
        let dir = tempfile::tempdir().unwrap();
        let root_path = dir.path().join("capture");
        fs::create_dir_all(root_path.join("Tex")).unwrap();
        for file in ["capture/scene.obj", "capture/Tex/Wood.png", "capture/Tex/wood.png", "secret.png"] {
            fs::write(dir.path().join(file), "x").unwrap();
        }
        let root = Root::new(&root_path).unwrap();
        let obj = root.enter(&root_path.join("scene.obj")).unwrap();
        let place = Place { path: Path::new("scene.obj"), line: 7 };
        let resolve = |name: &str| root.resolve(&obj, name, place);
        let wood = root.canonical.join("Tex/wood.png");
        assert_eq!(resolve(r".\Tex\wood.png").unwrap(), Some(wood.clone()));
        assert_eq!(resolve("tex/WOOD.PNG").unwrap(), Some(root.canonical.join("Tex/Wood.png")));
        assert_eq!(resolve("Tex/../Tex/wood.png").unwrap(), Some(wood.clone()));
        assert_eq!(resolve(wood.to_str().unwrap()).unwrap(), Some(wood));
        assert_eq!(resolve("absent.png").unwrap(), None);
        assert_eq!(resolve("Tex").unwrap(), None, "a folder is no file");
        let secret = dir.path().join("secret.png");
        for bad in [
            "../secret.png",
            "..\\secret.png",
            "Tex/../../absent",
            secret.to_str().unwrap(),
            "/etc/passwd",
            "C:\\x",
        ] {
            let message = resolve(bad).unwrap_err().to_string();
            assert!(message.starts_with("scene.obj:7:") && message.contains(bad), "{message}");
        }
        assert!(root.enter(&secret).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_outside_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let root_path = dir.path().join("capture");
        fs::create_dir_all(root_path.join("in")).unwrap();
        fs::write(dir.path().join("secret.png"), "x").unwrap();
        fs::write(root_path.join("scene.obj"), "x").unwrap();
        fs::write(root_path.join("in/a.png"), "x").unwrap();
        std::os::unix::fs::symlink("../secret.png", root_path.join("link.png")).unwrap();
        std::os::unix::fs::symlink("..", root_path.join("up")).unwrap();
        std::os::unix::fs::symlink("in", root_path.join("also")).unwrap();
        let root = Root::new(&root_path).unwrap();
        let obj = root.enter(&root_path.join("scene.obj")).unwrap();
        let resolve = |name: &str| root.resolve(&obj, name, Place { path: Path::new("scene.obj"), line: 1 });
        for bad in ["link.png", "LINK.PNG", "up/secret.png", "up/SECRET.png", "up/absent.png"] {
            assert!(resolve(bad).is_err(), "{bad}");
        }
        assert!(resolve("also/a.png").unwrap().is_some(), "control: a link that stays inside is followed");
    }
}
