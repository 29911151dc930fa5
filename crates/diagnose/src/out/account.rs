//! What this process reads and writes: for the manifest.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use sha2::Digest as _;
use shutterbug::error::Result;
use shutterbug::files::{Watcher, set_watcher};

use super::holder;

/// SHA-256 as 64 hexadecimal digits.
pub fn sha256_hex(bytes: &[u8]) -> String {
    sha2::Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

/// Path as errors show it, and SHA-256, of every file that was read since [`record_reads`].
static READ: Mutex<Option<BTreeMap<PathBuf, String>>> = Mutex::new(None);

/// From now on, every file that this process reads is noted with its hash: what a run was made from is what it read,
/// not a list that must be kept in step with the readers. For a program with one task; a library's host has several.
pub fn record_reads() {
    *READ.lock().unwrap_or_else(|e| e.into_inner()) = Some(BTreeMap::new());
    keep();
}

/// Path and SHA-256 (hexadecimal) of what was read since [`record_reads`], sorted; nothing if that was not called.
pub fn recorded_reads() -> BTreeMap<PathBuf, String> {
    READ.lock().unwrap_or_else(|e| e.into_inner()).clone().unwrap_or_default()
}

/// Notes a file that was read piece by piece, with what tells it from others.
pub fn note_read(shown: &Path, mark: String) {
    if let Some(read) = READ.lock().unwrap_or_else(|e| e.into_inner()).as_mut() {
        read.insert(shown.to_owned(), mark);
    }
}

/// From now on, what is written below an open folder is named in its manifest.
pub(super) fn keep() {
    set_watcher(&Account);
}

/// The process's account of files.
struct Account;

impl Watcher for Account {
    fn has_read(&self, shown: &Path, bytes: &[u8]) {
        if let Some(read) = READ.lock().unwrap_or_else(|e| e.into_inner()).as_mut() {
            read.insert(shown.to_owned(), sha256_hex(bytes));
        }
    }

    fn write(&self, path: &Path, bytes: &[u8]) -> Option<Result<()>> {
        let (holder, name) = holder(path)?;
        Some(holder.write(&name, path, bytes))
    }
}
