//! What a diagnosis is asked to consider, and who is told how far it is.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::model::{all_names, candidate_of, moves};
use super::room::SURFACES;
use shutterbug::error::{Error, Result};

/// What to consider.
#[derive(Clone, Debug, Default)]
pub struct DiagnoseOptions {
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Candidates to leave out, by name: for checks that an effect outside the list is not sold as one inside it.
    pub without: Vec<String>,
    /// Whether surfaces are exactly as bright as the scene says: else factors of theirs are a candidate.
    pub scene_exact: bool,
    /// Whether poses are exact: else errors of theirs are a candidate.
    pub poses_exact: bool,
    /// When to come to an end with what is known by then; candidates that were not reached are `undetermined`.
    pub time_limit: Option<Duration>,
    /// Since when that counts: since the call, or since a program began to read what it gives.
    pub begun: Option<Instant>,
    /// Where to keep what has been worked out; a diagnosis that was stopped goes on from there.
    pub journal: Option<PathBuf>,
    /// Of folders that are not paired: a command with `{a}` and `{b}` in the places of two folders of pictures, which
    /// prints a distance.
    pub distance: Option<String>,
    /// Ends the diagnosis with [`Error::DiagnosisInterrupted`] soon after it becomes true.
    pub stop: Option<Arc<AtomicBool>>,
}

impl DiagnoseOptions {
    /// What of the description may be wrong. Photographs of a camera at rest have poses and light of their own.
    pub(crate) fn description(&self, at_rest: bool) -> Vec<&'static str> {
        let exact = |n: &&str| if *n == SURFACES { self.scene_exact } else { self.poses_exact };
        super::room::NAMES.into_iter().filter(|n| !at_rest && !exact(n)).collect()
    }
}

/// Told where a diagnosis stands: the stage, the candidate, and which of how many steps of the stage it is.
pub trait Progress {
    /// A step begins.
    fn step(&mut self, stage: &str, what: &str, step: usize, steps: usize);
}

/// Names of all candidates, in light-path order.
pub fn effect_names() -> Vec<&'static str> {
    all_names()
}

/// Whether a candidate changes where or when things are seen, and not only their values.
///
/// # Panics
/// If there is no such candidate.
pub fn changes_places(name: &str) -> bool {
    moves(candidate_of(name))
}

/// The candidates that `options` leaves, in light-path order.
///
/// # Errors
/// A name in `without` that is no candidate's.
pub(crate) fn candidates(options: &DiagnoseOptions) -> Result<Vec<&'static str>> {
    let all = all_names();
    for name in &options.without {
        if !all.contains(&name.as_str()) {
            let path = Path::new("--without");
            return Err(Error::unknown_name(path, None, "candidate", name, all));
        }
    }
    Ok(all.into_iter().filter(|n| !options.without.iter().any(|w| w == n)).collect())
}
