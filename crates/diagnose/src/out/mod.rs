//! The folder of a command's `--out`: it holds only what this program made there ([`Out`]), and its manifest lists the
//! inputs of each file ([`recorded_reads`]).

mod account;
mod lock;
mod manifest;
mod overlap;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, Weak};

use shutterbug::error::{Error, Result};
use shutterbug::files::{Existing, Staged, identity, is_temporary, put, stage};

use lock::{LOCK_FILE, Lock};
use manifest::{Appender, FileLine, Manifest, sync_names};

pub use account::{note_read, record_reads, recorded_reads, sha256_hex};
pub use manifest::MANIFEST_FILE;
pub use overlap::refuse_overlap;

/// How a command uses its folder.
#[derive(Clone, Copy, Debug)]
pub struct OutRules<'a> {
    /// The command's name, as in the manifest.
    pub command: &'static str,
    /// What it reads: files and folders that the output must not overlap. What [`recorded_reads`] has is added.
    pub inputs: &'a [&'a Path],
    /// Write there although the folder holds what no run of this command made there.
    pub overwrite: bool,
    /// Files of an earlier run may stay, and one that is not as it was made is made again.
    pub goes_on: bool,
}

/// A folder that holds only what this program made there, and is held by one process. Nothing in it is touched by
/// opening: behind [`Self::start`] what an earlier run made is removed when the first file of this one is complete,
/// [`Self::go_on`] keeps it. From then on [`shutterbug::files::write_atomic`] names every file below the folder in the
/// manifest.
#[derive(Debug)]
pub struct Out(Arc<Held>);

/// Shared with whoever writes below the folder.
#[derive(Debug)]
struct Held {
    root: PathBuf,
    /// Which folder it is: its path can come to lead to another.
    identity: Option<(u64, u64)>,
    command: &'static str,
    overwrite: bool,
    goes_on: bool,
    state: Mutex<State>,
    /// Whether the folder was not there before.
    made: bool,
    lock: Option<Lock>,
}

#[derive(Debug)]
enum State {
    Opened(Manifest),
    /// Begun, and nothing has appeared yet: what an earlier run made still lies there.
    Begun(Begun),
    Writing {
        appender: Appender,
        /// What an earlier run made, and this one makes again where it is not as it was.
        earlier: BTreeSet<String>,
    },
}

/// A run that has begun, and of which nothing has appeared.
#[derive(Debug, Default)]
struct Begun {
    before: Manifest,
    /// Files are to appear together: those that are complete, with their names and contents' lengths and hashes.
    together: Option<Vec<(String, Staged, FileLine)>>,
}

static OPEN: Mutex<Vec<Weak<Held>>> = Mutex::new(Vec::new());

impl Out {
    /// Takes the folder; makes it if it is absent.
    ///
    /// # Errors
    /// A file or pipe in its place; a folder that overlaps an input; that holds files which its manifest does not name
    /// or which were changed since (unless `overwrite`); that another command made; that another process writes to,
    /// or to one above it; that cannot be read or made.
    pub fn open(root: &Path, rules: &OutRules<'_>) -> Result<Self> {
        account::keep();
        refuse_file(root)?;
        let read = recorded_reads();
        refuse_overlap(root, rules.inputs.iter().copied().chain(read.keys().map(PathBuf::as_path)))?;
        lock::refuse_below_held(&overlap::resolved(root))?;
        // By name alone, before a lock file is put there; again when nobody else can change it.
        check(root, &Manifest::read(root)?.unwrap_or_default(), rules, false)?;
        let made = !root.exists();
        fs::create_dir_all(root).map_err(|e| Error::io(root, "create the folder", e))?;
        let lock = Lock::take(root)?;
        let manifest = Manifest::read(root)?.unwrap_or_default();
        check(root, &manifest, rules, true)?;
        let state = Mutex::new(State::Opened(manifest));
        let held = Arc::new(Held {
            root: root.to_owned(),
            identity: identity(root),
            command: rules.command,
            overwrite: rules.overwrite,
            goes_on: rules.goes_on,
            state,
            made,
            lock: Some(lock),
        });
        let mut open = OPEN.lock().unwrap_or_else(|e| e.into_inner());
        open.retain(|h| h.strong_count() > 0);
        open.push(Arc::downgrade(&held));
        drop(open);
        Ok(Self(held))
    }

