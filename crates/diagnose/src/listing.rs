//! Which files a folder holds.

use std::ffi::OsString;
use std::fs;
use std::path::Path;

use shutterbug::error::{Error, Result};

/// Endings of pictures that are read.
pub(crate) const PICTURES: [&str; 3] = ["png", "jpg", "jpeg"];

/// What a folder holds with one of these endings (in small letters), by name. Hidden files are no one's input: macOS
/// puts `._a.png` beside files on other disks.
///
/// # Errors
/// A folder that cannot be listed.
pub(crate) fn ending_with(folder: &Path, endings: &[&str]) -> Result<Vec<OsString>> {
    let is_one = |name: &OsString| {
        let ending = Path::new(name).extension().map(|e| e.to_string_lossy().to_lowercase());
        !name.to_string_lossy().starts_with('.') && ending.is_some_and(|e| endings.contains(&e.as_str()))
    };
    let failed = |e| Error::io(folder, "list", e);
    let names = fs::read_dir(folder).map_err(failed)?.map(|entry| Ok(entry.map_err(failed)?.file_name()));
    let mut names = names.filter(|name| name.as_ref().map_or(true, is_one)).collect::<Result<Vec<_>>>()?;
    names.sort();
    Ok(names)
}
