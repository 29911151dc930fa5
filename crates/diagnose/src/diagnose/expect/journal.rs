//! What a diagnosis has worked out so far, on disk, so that an interrupted one goes on: every fit under all that it
//! depends on. A diagnosis that starts again with the same input asks for the same things in the same order; what
//! stands in the journal is taken from there, to the last bit, and the rest is worked out as it would have been.
//!
//! A file of lines of JSON: first the key of the input, then steps (for people) and results. Lines are appended; one
//! that was cut off is dropped. A journal of other input, options, device or program is started anew.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::model::{P, Theta};
use super::options::DiagnoseOptions;
use crate::diagnose::evidence::Evidence;
use shutterbug::capture::Capture;
use shutterbug::chain::Settings;
use shutterbug::error::{Error, Result};
use shutterbug::files::{self, Limit};

/// One line of the file.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Line {
    Start { shutterbug: String, key: String },
    Step { stage: String, what: String, step: usize, steps: usize },
    Result { kind: String, key: String, value: serde_json::Value },
}

/// See the module.
#[derive(Default)]
pub(crate) struct Journal {
    file: Option<(PathBuf, fs::File)>,
    known: HashMap<(String, String), serde_json::Value>,
    stop: Option<Arc<AtomicBool>>,
    at: String,
    /// Results that an earlier run has left.
    pub(crate) found: usize,
}

impl Journal {
    /// Opens the journal that the options name, or one that is kept nowhere.
    ///
    /// # Errors
    /// A file that cannot be read or written.
    pub(crate) fn open(options: &DiagnoseOptions, key: impl FnOnce() -> String) -> Result<Self> {
        let mut journal = Self { stop: options.stop.clone(), ..Self::default() };
        let Some(path) = &options.journal else { return Ok(journal) };
        let key = key();
        let whole = journal.read(path, &key)?;
        let failed = |e| Error::io(path, "write", e);
        let mut how = fs::OpenOptions::new();
        how.create(true).write(true).truncate(!whole).append(false);
        // `--overwrite` does not look at what is there: a link must not lead out.
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::custom_flags(&mut how, libc::O_NOFOLLOW);
        let mut file = how.open(path).map_err(failed)?;
        if whole {
            use std::io::Seek as _;
            file.seek(std::io::SeekFrom::End(0)).map_err(failed)?;
        } else {
            let start = Line::Start { shutterbug: env!("CARGO_PKG_VERSION").to_owned(), key };
            let lines = journal.known.iter().map(|((kind, key), value)| Line::Result {
                kind: kind.clone(),
                key: key.clone(),
                value: value.clone(),
            });
            for line in std::iter::once(start).chain(lines) {
                let text = serde_json::to_string(&line).expect("all keys are strings") + "\n";
                file.write_all(text.as_bytes()).map_err(failed)?;
            }
        }
        journal.found = journal.known.len();
        journal.file = Some((path.clone(), file));
        Ok(journal)
    }

    /// Reads what is there; whether lines may simply be appended.
    fn read(&mut self, path: &Path, key: &str) -> Result<bool> {
        let Some(bytes) = files::read_if_there(path, Limit::OWN)? else { return Ok(false) };
        let text = String::from_utf8_lossy(&bytes);
        let mut lines = text.split_inclusive('\n');
        match lines.next().map(serde_json::from_str) {
            Some(Ok(Line::Start { key: there, .. })) if there == key => {}
            _ => return Ok(false),
        }
        for line in lines {
            match serde_json::from_str(line) {
                Ok(Line::Result { kind, key, value }) if line.ends_with('\n') => {
                    self.known.insert((kind, key), value);
                }
                Ok(Line::Step { .. }) if line.ends_with('\n') => {}
                _ => return Ok(false),
            }
        }
        Ok(true)
    }

    /// A step begins.
    ///
    /// # Errors
    /// A file that cannot be written; see [`Self::go_on`].
    pub(crate) fn step(&mut self, stage: &str, what: &str, step: usize, steps: usize) -> Result<()> {
        self.at = format!("{stage}: {what}");
        self.append(&Line::Step { stage: stage.to_owned(), what: what.to_owned(), step, steps })?;
        self.go_on()
    }