    /// Whether the file of that name was made here and is as it was, to the last byte.
    pub fn has(&self, name: &str) -> bool {
        match &*self.0.state() {
            State::Opened(manifest) => manifest.is_whole(&self.0.root, name),
            State::Begun(_) => false,
            State::Writing { appender, .. } => appender.manifest.is_whole(&self.0.root, name),
        }
    }

    /// What an earlier run made, and is as it was, goes when the first file of this one is complete. To be called when
    /// nothing but writing is left that could fail.
    ///
    /// # Errors
    /// A folder that is another one by now.
    pub fn start(&self) -> Result<()> {
        self.begin(None)
    }

    /// As [`Self::start`], but files appear, and what an earlier run made goes, with [`Self::appear`]: a run that
    /// cannot write its second file has not cost the results of the one before.
    ///
    /// # Errors
    /// A folder that is another one by now.
    pub fn start_together(&self) -> Result<()> {
        self.begin(Some(Vec::new()))
    }

    fn begin(&self, together: Option<Vec<(String, Staged, FileLine)>>) -> Result<()> {
        let mut state = self.0.state();
        let State::Opened(before) = &mut *state else { return Ok(()) };
        self.0.check_same()?;
        remove_temporary(&self.0.root);
        *state = State::Begun(Begun { before: std::mem::take(before), together });
        Ok(())
    }

    /// What was written since [`Self::start_together`] appears; from here on every file does when it is written.
    ///
    /// # Errors
    /// Files that cannot be removed or written.
    pub fn appear(&self) -> Result<()> {
        self.0.appear(&mut self.0.state())
    }

    /// Keeps what an earlier run made and is as it was.
    ///
    /// # Errors
    /// A manifest that cannot be written.
    pub fn go_on(&self) -> Result<()> {
        let mut state = self.0.state();
        let State::Opened(before) = &*state else { return Ok(()) };
        self.0.check_same()?;
        remove_temporary(&self.0.root);
        *state = self.0.writing(before, &before.kept(&self.0.root, self.0.command))?;
        Ok(())
    }

    /// Names a file that grows in place, which may be before anything is removed.
    ///
    /// # Errors
    /// A manifest that cannot be written.
    pub fn working(&self, name: &str) -> Result<()> {
        self.0.check_same()?;
        match &mut *self.0.state() {
            State::Writing { appender, .. } => appender.working(name),
            State::Opened(before) | State::Begun(Begun { before, .. }) if before.is_working(name) => Ok(()),
            State::Opened(manifest) | State::Begun(Begun { before: manifest, .. }) => {
                let existing = self.0.existing_manifest(manifest);
                if manifest.command.is_empty() {
                    self.0.command.clone_into(&mut manifest.command);
                }
                let mut appender = manifest.write(&self.0.root, existing)?;
                appender.working(name)?;
                *manifest = appender.manifest;
                Ok(())
            }
        }
    }

    /// To be asked before the user is told that something lies in the folder.
    ///
    /// # Errors
    /// A path that leads to another folder by now, or to none.
    pub fn check_same(&self) -> Result<()> {
        self.0.check_same()
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        drop(self.lock.take());
        if self.made && self.check_same().is_ok() {
            // Of a run that never began nothing is left. A folder that holds something stays.
            let _ = fs::remove_dir(&self.root);
        }
    }
}

impl Held {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// The user may have moved the folder, and made one of their own under its name.
    fn check_same(&self) -> Result<()> {
        if identity(&self.root) == self.identity {
            return Ok(());
        }
        let found =
            "another folder or none: the one that the run began to write to was moved, replaced or removed";
        Err(Error::input(&self.root, None, found, "the folder left in its place until the run has ended"))
    }

    /// Whether a manifest that stands there is a run's.
    fn existing_manifest(&self, before: &Manifest) -> Existing {
        if self.overwrite || !before.command.is_empty() { Existing::Replace } else { Existing::Keep }
    }

