//! What this program made in a folder: `manifest.jsonl`, a line a file, appended before the file appears under its
//! name. A file that stands there and is in no line, or is not as its line says, was not made there by a run.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};

use shutterbug::error::{Error, Result};
use shutterbug::files::{Existing, Limit, put, read_if_there};

use super::account::{recorded_reads, sha256_hex};

/// Name of the manifest in its folder.
pub const MANIFEST_FILE: &str = "manifest.jsonl";

/// A line of the file. The first is `Start`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Line {
    /// The run, and path and SHA-256 of everything that it had read when it began to write.
    Start { shutterbug: String, command: String, arguments: Vec<String>, made_from: BTreeMap<String, String> },
    /// A finished file.
    File { name: String, bytes: u64, sha256: String },
    /// A file that grows while the run goes on.
    Working { working: String },
    /// A folder with a manifest of its own.
    Folder { folder: String },
}

/// What a manifest says.
#[derive(Clone, Debug, Default)]
pub(super) struct Manifest {
    /// The command that made it; empty for a folder without a manifest.
    pub(super) command: String,
    /// Bytes and hash by name. The last line of a name counts, and the one before it: between line and file a run can
    /// be killed.
    files: BTreeMap<String, Vec<(u64, String)>>,
    working: BTreeSet<String>,
    folders: BTreeSet<String>,
}

impl Manifest {
    /// Reads the manifest of a folder; `None` if there is none, or a file of another kind under its name.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(super) fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(MANIFEST_FILE);
        if path.symlink_metadata().is_ok_and(|m| !m.is_file()) {
            return Ok(None);
        }
        let Some(bytes) = read_if_there(&path, Limit::OWN)? else { return Ok(None) };
        let text = String::from_utf8_lossy(&bytes);
        let mut lines = text.split_inclusive('\n').map(serde_json::from_str);
        let Some(Ok(Line::Start { command, .. })) = lines.next() else { return Ok(None) };
        let mut manifest = Self { command, ..Self::default() };
        // A line that was cut off, the last, names nothing.
        lines.flatten().for_each(|line| manifest.add(line));
        Ok(Some(manifest))
    }

    fn add(&mut self, line: Line) {
        match line {
            Line::Start { .. } => {}
            Line::File { name, bytes, sha256 } => {
                let lines = self.files.entry(name).or_default();
                lines.push((bytes, sha256));
                lines.drain(..lines.len().saturating_sub(2));
            }
            Line::Working { working } => drop(self.working.insert(working)),
            Line::Folder { folder } => drop(self.folders.insert(folder)),
        }
    }

    /// Names of the finished files.
    pub(super) fn names(&self) -> impl Iterator<Item = &String> {
        self.files.keys()
    }

    /// Whether a name stands in it at all.
    pub(super) fn names_file(&self, name: &str) -> bool {
        self.files.contains_key(name) || self.working.contains(name)
    }

    /// Whether a folder stands in it that looks after itself.
    pub(super) fn names_folder(&self, name: &str) -> bool {
        self.folders.contains(name)
    }

    /// Whether a file that grows stands in it.
    pub(super) fn is_working(&self, name: &str) -> bool {
        self.working.contains(name)
    }

    /// Whether the file of that name is there and as the manifest says, to the last byte.
    pub(super) fn is_whole(&self, folder: &Path, name: &str) -> bool {
        let (Some(lines), Some(path)) = (self.files.get(name), place(folder, name)) else { return false };
        let Ok(about) = path.symlink_metadata() else { return false };
        if !about.is_file() || !lines.iter().any(|(bytes, _)| *bytes == about.len()) {
            return false;
        }
        // Not by `read`: what was made is no input.
        let Ok(bytes) = std::fs::read(&path) else { return false };
        let sha256 = sha256_hex(&bytes);
        lines.iter().any(|line| line.1 == sha256)
    }

    /// Without finished files: what a new run of `command` starts from.
    pub(super) fn emptied(&self, command: &str) -> Self {
        Self { command: command.to_owned(), files: BTreeMap::new(), ..self.clone() }
    }

    /// With the whole files alone: what a run that goes on starts from.
    pub(super) fn kept(&self, folder: &Path, command: &str) -> Self {
        let mut kept = self.clone();
        kept.command = command.to_owned();
        kept.files.retain(|name, _| self.is_whole(folder, name));
        kept
    }

    /// Writes it, complete, into a folder, and opens it so that lines can be appended. `existing`: of a manifest there.
    pub(super) fn write(&self, folder: &Path, existing: Existing) -> Result<Appender> {
        let path = folder.join(MANIFEST_FILE);
        let files = self.files.iter().flat_map(|(name, lines)| {
            lines.iter().map(|(bytes, sha256)| Line::File {
                name: name.clone(),
                bytes: *bytes,
                sha256: sha256.clone(),
            })
        });
        let working = self.working.iter().map(|w| Line::Working { working: w.clone() });
        let folders = self.folders.iter().map(|f| Line::Folder { folder: f.clone() });
        let lines = std::iter::once(start(&self.command)).chain(files).chain(working).chain(folders);
        let text: String = lines.map(|l| json(&l)).collect();
        put(&path, text.as_bytes(), existing, || Ok(()))?;
        sync_names(folder).map_err(|e| Error::io(&path, "write", e))?;
        let file = OpenOptions::new().append(true).open(&path).map_err(|e| Error::io(&path, "write", e))?;
        Ok(Appender { path, file, manifest: self.clone() })
    }
}

