//! The one reader of files.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read as _};
use std::path::Path;

use super::watch::watcher;
use crate::error::{Error, Result};

/// The largest file of a kind that is read, bytes. Each is far above what a file of its kind can usefully hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    bytes: u64,
    /// Whether it counts as what a run was made from.
    input: bool,
}

impl Limit {
    /// `camera.toml`, `lights.toml`, a YAML of a camera.
    pub const SETTINGS: Self = Self::of(4 << 20);
    /// Tables a line a frame or pose: `frames.csv`, `trajectory.tum`.
    pub const TABLE: Self = Self::of(1 << 30);
    /// Geometry.
    pub const MODEL: Self = Self::of(1 << 30);
    /// Materials.
    pub const MATERIALS: Self = Self::of(64 << 20);
    /// A picture as it lies on the disk; what it may unfold to is limited by `plane`.
    pub const PICTURE: Self = Self::of(1 << 30);
    /// What this program wrote itself; not noted as read.
    pub const OWN: Self = Self { input: false, ..Self::of(1 << 30) };

    const fn of(bytes: u64) -> Self {
        Self { bytes, input: true }
    }

    /// The limit, bytes.
    pub const fn bytes(self) -> u64 {
        self.bytes
    }
}

/// The whole of a regular file.
///
/// # Errors
/// A missing or unreadable file; a pipe, a device or a folder, which would block or never end; more bytes than `limit`.
pub fn read(path: &Path, limit: Limit) -> Result<Vec<u8>> {
    read_as(path, path, limit)
}

/// As [`read`]; errors call the file `shown`.
///
/// # Errors
/// As [`read`].
pub fn read_as(path: &Path, shown: &Path, limit: Limit) -> Result<Vec<u8>> {
    let failed = |e| Error::io(shown, "read", e);
    let (file, length) = open_regular(path, shown)?;
    check_size(length, shown, limit)?;
    let mut bytes = Vec::with_capacity(length as usize);
    // One byte beyond the limit tells too long from just fitting, also where the file system gives no length.
    file.take(limit.bytes + 1).read_to_end(&mut bytes).map_err(failed)?;
    check_size(bytes.len() as u64, shown, limit)?;
    if limit.input
        && let Some(watcher) = watcher()
    {
        watcher.has_read(shown, &bytes);
    }
    Ok(bytes)
}

/// Whether something has this name. A file that may be absent is read where it has: a folder or a pipe in its place is
/// an error then, and not taken for nothing.
pub fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

/// As [`read`]; `None` if there is no such file.
///
/// # Errors
/// As [`read`], but for a missing file.
pub fn read_if_there(path: &Path, limit: Limit) -> Result<Option<Vec<u8>>> {
    match read(path, limit) {
        Err(Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(None),
        other => other.map(Some),
    }
}

/// `open` returns at once. The one number that is needed of the system's headers; a test opens a pipe with it.
#[cfg(unix)]
const O_NONBLOCK: i32 =
    if cfg!(any(miri, target_arch = "mips", target_arch = "mips64", target_arch = "sparc64")) {
        // Numbered otherwise (Miri does not know it): there a file that turns into a pipe between the two looks at it
        // is waited for.
        0
    } else if cfg!(any(target_os = "linux", target_os = "android")) {
        0o4000
    } else {
        4
    };

/// Opens a regular file to read; with its length, bytes. Errors call it `shown`.
///
/// # Errors
/// A missing or unreadable file; a pipe, a device or a folder, which would block or never end.
pub fn open_regular(path: &Path, shown: &Path) -> Result<(File, u64)> {
    let failed = |e| Error::io(shown, "read", e);
    // Before it is opened: to open a pipe can block for ever, to open a device can have effects.
    check_regular(&path.metadata().map_err(failed)?, shown)?;
    let file = open(path).map_err(failed)?;
    let about = file.metadata().map_err(failed)?;
    check_regular(&about, shown)?;
    Ok((file, about.len()))
}

/// Opens a file to read. It may have become a pipe since it was looked at: opening must not wait for a writer.
fn open(path: &Path) -> std::io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, O_NONBLOCK);
    options.open(path)
}

pub(super) fn check_regular(about: &std::fs::Metadata, shown: &Path) -> Result<()> {
    if about.is_file() {
        return Ok(());
    }
    let found = if about.is_dir() { "a folder" } else { "a pipe, socket or device" };
    Err(Error::input(shown, None, found, "a regular file"))
}

fn check_size(bytes: u64, shown: &Path, limit: Limit) -> Result<()> {
    if bytes <= limit.bytes {
        return Ok(());
    }
    let expected = format!("at most {} bytes in a file of this kind", limit.bytes);
    Err(Error::input(shown, None, format!("more than {} bytes", limit.bytes), expected))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg_attr(miri, ignore = "starts mkfifo")]
    fn what_is_no_regular_file_is_refused_without_waiting() {
        let folder = tempfile::tempdir().expect("a folder");
        let refused = |path: &Path| read(path, Limit::SETTINGS).expect_err("refused").to_string();
        assert!(refused(folder.path()).contains("found a folder; expected a regular file"));
        #[cfg(unix)]
        {
            let pipe = folder.path().join("pipe");
            assert!(std::process::Command::new("mkfifo").arg(&pipe).status().expect("runs").success());
            assert!(refused(&pipe).contains("found a pipe"), "{}", refused(&pipe));
            let link = folder.path().join("zero");
            std::os::unix::fs::symlink("/dev/zero", &link).expect("linked");
            assert!(refused(&link).contains("zero: found a pipe, socket or device"), "{}", refused(&link));
            // The pipe that was a file when it was looked at.
            assert!(!open(&pipe).expect("opened at once").metadata().expect("there").is_file());
        }
        assert!(refused(&folder.path().join("none")).contains("cannot read"));
        assert!(read_if_there(&folder.path().join("none"), Limit::OWN).expect("no error").is_none());
    }

    #[test]
    fn a_file_at_its_limit_is_read_and_one_byte_more_is_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        std::fs::write(&path, [7; 10]).expect("written");
        assert_eq!(read(&path, Limit::of(10)).expect("fits"), [7; 10]);
        let refused = read(&path, Limit::of(9)).expect_err("too long").to_string();
        assert!(refused.contains("more than 9 bytes") && refused.contains("at most 9 bytes"), "{refused}");
    }
}