    /// Whether a file of that name is a run's, or was given up by the user.
    fn existing(&self, name: &str) -> Existing {
        let ours = match &*self.state() {
            State::Writing { appender, earlier } => {
                appender.manifest.names_file(name) || earlier.contains(name)
            }
            State::Opened(_) => false,
            // It is gone before the new one is put in its place.
            State::Begun(begun) => begun.before.is_whole(&self.root, name),
        };
        if self.overwrite || ours { Existing::Replace } else { Existing::Keep }
    }

    /// Begins to write with the manifest `now`.
    fn writing(&self, before: &Manifest, now: &Manifest) -> Result<State> {
        let appender = now.write(&self.root, self.existing_manifest(before))?;
        let earlier = if self.goes_on { before.names().cloned().collect() } else { BTreeSet::new() };
        Ok(State::Writing { appender, earlier })
    }

    /// Removes what an earlier run made and is as it was; the manifest is this run's from here on.
    fn clear(&self, state: &mut State) -> Result<()> {
        let State::Begun(Begun { before, .. }) = &*state else { return Ok(()) };
        let mut touched = BTreeSet::new();
        for name in before.names().filter(|n| before.is_whole(&self.root, n)) {
            let path = self.root.join(name);
            fs::remove_file(&path).map_err(|e| Error::io(&path, "remove the earlier run's", e))?;
            // The folders that it was in, where that was the last of them.
            let folders = path.ancestors().skip(1).take_while(|f| *f != self.root);
            folders.take_while(|f| fs::remove_dir(f).is_ok()).for_each(drop);
            touched.extend(path.parent().map(Path::to_owned));
        }
        // Gone for good before no line names them any more.
        for folder in touched.iter().filter(|f| f.exists()) {
            sync_names(folder).map_err(|e| Error::io(folder, "write", e))?;
        }
        *state = self.writing(before, &before.emptied(self.command))?;
        Ok(())
    }

    /// Everything that was to appear together does.
    fn appear(&self, state: &mut State) -> Result<()> {
        let State::Begun(begun) = state else { return Ok(()) };
        self.check_same()?;
        let staged = begun.together.take().unwrap_or_default();
        self.clear(state)?;
        let State::Writing { appender, .. } = state else { return Ok(()) };
        let existing = if self.overwrite { Existing::Replace } else { Existing::Keep };
        for (name, file, line) in staged {
            appender.made(&name, line)?;
            file.appear(existing).map_err(|e| self.reason(e))?;
        }
        Ok(())
    }

    /// Puts a file below the folder in place, named.
    fn write(&self, name: &str, path: &Path, bytes: &[u8]) -> Result<()> {
        self.check_same()?;
        self.refuse_links(name)?;
        // The folder of an earlier run's files has gone with them.
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| self.reason(Error::io(folder, "create the folder", e)))?;
        }
        self.keep_changed(name, path)?;
        let existing = self.existing(name);
        if let State::Begun(Begun { together: Some(together), .. }) = &mut *self.state() {
            let staged = stage(path, bytes, existing).map_err(|e| self.reason(e))?;
            together.retain(|(other, ..)| other != name);
            together.push((name.to_owned(), staged, FileLine::of(bytes)));
            return Ok(());
        }
        let written = put(path, bytes, existing, || {
            // Once more, as a large file takes its time.
            self.check_same()?;
            let mut state = self.state();
            self.clear(&mut state)?;
            match &mut *state {
                State::Writing { appender, .. } => appender.made(name, FileLine::of(bytes)),
                // A bug, but none that may cost a file.
                _ => Err(Error::input(path, None, "a write before the run began", "none")),
            }
        });
        written.map_err(|e| self.reason(e))
    }

    /// A file of an earlier run that this one makes again, because it is no longer as it was made, may have been
    /// changed by the user: what stands there is kept under another name.
    fn keep_changed(&self, name: &str, path: &Path) -> Result<()> {
        let mut state = self.state();
        let State::Writing { appender, earlier } = &mut *state else { return Ok(()) };
        let changed = earlier.contains(name) && !appender.manifest.names_file(name);
        // A power cut may leave an empty file, and no other.
        let holds = path.symlink_metadata().is_ok_and(|about| about.is_file() && about.len() > 0);
        if !changed || !holds || self.overwrite {
            return Ok(());
        }
        let names = (1..).map(|n: u32| if n == 1 { "changed".to_owned() } else { format!("changed-{n}") });
        let mut names = names.map(|end| format!("{name}.{end}"));
        let kept = names.find(|kept| self.root.join(kept).symlink_metadata().is_err()).expect("without end");
        appender.working(&kept)?;
        let to = self.root.join(&kept);
        fs::rename(path, &to).map_err(|e| Error::io(path, "rename", e))?;
        tracing::warn!(
            "{}: not as the earlier run made it, so made again; what stood there is now {kept}",
            path.display()
        );
        Ok(())
    }

    /// The folder may be replaced between a check and a write: then that is why the write failed.
    fn reason(&self, error: Error) -> Error {
        self.check_same().err().unwrap_or(error)
    }

    /// A folder that is a link would lead out of the output.
    fn refuse_links(&self, name: &str) -> Result<()> {
        let folders = Path::new(name).ancestors().skip(1).filter(|f| !f.as_os_str().is_empty());
        for folder in folders.map(|f| self.root.join(f)) {
            if folder.symlink_metadata().is_ok_and(|m| !m.is_dir()) {
                return Err(Error::input(&folder, None, "a link", "a folder, or nothing"));
            }
        }
        Ok(())
    }
}