/// Where a name of the manifest lies: below the folder and through no link, or nowhere. A manifest may be a stranger's,
/// and what it names is removed by the next run.
fn place(folder: &Path, name: &str) -> Option<PathBuf> {
    let plain = !name.is_empty() && Path::new(name).components().all(|c| matches!(c, Component::Normal(_)));
    let path = folder.join(name);
    let linked = |f: &Path| f.symlink_metadata().is_ok_and(|about| about.is_symlink());
    let through_link = path.ancestors().skip(1).take_while(|f| *f != folder).any(linked);
    (plain && !through_link).then_some(path)
}

/// Names of files are on the disk when their folder is: lines that are appended to a manifest whose own name is lost in
/// a power cut are lost with it, and the files that they name would be nobody's.
#[cfg(unix)]
pub(super) fn sync_names(folder: &Path) -> std::io::Result<()> {
    match File::open(folder)?.sync_all() {
        // Some network file systems cannot.
        Err(e) if e.kind() == std::io::ErrorKind::InvalidInput => Ok(()),
        done => done,
    }
}

#[cfg(not(unix))]
pub(super) fn sync_names(_: &Path) -> std::io::Result<()> {
    Ok(())
}

fn start(command: &str) -> Line {
    let made_from = recorded_reads().into_iter().map(|(p, hash)| (p.display().to_string(), hash)).collect();
    let arguments = std::env::args_os().skip(1).map(|a| a.to_string_lossy().into_owned()).collect();
    Line::Start {
        shutterbug: env!("CARGO_PKG_VERSION").to_owned(),
        command: command.to_owned(),
        arguments,
        made_from,
    }
}

fn json(line: &Line) -> String {
    serde_json::to_string(line).expect("all keys are strings") + "\n"
}

/// What is noted of a file's contents.
#[derive(Debug)]
pub(super) struct FileLine {
    bytes: u64,
    sha256: String,
}

impl FileLine {
    pub(super) fn of(bytes: &[u8]) -> Self {
        Self { bytes: bytes.len() as u64, sha256: sha256_hex(bytes) }
    }
}

/// A manifest that grows.
#[derive(Debug)]
pub(super) struct Appender {
    path: PathBuf,
    file: File,
    pub(super) manifest: Manifest,
}

impl Appender {
    /// Names a file that is about to appear.
    pub(super) fn made(&mut self, name: &str, FileLine { bytes, sha256 }: FileLine) -> Result<()> {
        self.append(Line::File { name: name.to_owned(), bytes, sha256 })
    }

    /// Names a file that grows.
    pub(super) fn working(&mut self, name: &str) -> Result<()> {
        if self.manifest.is_working(name) {
            return Ok(());
        }
        self.append(Line::Working { working: name.to_owned() })
    }

    /// Names a folder that looks after itself.
    pub(super) fn folder(&mut self, name: &str) -> Result<()> {
        if self.manifest.names_folder(name) {
            return Ok(());
        }
        self.append(Line::Folder { folder: name.to_owned() })
    }

    /// On the disk before the file is: after a power cut nothing lies there that no line names.
    fn append(&mut self, line: Line) -> Result<()> {
        let written = self.file.write_all(json(&line).as_bytes()).and_then(|()| self.file.sync_data());
        written.map_err(|e| Error::io(&self.path, "write", e))?;
        self.manifest.add(line);
        Ok(())
    }
}
