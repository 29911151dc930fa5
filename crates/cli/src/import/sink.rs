//! Where the readers of logs put what they find.

use std::path::{Path, PathBuf};

use super::topic::{Encoding, Message, Topic};
use shutterbug::error::Result;

/// Most topics of a recording.
pub(super) const MOST_TOPICS: usize = 65_536;
/// Most faults that are kept; further ones are counted.
const MOST_FAULTS: usize = 8;

/// A place that could not be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Damage {
    pub(super) path: PathBuf,
    /// Offset in the file, bytes.
    pub(super) at: u64,
    pub(super) found: String,
    pub(super) expected: String,
}

/// Called with all topics so far, and a message.
pub(super) type Visit<'a> = dyn FnMut(&[Topic], &Message<'_>) -> Result<()> + 'a;
/// Called with bytes read so far.
pub(super) type Progress<'a> = dyn FnMut(u64) -> Result<()> + 'a;

/// What a pass over a log found, beside what it was called with.
pub(super) struct Sink<'a, 'b> {
    pub(super) topics: Vec<Topic>,
    pub(super) damage: Vec<Damage>,
    pub(super) damages: usize,
    visit: &'a mut Visit<'b>,
    progress: &'a mut Progress<'b>,
    /// Bytes of the files before this one.
    pub(super) before: u64,
}

impl<'a, 'b> Sink<'a, 'b> {
    pub(super) fn new(visit: &'a mut Visit<'b>, progress: &'a mut Progress<'b>) -> Self {
        Self { topics: Vec::new(), damage: Vec::new(), damages: 0, visit, progress, before: 0 }
    }

    /// The place of a topic: that of an earlier one of the same name and type, of another connection or file.
    pub(super) fn topic(&mut self, name: &str, type_name: &str, encoding: Encoding) -> Option<usize> {
        let topic = Topic::new(name, type_name, encoding);
        if let Some(place) = self.topics.iter().position(|t| *t == topic) {
            return Some(place);
        }
        if self.topics.len() == MOST_TOPICS {
            return None;
        }
        self.topics.push(topic);
        Some(self.topics.len() - 1)
    }

    pub(super) fn message(&mut self, message: &Message<'_>) -> Result<()> {
        (self.visit)(&self.topics, message)
    }

    pub(super) fn progress(&mut self, at: u64) -> Result<()> {
        (self.progress)(self.before + at)
    }

    /// Notes a place that could not be read.
    pub(super) fn damaged(
        &mut self,
        path: &Path,
        at: u64,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) {
        self.damages += 1;
        if self.damage.len() < MOST_FAULTS {
            let (path, found, expected) = (path.to_owned(), found.into(), expected.into());
            self.damage.push(Damage { path, at, found, expected });
        }
    }
}
