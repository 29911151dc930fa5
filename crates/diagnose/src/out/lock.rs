//! One run at a time in a folder.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};

use shutterbug::error::{Error, Result};

/// Name of the file in the folder.
pub(super) const LOCK_FILE: &str = ".shutterbug.lock";

/// A folder that this process holds. The system drops the lock with the process, however that ends, so a file that a
/// killed one has left stops nobody.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    file: File,
}

impl Lock {
    /// Takes the folder.
    ///
    /// # Errors
    /// A process that holds it, by its number; a file that cannot be written.
    pub(super) fn take(folder: &Path) -> Result<Self> {
        let path = folder.join(LOCK_FILE);
        loop {
            let mut file = open(&path, true).map_err(|e| Error::io(&path, "write", e))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Err(held(folder, &holder(file))),
                // Some network file systems have no locks: better without than not at all.
                Err(TryLockError::Error(e)) => {
                    tracing::warn!("{}: cannot be locked, so two runs would mix: {e}", folder.display());
                }
            }
            // The one who held it may have removed the file between the two calls.
            if !same_file(&path, &file) {
                continue;
            }
            let pid = std::process::id().to_string();
            let written = file.set_len(0).and_then(|()| file.write_all(pid.as_bytes()));
            written.map_err(|e| Error::io(&path, "write", e))?;
            return Ok(Self { path, file });
        }
    }
}

/// Refuses a folder below one that another run writes to: that run would find files that are not its own. What this
/// process was started by may have made room for it.
///
/// # Errors
/// The nearest such folder, and the process that holds it.
pub(super) fn refuse_below_held(folder: &Path) -> Result<()> {
    for above in folder.ancestors().skip(1) {
        let Ok(file) = open(&above.join(LOCK_FILE), false) else { continue };
        if matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)) {
            let pid = holder(file);
            if !is_parent(&pid) && pid != std::process::id().to_string() {
                return Err(held(above, &pid));
            }
        }
    }
    Ok(())
}

#[cfg(unix)]
fn is_parent(pid: &str) -> bool {
    pid == std::os::unix::process::parent_id().to_string()
}

#[cfg(not(unix))]
fn is_parent(_: &str) -> bool {
    false
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Removed while it is held: who opened it before finds that it is another file now. If the folder was replaced,
        // the one there is another run's.
        if same_file(&self.path, &self.file) {
            let _ = fs::remove_file(&self.path);
        }
        let _ = self.file.unlock();
    }
}

fn open(path: &Path, make: bool) -> std::io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(make).create(make).truncate(false);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NOFOLLOW | libc::O_NONBLOCK);
    options.open(path)
}

#[cfg(unix)]
fn same_file(path: &Path, file: &File) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let number = |m: std::io::Result<fs::Metadata>| m.map(|m| (m.dev(), m.ino())).ok();
    number(path.metadata()) == number(file.metadata())
}

#[cfg(not(unix))]
fn same_file(path: &Path, _: &File) -> bool {
    path.exists()
}

/// The number of the process that holds a lock's file.
fn holder(mut file: File) -> String {
    let mut pid = String::new();
    // What cannot be read is not worth a second error: the folder is held all the same.
    let _ = file.rewind().and_then(|()| file.read_to_string(&mut pid));
    pid.trim().to_owned()
}

fn held(folder: &Path, pid: &str) -> Error {
    let found = format!("a run that is still writing there (process {pid})");
    Error::input(folder, None, found, "a folder of its own for each run, or wait until that one has ended")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_held_by_one_and_what_a_killed_run_left_stops_nobody() {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join(LOCK_FILE), "4194305").expect("written");
        let first = Lock::take(folder.path()).expect("the file is stale: nobody holds it");
        let said = Lock::take(folder.path()).expect_err("held").to_string();
        assert!(said.contains(&format!("process {}", std::process::id())), "{said}");
        drop(first);
        assert!(!folder.path().join(LOCK_FILE).exists());
        Lock::take(folder.path()).expect("free again");
    }
}
