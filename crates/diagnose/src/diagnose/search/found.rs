//! What a search has found, and what it had no time for.

use std::collections::BTreeMap;

use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::model::{P, Theta, candidate_of};
use crate::diagnose::judge::Scores;
use crate::diagnose::judge::residue::Residue;

/// Stages that are left out where there is no time: those without which nothing can be denied, and the others.
pub(crate) const SEARCH: &str = "the rest of the search";
pub(crate) const FITS: &str = "the last fits";
pub(crate) const REST: &str = "the noise and what is left";
pub(crate) const INTERVALS: &str = "intervals";
pub(crate) const SHARES: &str = "shares of effects beside each other";
pub(crate) const PICTURES: &str = "pictures of frames that are not held out";
pub(crate) const PERCEPTS: &str = "corners, lines and blobs";
pub(crate) const FINER: &str = "frames of sixteen samples a pixel";

/// A candidate fitted alone.
#[derive(Clone, Debug)]
pub(crate) struct Alone {
    pub name: &'static str,
    pub fit: Fit,
    pub scores: Scores,
    /// Without it: with the same noise, rendered as well.
    pub against: Scores,
}

/// The outcome of a search.
#[derive(Clone)]
pub(crate) struct Found {
    /// In the order in which they were taken.
    pub set: Vec<&'static str>,
    pub fit: Fit,
    pub alone: Vec<Alone>,
    pub before: Scores,
    pub after: Scores,
    /// Parameters that were freed besides those that every fit frees.
    pub more: Vec<P>,
    /// What is left on held-out frames.
    pub residue: Residue,
    /// By member of the set: effects that do the same on these frames.
    pub alternatives: BTreeMap<&'static str, Vec<&'static str>>,
    /// Whether the search stopped because paint or light shows, and is not at its end.
    pub shows_paint: bool,
    /// Candidates for which there was no time.
    pub late: Vec<&'static str>,
    /// Stages for which there was none, in words.
    pub left_out: Vec<&'static str>,
    /// How well the frames to report by were rendered.
    pub quality: Quality,
}

impl Found {
    /// Before a search.
    pub(crate) fn nothing(base: &Theta, before: Scores) -> Self {
        Self {
            set: Vec::new(),
            fit: Fit { theta: base.clone(), half: BTreeMap::new() },
            alone: Vec::new(),
            after: before.clone(),
            before,
            more: Vec::new(),
            residue: Residue::unseen(),
            alternatives: BTreeMap::new(),
            shows_paint: false,
            late: Vec::new(),
            left_out: Vec::new(),
            quality: Quality::Fit,
        }
    }

    /// Notes a candidate for which there was no time.
    pub(crate) fn is_late(&mut self, name: &'static str) {
        if !self.late.contains(&name) {
            self.late.push(name);
        }
    }

    /// Notes a stage for which there was no time.
    pub(crate) fn leave_out(&mut self, stage: &'static str) {
        if !self.left_out.contains(&stage) {
            self.left_out.push(stage);
        }
    }

    /// Whether the search, and the checks of what it leaves, came to their end.
    pub(crate) fn is_whole(&self) -> bool {
        self.late.is_empty() && ![SEARCH, FITS, REST].iter().any(|s| self.left_out.contains(s))
    }

    /// Continuous parameters that fits of the set free.
    pub(crate) fn free(&self) -> Vec<P> {
        crate::diagnose::expect::model::free(&self.set).into_iter().chain(self.more.iter().copied()).collect()
    }

    /// Places in the set of members with a parameter that was fitted to the end of its range: they wanted to be
    /// something else.
    pub(crate) fn at_an_end(&self) -> Vec<usize> {
        let free = self.free();
        // An effect may be none.
        let ends = |p: &P| {
            let value = self.fit.theta.get(*p);
            !p.spec().fit.ends && self.fit.theta.is_on(*p) && p.spec().range.contains(&value)
        };
        let own = |name: &str| {
            let candidate = candidate_of(name);
            candidate.parameters.iter().chain(candidate.more).any(|p| free.contains(p) && ends(p))
        };
        (0..self.set.len()).filter(|&i| own(self.set[i])).collect()
    }

    /// Whether what is left was looked at.
    pub(crate) fn is_checked(&self) -> bool {
        !self.left_out.contains(&REST)
    }

    /// Whether the figures are of frames of few samples a pixel, which are off by themselves.
    pub(crate) fn is_coarse(&self) -> bool {
        self.left_out.contains(&FINER)
    }

    /// What the report says of stages for which there was no time.
    pub(crate) fn said(&self) -> Option<String> {
        let out = &self.left_out;
        (!out.is_empty())
            .then(|| format!("the time limit was reached: the report goes without {}", out.join("; ")))
    }

    /// Takes back all effects.
    pub(crate) fn clear(&mut self, base: &Theta) {
        self.set.clear();
        self.fit.theta = base.clone();
        self.fit.half.clear();
        self.after = self.before.clone();
    }
}
