//! Files that appear complete or not at all.

use std::fs::{self, File, OpenOptions};
use std::hash::{BuildHasher as _, RandomState};
use std::io::{self, ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use super::read::check_regular;
use super::watch::watcher;
use crate::error::{Error, Result};

/// What becomes of a regular file that stands under the final name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// The new one takes its place.
    Replace,
    /// It stays, and that it is there is an error: also if it appeared a moment ago.
    Keep,
}

/// Writes `bytes` to `path` by way of a temporary file in the same folder; nothing half-written keeps the final name.
/// Asks the [`super::Watcher`] first, where there is one.
///
/// # Errors
/// A file that cannot be written; the temporary file is removed. A folder, pipe, socket or device under the name.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    write_watched(path, bytes, Existing::Replace)
}

fn write_watched(path: &Path, bytes: &[u8], existing: Existing) -> Result<()> {
    let taken_over = watcher().and_then(|w| w.write(path, bytes));
    taken_over.unwrap_or_else(|| put(path, bytes, existing, || Ok(())))
}

/// Writes a single file that the user named. One that is there is replaced only with `overwrite`, and one of `inputs`
/// never.
///
/// # Errors
/// A file that is there or is an input; a link; one that cannot be written.
pub fn write_single(path: &Path, bytes: &[u8], overwrite: bool, inputs: &[PathBuf]) -> Result<()> {
    let same = |input: &PathBuf| {
        let by_name = path.canonicalize().is_ok_and(|p| input.canonicalize().is_ok_and(|i| i == p));
        // Two mounts of one folder give one file two names.
        by_name || identity(path).is_some_and(|p| identity(input) == Some(p))
    };
    if inputs.iter().any(same) {
        return Err(Error::input(path, None, "the input itself", "another file to write"));
    }
    // In its place would be a file, and whoever made the link looks where it led: /dev/stdout may lead to a file.
    if let Ok(target) = fs::read_link(path) {
        let found = format!("a link to {}", target.display());
        return Err(Error::input(path, None, found, "the name of the file itself"));
    }
    write_watched(path, bytes, if overwrite { Existing::Replace } else { Existing::Keep })
}

/// Beginning and end of temporary names.
const TEMPORARY: [&str; 2] = [".shutterbug-", ".partial"];

/// Whether a file is what a run that was killed has left of [`put`].
pub fn is_temporary(name: &str) -> bool {
    let number = name.strip_prefix(TEMPORARY[0]).and_then(|n| n.strip_suffix(TEMPORARY[1]));
    number.is_some_and(|n| n.len() == 16 && n.bytes().all(|b| b.is_ascii_hexdigit()))
}

/// A file that is complete, on the disk, under a temporary name; it goes with this, unless it has been given its own.
#[derive(Debug)]
pub struct Staged {
    path: PathBuf,
    temporary: Option<PathBuf>,
}

/// Writes a file that is not to appear yet. What stands under its name is looked at again by [`Staged::appear`].
///
/// # Errors
/// A file that cannot be written. What stands under the name and is no regular file, or is to be kept.
pub fn stage(path: &Path, bytes: &[u8], existing: Existing) -> Result<Staged> {
    // A pipe or device that is renamed over is gone, and with it what others do through it.
    if let Ok(about) = path.metadata() {
        check_regular(&about, path)?;
    }
    if existing == Existing::Keep && path.symlink_metadata().is_ok() {
        return Err(is_there(path));
    }
    let failed = |e| Error::io(path, "write", e);
    let (temporary, mut file) = create_temporary(path).map_err(failed)?;
    let staged = Staged { path: path.to_owned(), temporary: Some(temporary) };
    // Without this a power cut leaves the final name with nothing behind it, and what it replaces is gone.
    file.write_all(bytes).and_then(|()| file.sync_data()).map_err(failed)?;
    Ok(staged)
}

impl Staged {
    /// Gives the file its name.
    ///
    /// # Errors
    /// A name that cannot be given; what stands there and is to be kept.
    pub fn appear(mut self, existing: Existing) -> Result<()> {
        let temporary = self.temporary.as_ref().expect("it has not appeared");
        give_name(temporary, &self.path, existing)?;
        self.temporary = None;
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if let Some(temporary) = &self.temporary {
            // The first error is the one to report; a leftover that cannot be removed either adds nothing to it.
            let _ = fs::remove_file(temporary);
        }
    }
}

