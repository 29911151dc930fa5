//! Who keeps account of files. A library's host has none; the command line has one.

use std::path::Path;
use std::sync::OnceLock;

use crate::error::Result;

/// Is told of every input, and takes over what it answers for of the output.
pub trait Watcher: Sync {
    /// `bytes` were read from the file that errors call `shown`. Not of files that the program wrote itself.
    fn has_read(&self, shown: &Path, bytes: &[u8]);

    /// `bytes` are to appear at `path`, complete or not at all. `None`: not below a folder that is watched, so they are
    /// written as without a watcher.
    fn write(&self, path: &Path, bytes: &[u8]) -> Option<Result<()>>;
}

static WATCHER: OnceLock<&'static dyn Watcher> = OnceLock::new();

/// Names the process's watcher; the first one stays. For a program with one task: a library's host has several.
pub fn set_watcher(watcher: &'static dyn Watcher) {
    let _ = WATCHER.set(watcher);
}

pub(super) fn watcher() -> Option<&'static dyn Watcher> {
    WATCHER.get().copied()
}
