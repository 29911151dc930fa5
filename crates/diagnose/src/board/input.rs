//! Which pictures there are, and when each was taken.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::listing::{PICTURES, ending_with};
use shutterbug::capture::{is_plain_name, parse_frames};
use shutterbug::error::{Error, Result};
use shutterbug::files::{Limit, read};

/// Least time from one frame to the next, ns: a million frames a second.
const LEAST_STEP_NS: i64 = 1_000;

/// A picture's file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Where it lies.
    pub path: PathBuf,
    /// Its name there, which it keeps in the capture.
    pub name: String,
}

/// The pictures of a folder by name (of one with `frames.csv`: those in it, in its order), or the files given.
///
/// # Errors
/// A folder without pictures; two pictures of one name; names that a `frames.csv` cannot hold; one that cannot be read.
pub fn pictures(given: &[PathBuf]) -> Result<Vec<Picture>> {
    let paths = match given {
        [folder] if folder.is_dir() => match listed(folder)? {
            Some(entries) => entries.into_iter().map(|(_, name)| folder.join(name)).collect(),
            None => in_folder(folder)?,
        },
        files => files.to_vec(),
    };
    let pictures = paths.into_iter().map(named).collect::<Result<Vec<Picture>>>()?;
    let mut stems: HashMap<&std::ffi::OsStr, &Path> = HashMap::new();
    for picture in &pictures {
        let stem = picture.path.file_stem().unwrap_or_default();
        if let Some(first) = stems.insert(stem, &picture.path) {
            let found = format!("the same name as {}", first.display());
            return Err(Error::input(&picture.path, None, found, "names that differ, endings aside"));
        }
    }
    Ok(pictures)
}

/// A picture by the name that it keeps in the capture: in a line of `frames.csv`.
fn named(path: PathBuf) -> Result<Picture> {
    let fits = |name: &&str| is_plain_name(name.trim_start_matches('.')) && !name.contains('"');
    match path.file_name().and_then(|name| name.to_str()).filter(fits).map(str::to_owned) {
        Some(name) => Ok(Picture { path, name }),
        None => Err(Error::input(
            &path,
            None,
            "a name that cannot stand in a frames.csv",
            "one in UTF-8 without commas, quotes, colons and control characters",
        )),
    }
}

fn in_folder(folder: &Path) -> Result<Vec<PathBuf>> {
    let names = ending_with(folder, &PICTURES)?;
    let paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).filter(|p| p.is_file()).collect();
    if paths.is_empty() {
        return Err(Error::input(folder, None, "no picture", "pictures as .png or .jpg"));
    }
    Ok(paths)
}

/// Lines of the folder's `frames.csv`, if there is one: time in ns and name.
fn listed(folder: &Path) -> Result<Option<Vec<(i64, String)>>> {
    let path = folder.join("frames.csv");
    if !path.is_file() {
        return Ok(None);
    }
    let text = String::from_utf8_lossy(&read(&path, Limit::TABLE)?).into_owned();
    let frames = parse_frames(&path, &text)?;
    Ok(Some(frames.into_iter().map(|f| (f.timestamp_ns, f.filename)).collect()))
}

/// When each picture began, ns: by the folder's `frames.csv`, else at an even rate; nothing where they are stills.
///
/// # Errors
/// A `frames.csv` that cannot be read; a rate beside one.
pub fn times_of(given: &[PathBuf], count: usize, rate_hz: Option<f64>) -> Result<Option<Vec<i64>>> {
    let entries = match given {
        [folder] if folder.is_dir() => listed(folder)?,
        _ => None,
    };
    match (entries, rate_hz) {
        (Some(_), Some(rate_hz)) => {
            let found = format!("{rate_hz} beside {}", given[0].join("frames.csv").display());
            Err(Error::input(Path::new("--fps"), None, found, "one of both"))
        }
        (Some(entries), None) => {
            let times: Vec<i64> = entries.into_iter().map(|(t, _)| t).collect();
            let least = times.windows(2).map(|t| t[1].saturating_sub(t[0])).min().unwrap_or(LEAST_STEP_NS);
            if least < LEAST_STEP_NS {
                let found = format!("frames {least} ns apart");
                let path = given[0].join("frames.csv");
                return Err(Error::input(&path, None, found, "timestamps in ns, in order"));
            }
            Ok(Some(times))
        }
        (None, rate_hz) => {
            Ok(rate_hz.map(|r| (0..count).map(|i| (1e9 * i as f64 / r).round() as i64).collect()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn hidden_files_are_no_pictures() {
        let folder = tempfile::tempdir().expect("a folder");
        let names = || {
            pictures(&[folder.path().to_owned()])
                .map(|all| all.into_iter().map(|p| p.name).collect::<Vec<_>>())
        };
        fs::write(folder.path().join("._a.png"), "").expect("written");
        assert!(names().expect_err("none").to_string().contains("no picture"));
        fs::write(folder.path().join("a.png"), "").expect("written");
        assert_eq!(names().expect("one"), ["a.png"]);
    }
}