/// The open folder that a path lies below, and its name there.
fn holder(path: &Path) -> Option<(Arc<Held>, String)> {
    let open = OPEN.lock().unwrap_or_else(|e| e.into_inner());
    let held = open.iter().filter_map(Weak::upgrade);
    let below = held.filter_map(|h| Some((name_below(&h.root, path)?, h)));
    below.map(|(name, h)| (h, name)).min_by_key(|(_, name)| name.len())
}

fn name_below(root: &Path, path: &Path) -> Option<String> {
    let name = path.strip_prefix(root).ok()?;
    (!name.as_os_str().is_empty()).then(|| name.to_string_lossy().replace('\\', "/"))
}

/// Makes a folder and those above it, but not in the place of an open one that has gone.
///
/// # Errors
/// A folder that cannot be made; one below an open one whose path leads elsewhere by now.
pub fn make_folder(path: &Path) -> Result<()> {
    let held = holder(path).map(|(held, _)| held);
    held.as_ref().map_or(Ok(()), |h| h.check_same())?;
    let made = fs::create_dir_all(path).map_err(|e| Error::io(path, "create the folder", e));
    made.map_err(|e| match held {
        Some(held) => held.reason(e),
        None => e,
    })
}

/// Names a file below an open folder that grows in place; elsewhere there is no manifest to name it in.
///
/// # Errors
/// A manifest that cannot be written.
pub fn grows(path: &Path) -> Result<()> {
    holder(path).map_or(Ok(()), |(held, name)| Out(held).working(&name))
}

/// Whether a file below an open folder is as this or an earlier run made it, to the last byte; elsewhere nobody knows.
pub fn is_as_made(path: &Path) -> bool {
    holder(path).is_none_or(|(held, name)| Out(held).has(&name))
}

/// Names a folder below an open one that another process fills, with a manifest of its own.
///
/// # Errors
/// A manifest that cannot be written.
pub fn made_elsewhere(path: &Path) -> Result<()> {
    let Some((held, name)) = holder(path) else { return Ok(()) };
    let mut state = held.state();
    held.appear(&mut state)?;
    match &mut *state {
        State::Writing { appender, .. } => appender.folder(&name),
        _ => Ok(()),
    }
}

/// Refuses a path that is, or leads through, something that is no folder.
fn refuse_file(root: &Path) -> Result<()> {
    let there = root.ancestors().find_map(|at| Some((at, fs::metadata(at).ok()?)));
    match there {
        Some((at, about)) if !about.is_dir() => {
            let kind = kind_of(about.file_type());
            let found =
                if at == root { format!("--out naming {kind}") } else { format!("{kind} above --out") };
            Err(Error::input(at, None, found, "a folder: new, empty or an earlier run's"))
        }
        _ => Ok(()),
    }
}

