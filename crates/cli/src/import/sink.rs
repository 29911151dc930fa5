//! Collects what the readers of logs find.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::topic::{Encoding, Message, Topic};
use super::unpack::{MAX_BYTES, unpack};
use super::wire::Fault;
use shutterbug::error::Result;

/// Most topics of a recording.
pub(super) const MAX_TOPICS: usize = 65_536;
/// Most faults that are kept; further ones are counted.
const MAX_KEPT_FAULTS: usize = 8;
/// What all that is packed may unpack to: so many times its size, and a few of the largest chunks beside. A dark night
/// packs hundredfold; a file that is made for it a millionfold, and then some KB would take hours.
const MAX_EXPANSION: u64 = 1024;
const EXTRA_UNPACKED_BYTES: u64 = 2 * MAX_BYTES;

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
    /// Where each of them stands: a file can describe as many as it has bytes.
    places: HashMap<Topic, usize>,
    /// Bytes that were packed, and what they unpacked to.
    packed: u64,
    unpacked: u64,
    pub(super) damage: Vec<Damage>,
    pub(super) damages: usize,
    visit: &'a mut Visit<'b>,
    progress: &'a mut Progress<'b>,
    /// Bytes of the files before this one.
    pub(super) before: u64,
}

impl<'a, 'b> Sink<'a, 'b> {
    pub(super) fn new(visit: &'a mut Visit<'b>, progress: &'a mut Progress<'b>) -> Self {
        let (topics, damage) = (Vec::new(), Vec::new());
        let places = HashMap::new();
        Self { topics, places, packed: 0, unpacked: 0, damage, damages: 0, visit, progress, before: 0 }
    }

    /// The place of a topic: that of an earlier one of the same name and type, of another connection or file.
    pub(super) fn topic(&mut self, name: &str, type_name: &str, encoding: Encoding) -> Option<usize> {
        let topic = Topic::new(name, type_name, encoding);
        if let Some(place) = self.places.get(&topic) {
            return Some(*place);
        }
        let place = self.topics.len();
        if place == MAX_TOPICS {
            return None;
        }
        self.places.insert(topic.clone(), place);
        self.topics.push(topic);
        Some(place)
    }

    /// Unpacks a chunk or a message in place of what `into` holds, as [`unpack`] does, and within what the whole
    /// recording may take.
    pub(super) fn unpack(
        &mut self,
        how: &str,
        packed: &[u8],
        stated: Option<u64>,
        into: &mut Vec<u8>,
    ) -> std::result::Result<(), Fault> {
        self.packed += packed.len() as u64;
        let most = EXTRA_UNPACKED_BYTES.saturating_add(self.packed.saturating_mul(MAX_EXPANSION));
        if self.unpacked >= most {
            let found = format!("{} packed bytes that unpack to more than {most}", self.packed);
            return Err(Fault::new(
                found,
                format!("at most {MAX_EXPANSION} times as many, and {EXTRA_UNPACKED_BYTES}"),
            ));
        }
        let done = unpack(how, packed, stated, into);
        self.unpacked += into.len() as u64;
        done
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
        if self.damage.len() < MAX_KEPT_FAULTS {
            let (path, found, expected) = (path.to_owned(), found.into(), expected.into());
            self.damage.push(Damage { path, at, found, expected });
        }
    }
}