    /// Nothing, as long as nobody asked to stop.
    ///
    /// # Errors
    /// [`Error::DiagnosisInterrupted`].
    pub(crate) fn go_on(&self) -> Result<()> {
        if !self.stop.as_ref().is_some_and(|s| s.load(Ordering::SeqCst)) {
            return Ok(());
        }
        Err(Error::DiagnosisInterrupted {
            at: if self.at.is_empty() { "the beginning".to_owned() } else { self.at.clone() },
            kept: self.file.as_ref().map(|f| f.0.clone()),
        })
    }

    /// What stands under a key, if it can be read.
    pub(crate) fn recall<T: DeserializeOwned>(&self, kind: &str, key: &str) -> Option<T> {
        let value = self.known.get(&(kind.to_owned(), key.to_owned()))?;
        serde_json::from_value(value.clone()).ok()
    }

    /// Notes a result.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn note(&mut self, kind: &str, key: &str, value: &impl Serialize) -> Result<()> {
        let value = serde_json::to_value(value).expect("plain data");
        // What is asked for twice gets one answer, in this run as in the one that goes on.
        self.known.insert((kind.to_owned(), key.to_owned()), value.clone());
        self.append(&Line::Result { kind: kind.to_owned(), key: key.to_owned(), value })
    }

    fn append(&mut self, line: &Line) -> Result<()> {
        let Some((path, file)) = &mut self.file else { return Ok(()) };
        let text = serde_json::to_string(line).expect("all keys are strings") + "\n";
        // One call a line, so that no other end than the last line's is ever cut off.
        file.write_all(text.as_bytes()).map_err(|e| Error::io(path, "write", e))
    }
}

/// Reads a journal of `key` as a diagnosis that goes on does, each result as a fit, and takes that for a camera's; how
/// many fits there are. For tests that spoil one.
///
/// # Errors
/// A file that cannot be read, or that holds no fit.
#[doc(hidden)]
pub fn read_journal(path: &Path, key: &str) -> Result<usize> {
    let mut journal = Journal::default();
    journal.read(path, key)?;
    let mut usable = 0;
    for (kind, key) in journal.known.keys() {
        if let Some(fit) = journal.recall::<super::fitted::Fit>(kind, key) {
            usable += 1;
            let _ = (
                fit.theta.bits(),
                super::settings::lens(&fit.theta),
                super::settings::settings_of(&fit.theta),
            );
            let mut settings = Settings::default();
            // A value out of its range is an error there.
            let _ = super::settings::apply(
                &mut settings,
                &fit.theta,
                &["gamma", "rolling_shutter", "motion_blur"],
            );
        }
    }
    let none =
        || Error::input(path, None, "no fit that can be gone on with", "lines of JSON of the same run");
    (usable > 0).then_some(usable).ok_or_else(none)
}

/// A journal of `key` with a step and a fit.
#[doc(hidden)]
pub fn example_of_a_journal(key: &str) -> String {
    let fit = super::fitted::Fit {
        theta: Theta::neutral().with(P::Readout, 0.02),
        half: [(P::Readout, 0.001)].into(),
    };
    let lines = [
        Line::Start { shutterbug: env!("CARGO_PKG_VERSION").to_owned(), key: key.to_owned() },
        Line::Step { stage: "each candidate alone".to_owned(), what: "gamma".to_owned(), step: 1, steps: 24 },
        Line::Result {
            kind: "fit".to_owned(),
            key: "[0, 2]".to_owned(),
            value: serde_json::to_value(&fit).expect("plain data"),
        },
    ];
    lines.iter().map(|l| serde_json::to_string(l).expect("all keys are strings") + "\n").collect()
}