/// Puts a file in place, as [`write_atomic`] without a watcher; `before` is called when it is complete, on the disk,
/// under its temporary name.
///
/// # Errors
/// A file that cannot be written, and what `before` says; the temporary file is removed. What stands under the name and
/// is no regular file, or is to be kept.
pub fn put(path: &Path, bytes: &[u8], existing: Existing, before: impl FnOnce() -> Result<()>) -> Result<()> {
    let staged = stage(path, bytes, existing)?;
    before()?;
    staged.appear(existing)
}

fn is_there(path: &Path) -> Error {
    Error::input(path, None, "a file", "no such file yet, or --overwrite")
}

/// Gives the finished file its name.
fn give_name(temporary: &Path, path: &Path, existing: Existing) -> Result<()> {
    if existing == Existing::Keep {
        // A second name is never put over a first one, unlike the new name of a renamed file.
        match fs::hard_link(temporary, path) {
            // A first name that cannot be removed is removed by the next run.
            Ok(()) => {
                let _ = fs::remove_file(temporary);
                return Ok(());
            }
            Err(e) if e.kind() == ErrorKind::AlreadyExists => return Err(is_there(path)),
            // File systems without second names; another reason keeps the file from being renamed as well.
            Err(_) if path.symlink_metadata().is_ok() => return Err(is_there(path)),
            Err(_) => {}
        }
    }
    fs::rename(temporary, path).map_err(|e| Error::io(path, "write", e))
}

/// What tells one file or folder from all others, whatever its path is: links are followed, and a second mount of a
/// folder makes no difference. `None` for what is not there, and on systems that have nothing of the kind.
#[cfg(unix)]
pub fn identity(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt as _;
    path.metadata().ok().map(|about| (about.dev(), about.ino()))
}

/// As on Unix: nothing.
#[cfg(not(unix))]
pub fn identity(_: &Path) -> Option<(u64, u64)> {
    None
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
        assert!(
            put(&path, b"after", Existing::Replace, full)
                .expect_err("full")
                .to_string()
                .contains("disk full")
        );
        assert_eq!(fs::read_to_string(&path).expect("there"), "before");
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 1);
    }

    #[test]
    #[cfg_attr(miri, ignore = "gives a file a second name")]
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

    /// What appears between the look and the name stays, too.
    #[test]
    #[cfg_attr(miri, ignore = "gives a file a second name")]
    fn a_file_that_appears_while_another_is_written_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.txt");
        let appears = || fs::write(&path, "mine").map_err(|e| Error::io(&path, "write", e));
        let said = put(&path, b"new", Existing::Keep, appears).expect_err("there").to_string();
        assert!(said.contains("a.txt: found a file"), "{said}");
        assert_eq!(fs::read_to_string(&path).expect("there"), "mine");
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 1);
        put(&path, b"new", Existing::Replace, || Ok(())).expect("asked for");
        put(&folder.path().join("b.txt"), b"new", Existing::Keep, || Ok(())).expect("nothing there");
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 2);
    }

    #[cfg(unix)]
    #[test]
    #[cfg_attr(miri, ignore = "starts mkfifo")]
    fn what_is_no_regular_file_is_never_replaced() {
        use std::os::unix::fs::FileTypeExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().expect("runs").success());
        std::os::unix::fs::symlink(at("pipe"), at("link")).expect("linked");
        for (name, what) in [("pipe", "a pipe"), ("link", "a link to"), (".", "a folder")] {
            for overwrite in [true, false] {
                let said = write_single(&at(name), b"new", overwrite, &[]).expect_err("refused").to_string();
                assert!(said.contains(&format!("found {what}")), "{said}");
            }
        }
        assert!(at("pipe").symlink_metadata().expect("there").file_type().is_fifo());
        assert!(at("link").symlink_metadata().expect("there").is_symlink());
    }

    /// `/proc/self/fd` gives a file a second path, as a second mount does.
    #[cfg(target_os = "linux")]
    #[test]
    #[cfg_attr(miri, ignore = "gives a file a second name")]
    fn an_input_is_known_by_any_path() {
        use std::os::fd::AsRawFd as _;
        let folder = tempfile::tempdir().expect("a folder");
        let (first, second) = (folder.path().join("a"), folder.path().join("b"));
        fs::write(&first, "mine").expect("written");
        fs::hard_link(&first, &second).expect("linked");
        let said = write_single(&second, b"new", true, std::slice::from_ref(&first)).expect_err("input");
        assert!(said.to_string().contains("the input itself"));
        let open = File::open(&first).expect("there");
        assert_eq!(identity(&first), identity(Path::new(&format!("/proc/self/fd/{}", open.as_raw_fd()))));
        assert_ne!(identity(&first), identity(folder.path()));
        assert_eq!(identity(&folder.path().join("none")), None);
    }
}