#[cfg(unix)]
fn kind_of(kind: fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt as _;
    if kind.is_fifo() {
        "a pipe"
    } else if kind.is_socket() {
        "a socket"
    } else if kind.is_char_device() || kind.is_block_device() {
        "a device"
    } else {
        "a file"
    }
}

#[cfg(not(unix))]
fn kind_of(_: fs::FileType) -> &'static str {
    "a file"
}

/// Refuses a folder with anything that the manifest does not name; `to_the_byte`: or that is not as it says.
fn check(root: &Path, manifest: &Manifest, rules: &OutRules<'_>, to_the_byte: bool) -> Result<()> {
    if rules.overwrite {
        return Ok(());
    }
    if !manifest.command.is_empty() && manifest.command != rules.command {
        let found = format!("what `{}` made", manifest.command);
        return Err(Error::input(root, None, found, "another --out, or --overwrite"));
    }
    let mut foreign = Vec::new();
    list_foreign(root, "", manifest, (to_the_byte && !rules.goes_on, &mut foreign))?;
    if foreign.is_empty() {
        return Ok(());
    }
    let more = if foreign.len() > 3 { format!(" and {} more", foreign.len() - 3) } else { String::new() };
    let names = foreign.iter().take(3).cloned().collect::<Vec<_>>().join(", ");
    let found = format!("files that no run made there, or that were changed since ({names}{more})");
    Err(Error::input(
        root,
        None,
        found,
        "an --out that is new, empty or an earlier run's alone, or --overwrite",
    ))
}

/// Adds the names, below `root`, of everything that is not the manifest's.
fn list_foreign(
    root: &Path,
    below: &str,
    manifest: &Manifest,
    (to_the_byte, foreign): (bool, &mut Vec<String>),
) -> Result<()> {
    let folder = root.join(below);
    let entries = match fs::read_dir(&folder) {
        Ok(entries) => entries,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(Error::io(&folder, "list", e)),
    };
    for entry in entries {
        let entry = entry.map_err(|e| Error::io(&folder, "list", e))?;
        let kind = entry.file_type().map_err(|e| Error::io(&folder, "list", e))?;
        let last = entry.file_name().to_string_lossy().into_owned();
        let name = if below.is_empty() { last.clone() } else { format!("{below}/{last}") };
        if kind.is_dir() {
            if !manifest.names_folder(&name) {
                list_foreign(root, &name, manifest, (to_the_byte, foreign))?;
            }
            continue;
        }
        let ours = kind.is_file()
            && (last == LOCK_FILE
                || is_temporary(&last)
                || (name == MANIFEST_FILE && !manifest.command.is_empty())
                || manifest.is_working(&name)
                || (manifest.names_file(&name) && (!to_the_byte || manifest.is_whole(root, &name))));
        if !ours {
            foreign.push(name);
        }
    }
    foreign.sort();
    Ok(())
}

/// What runs that were killed have left of files that they were writing.
fn remove_temporary(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let Ok(kind) = entry.file_type() else { continue };
        if kind.is_dir() {
            remove_temporary(&entry.path());
        } else if kind.is_file() && is_temporary(&entry.file_name().to_string_lossy()) {
            // Nothing depends on it: it is in the way of nobody.
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Between the last check and the write itself nothing can be checked.
    #[test]
    fn a_write_that_fails_as_the_folder_has_gone_says_so() {
        let above = tempfile::tempdir().unwrap();
        let root = above.path().join("out");
        let rules = OutRules { command: "test", inputs: &[], overwrite: false, goes_on: false };
        let out = Out::open(&root, &rules).unwrap();
        let refused = || Error::io(&root.join("a.png"), "write", std::io::ErrorKind::NotFound.into());
        assert!(out.0.reason(refused()).to_string().contains("a.png: cannot write"), "control");
        fs::rename(&root, above.path().join("moved")).unwrap();
        assert!(out.0.reason(refused()).to_string().contains("found another folder or none"));
    }
}
