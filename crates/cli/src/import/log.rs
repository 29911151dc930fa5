//! A recording of messages: one file or several, of any of the kinds.

use std::fs;
use std::path::{Path, PathBuf};

use super::large::Large;
use super::sink::{Damage, Progress, Sink, Visit};
use super::topic::Topic;
use super::{bag, db3, mcap, sqlite};
use shutterbug::error::{Error, Result};

/// The kinds of logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Mcap,
    Bag,
    Db3,
}

impl Form {
    fn name(self) -> &'static str {
        match self {
            Self::Mcap => "MCAP",
            Self::Bag => "ROS 1 bag",
            Self::Db3 => "ROS 2 bag (SQLite)",
        }
    }
}

/// Endings of the files of a ROS 2 bag's folder.
const ENDINGS: [&str; 2] = ["mcap", "db3"];

/// A recording.
#[derive(Clone, Debug)]
pub(super) struct Log {
    /// What was asked for.
    pub(super) path: PathBuf,
    files: Vec<(PathBuf, Form)>,
    /// Of all files, bytes.
    pub(super) bytes: u64,
}

/// What a pass over all of it found.
#[derive(Clone, Debug, Default)]
pub(super) struct Pass {
    pub(super) topics: Vec<Topic>,
    pub(super) damage: Vec<Damage>,
    /// Of which some are not in the list.
    pub(super) damages: usize,
}

impl Log {
    /// The log that a file or a ROS 2 bag's folder is; nothing if it is none.
    ///
    /// # Errors
    /// Files that cannot be read, or are a log in a form that is not read.
    pub(super) fn open(path: &Path) -> Result<Option<Self>> {
        let names = if path.is_dir() { of_folder(path)? } else { vec![path.to_owned()] };
        let (mut files, mut bytes) = (Vec::new(), 0);
        for name in names {
            let mut file = Large::open(&name)?;
            let Some(form) = form_of(&mut file)? else {
                if path.is_dir() {
                    return Err(Error::input(
                        &name,
                        None,
                        "neither MCAP nor SQLite",
                        "a file of a ROS 2 bag",
                    ));
                }
                return Ok(None);
            };
            bytes += file.bytes();
            files.push((name, form));
        }
        Ok((!files.is_empty()).then(|| Self { path: path.to_owned(), files, bytes }))
    }

    /// What kind of log it is.
    pub(super) fn kind(&self) -> &'static str {
        self.files.first().map_or("", |(_, form)| form.name())
    }

    /// Calls `visit` with each message of each file.
    pub(super) fn each(&self, progress: &mut Progress<'_>, visit: &mut Visit<'_>) -> Result<Pass> {
        let mut sink = Sink::new(visit, progress);
        for (path, form) in &self.files {
            let mut file = Large::open(path)?;
            let bytes = file.bytes();
            match form {
                Form::Mcap => mcap::read(&mut file, &mut sink)?,
                Form::Bag => bag::read(&mut file, &mut sink)?,
                Form::Db3 => db3::read(file, &mut sink)?,
            }
            sink.before += bytes;
        }
        Ok(Pass { topics: sink.topics, damage: sink.damage, damages: sink.damages })
    }
}

/// The files of a folder that one of the readers takes, by name; numbers at their ends as numbers.
fn of_folder(folder: &Path) -> Result<Vec<PathBuf>> {
    let listing = |e| Error::io(folder, "list", e);
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(listing)? {
        let path = entry.map_err(listing)?.path();
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        if ending.is_some_and(|e| ENDINGS.contains(&e.as_str())) && path.is_file() {
            names.push(path);
        }
    }
    names.sort_by_key(|p| (number(p), p.clone()));
    Ok(names)
}

/// 12 for `drive_12.mcap`: files of one bag follow each other so.
fn number(path: &Path) -> u64 {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let digits = stem.bytes().rev().take_while(u8::is_ascii_digit).count();
    stem[stem.len() - digits..].parse().unwrap_or(0)
}

fn form_of(file: &mut Large) -> Result<Option<Form>> {
    let mut head = Vec::new();
    let count = file.bytes().min(16);
    file.take(count, &mut head)?;
    file.seek(0)?;
    if head.starts_with(mcap::MAGIC) {
        return Ok(Some(Form::Mcap));
    }
    if head.starts_with(bag::MAGIC) {
        return Ok(Some(Form::Bag));
    }
    if head.starts_with(sqlite::MAGIC) {
        return Ok(Some(Form::Db3));
    }
    let refused = |found: &str, expected: &str| Err(Error::input(file.path(), None, found, expected));
    if head.starts_with(b"#ROSBAG V") {
        return refused("a ROS bag of another version", "version 2.0 (`rosbag fix` converts)");
    }
    if head.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]) {
        return refused(
            "a file that is packed with zstd as a whole",
            "the file as `zstd -d FILE` unpacks it",
        );
    }
    let ending = file.path().extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if ["mcap", "bag", "db3"].contains(&ending.as_str()) {
        let found =
            if head.is_empty() { "an empty file" } else { "a file that does not begin as its ending says" };
        return refused(found, "MCAP, a ROS 1 bag or a ROS 2 bag in SQLite");
    }
    Ok(None)
}