/// Everything that the results depend on, as SHA-256: the program, the device, options, camera, scene, paths, frames.
pub(crate) fn key(device: &str, capture: &Capture, evidence: &Evidence, options: &DiagnoseOptions) -> String {
    let mut hash = Hash(Sha256::new());
    let mut without = options.without.clone();
    without.sort();
    let said = "a hash takes any text";
    write!(hash, "{} {} {} ", program(), device, options.seed).expect(said);
    write!(hash, "{} {} ", options.scene_exact, options.poses_exact).expect(said);
    write!(hash, "{without:?} {:?} {:?} {:?} ", capture.camera, capture.frames, capture.trajectory)
        .expect(said);
    write!(hash, "{:?} {:?} {:?} {:?} ", capture.scene, evidence.fit, evidence.choose, evidence.report)
        .expect(said);
    for frame in &evidence.frames {
        write!(hash, "{} {} ", frame.index, frame.start_s).expect(said);
        hash.0.update(bytemuck::cast_slice(&frame.dn.data));
    }
    hash.0.finalize().iter().map(|b| format!("{b:02x}")).collect()
}

/// Version, size and time of this program: another build may work out other results.
fn program() -> String {
    let about = std::env::current_exe().and_then(fs::metadata);
    let about = about.and_then(|m| Ok((m.len(), m.modified()?)));
    format!("{} {:?}", env!("CARGO_PKG_VERSION"), about.ok())
}

struct Hash(Sha256);

impl std::fmt::Write for Hash {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(path: &Path, key: &str) -> Journal {
        let options = DiagnoseOptions { journal: Some(path.to_owned()), ..DiagnoseOptions::default() };
        Journal::open(&options, || key.to_owned()).unwrap_or_else(|e| panic!("{e}"))
    }

    #[test]
    fn results_come_back_bit_for_bit_and_only_for_the_same_input() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("j");
        let values = vec![0.1 + 0.2, 1.0 / 3.0, 5e-324, -1.797e308];
        let mut journal = open(&path, "one");
        journal.step("stage", "what", 1, 2).expect("written");
        journal.note("fit", "a", &values).expect("written");
        journal.note("fit", "b", &f64::NAN).expect("written");
        drop(journal);
        let mut again = open(&path, "one");
        assert_eq!((again.found, again.recall::<Vec<f64>>("fit", "a")), (2, Some(values.clone())));
        assert_eq!(again.recall::<f64>("fit", "b"), None, "what JSON cannot say is worked out again");
        assert_eq!(again.recall::<Vec<f64>>("score", "a"), None);
        assert_eq!(again.recall::<Vec<f64>>("fit", "c"), None);
        again.note("fit", "c", &1.5).expect("written");
        drop(again);
        // The last line is cut off: it is dropped, the others stay, and the file can be gone on with.
        let bytes = fs::read(&path).expect("there");
        fs::write(&path, &bytes[..bytes.len() - 4]).expect("written");
        let mut cut = open(&path, "one");
        assert_eq!((cut.found, cut.recall::<f64>("fit", "c")), (2, None));
        assert_eq!(cut.recall::<Vec<f64>>("fit", "a"), Some(values));
        cut.note("fit", "d", &2.5).expect("written");
        drop(cut);
        assert_eq!(open(&path, "one").recall::<f64>("fit", "d"), Some(2.5));
        // Control: another key finds nothing, and what was there is gone.
        assert_eq!(open(&path, "two").found, 0);
        assert_eq!(open(&path, "one").found, 0);
        fs::write(&path, "no journal at all").expect("written");
        assert_eq!(open(&path, "one").found, 0);
    }

    #[test]
    fn a_stop_is_an_error_that_says_where_and_what_is_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let stop = Arc::new(AtomicBool::new(false));
        let path = folder.path().join("j");
        let options = DiagnoseOptions {
            journal: Some(path.clone()),
            stop: Some(stop.clone()),
            ..DiagnoseOptions::default()
        };
        let mut journal = Journal::open(&options, String::new).expect("opened");
        journal.step("each candidate alone", "gamma", 3, 24).expect("nobody asked to stop");
        stop.store(true, Ordering::SeqCst);
        let said = journal.go_on().expect_err("stopped").to_string();
        assert!(said.contains("gamma") && said.contains("same command") && said.contains("j"), "{said}");
        let nowhere = DiagnoseOptions { journal: None, ..options };
        let said =
            Journal::open(&nowhere, String::new).expect("opened").go_on().expect_err("stopped").to_string();
        assert!(!said.contains("same command"), "nothing is kept: {said}");
    }
}
