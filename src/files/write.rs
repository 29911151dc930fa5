//! Files that appear complete or not at all.

use std::fs::{self, File, OpenOptions};
use std::hash::{BuildHasher as _, RandomState};
use std::io::{self, ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use super::watch::watcher;
use crate::error::{Error, Result};

/// Writes `bytes` to `path` by way of a temporary file in the same folder; nothing half-written keeps the final name.
/// Asks the [`super::Watcher`] first, where there is one.
///
/// # Errors
/// A file that cannot be written; the temporary file is removed.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    let taken_over = watcher().and_then(|w| w.write(path, bytes));
    taken_over.unwrap_or_else(|| replace(path, bytes, || Ok(())))
}

/// Writes a single file that the user named. One that is there is replaced only with `overwrite`, and one of `inputs`
/// never.
///
/// # Errors
/// A file that is there or is an input; one that cannot be written.
pub fn write_single(path: &Path, bytes: &[u8], overwrite: bool, inputs: &[PathBuf]) -> Result<()> {
    let same =
        |input: &PathBuf| path.canonicalize().is_ok_and(|p| input.canonicalize().is_ok_and(|i| i == p));
    if inputs.iter().any(same) {
        return Err(Error::input(path, None, "the input itself", "another file to write"));
    }
    if !overwrite && path.symlink_metadata().is_ok() {
        return Err(Error::input(path, None, "a file", "no such file yet, or --overwrite"));
    }
    write_atomic(path, bytes)
}

/// Beginning and end of temporary names.
const TEMPORARY: [&str; 2] = [".shutterbug-", ".partial"];

/// Whether a file is what a run that was killed has left of [`replace`].
pub fn is_temporary(name: &str) -> bool {
    let number = name.strip_prefix(TEMPORARY[0]).and_then(|n| n.strip_suffix(TEMPORARY[1]));
    number.is_some_and(|n| n.len() == 16 && n.bytes().all(|b| b.is_ascii_hexdigit()))
}

/// Puts a file in place, as [`write_atomic`] without a watcher; `before` is called when it is complete, on the disk,
/// under its temporary name. Without that a power cut leaves the final name with nothing behind it, and what it
/// replaces is gone.
///
/// # Errors
/// A file that cannot be written, and what `before` says; the temporary file is removed.
pub fn replace(path: &Path, bytes: &[u8], before: impl FnOnce() -> Result<()>) -> Result<()> {
    let failed = |e| Error::io(path, "write", e);
    let (temporary, mut file) = create_temporary(path).map_err(failed)?;
    let written =
        file.write_all(bytes).and_then(|()| file.sync_data()).map_err(failed).and_then(|()| before());
    written.and_then(|()| fs::rename(&temporary, path).map_err(failed)).inspect_err(|_| {
        // The first error is the one to report; a leftover that cannot be removed either adds nothing to it.
        let _ = fs::remove_file(&temporary);
    })
}

/// A new file beside `path`. `create_new` is O_EXCL: a link that lies in wait under the name is not followed, and two
/// processes never share one.
fn create_temporary(path: &Path) -> io::Result<(PathBuf, File)> {
    loop {
        let name = format!("{}{:016x}{}", TEMPORARY[0], RandomState::new().hash_one(path), TEMPORARY[1]);
        let temporary = path.with_file_name(name);
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            other => return Ok((temporary, other?)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn links_are_replaced_and_what_they_lead_to_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let (elsewhere, path) = (folder.path().join("elsewhere"), folder.path().join("a.txt"));
        fs::write(&elsewhere, "mine").expect("written");
        // The fixed name of earlier versions, and the final one.
        std::os::unix::fs::symlink(&elsewhere, folder.path().join("a.txt.partial")).expect("linked");
        std::os::unix::fs::symlink(&elsewhere, &path).expect("linked");
        write_atomic(&path, b"new").expect("written");
        assert_eq!(fs::read_to_string(&elsewhere).expect("there"), "mine");
        assert_eq!(fs::read_to_string(&path).expect("there"), "new");
        assert!(path.symlink_metadata().expect("there").is_file());
    }

    #[test]
    fn nothing_is_left_of_a_file_that_could_not_be_completed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.txt");
        fs::write(&path, "before").expect("written");
        let full = || Err(Error::io(&path, "write", io::Error::other("disk full")));
        assert!(replace(&path, b"after", full).expect_err("full").to_string().contains("disk full"));
        assert_eq!(fs::read_to_string(&path).expect("there"), "before");
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 1);
    }

    #[test]
    fn a_single_file_is_replaced_only_when_asked_and_an_input_never() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("camera.toml");
        write_single(&path, b"one", false, &[]).expect("new");
        assert!(
            write_single(&path, b"two", false, &[]).expect_err("there").to_string().contains("--overwrite")
        );
        let own = [folder.path().join(".").join("camera.toml")];
        assert!(
            write_single(&path, b"two", true, &own)
                .expect_err("input")
                .to_string()
                .contains("the input itself")
        );
        assert_eq!(fs::read(&path).expect("there"), b"one");
        write_single(&path, b"two", true, &[]).expect("asked for");
        assert_eq!(fs::read(&path).expect("there"), b"two");
    }
}
