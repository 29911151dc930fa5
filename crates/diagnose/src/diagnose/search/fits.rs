//! Fits of a search: at the size of the frames, or at a smaller one where that tells as much.

use std::collections::BTreeMap;

use crate::diagnose::evidence::{Evidence, spread_out};
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::forward::{Forward, Reduced};
use crate::diagnose::expect::model::{CandidateSpec, Theta, free};
use crate::diagnose::expect::reduced::acts_alike;
use crate::diagnose::expect::weighing::Weighing;
use crate::diagnose::fit::cost::{Level, Target, cost_of, weighing_of};
use crate::diagnose::fit::starts::best_starts;
use crate::diagnose::fit::{COMPARED_DN, Schedule, fit};
use crate::diagnose::search::Search;
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// Starts of a candidate that go on.
const STARTS: usize = 2;

/// Of which frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Size {
    /// As they are.
    Whole,
    /// With fewer pixels.
    Reduced,
}

/// Fits at one size.
pub(crate) struct Fits<'a> {
    forward: &'a mut Forward,
    evidence: &'a Evidence,
    masks: &'a [Plane<f32>],
}

impl Search<'_> {
    /// The size at which a candidate is fitted beside what `theta` has.
    pub(crate) fn size_for(&self, candidate: &CandidateSpec, theta: &Theta) -> Size {
        let off = |at: Theta, p| at.with(p, at.get(p) + p.spec().step);
        let with = candidate.parameters.iter().fold(theta.clone(), |at, &p| off(at, p));
        let is_small = self.forward.reduced.is_some() && acts_alike(&with);
        if is_small { Size::Reduced } else { Size::Whole }
    }

    /// Fits at a size.
    pub(crate) fn at(&mut self, size: Size) -> Fits<'_> {
        if size == Size::Whole || self.forward.reduced.is_none() {
            return Fits { forward: self.forward, evidence: self.evidence, masks: self.masks };
        }
        let from = &*self.forward;
        let (budget, light, compared) = (from.budget.clone(), from.light.clone(), from.compared);
        let reduced = self.forward.reduced.as_deref_mut().expect("just seen");
        let Reduced { forward, evidence, masks } = reduced;
        (forward.budget, forward.light, forward.compared) = (budget, light, compared);
        Fits { forward, evidence, masks }
    }

    /// Robust cost on the frames that fits see.
    pub(crate) fn cost(&mut self, theta: &Theta, level: &Level, weighing: &Weighing) -> Result<f64> {
        self.at(Size::Whole).cost(theta, level, weighing)
    }

    /// The weights under which costs of a stage are compared: those of the noise in `theta`.
    pub(crate) fn weighing(&mut self, theta: &Theta, level: &Level) -> Result<Weighing> {
        self.at(Size::Whole).weighing(theta, level)
    }
}

impl<'a> Fits<'a> {
    fn target(&self) -> Target<'a> {
        Target { evidence: self.evidence, masks: Some(self.masks) }
    }

    /// Fits a set jointly from a start.
    pub(crate) fn refit(&mut self, set: &[&'static str], start: &Theta, schedule: Schedule) -> Result<Fit> {
        let free = free(set);
        if free.is_empty() {
            return Ok(Fit { theta: start.clone(), half: BTreeMap::new() });
        }
        let target = self.target();
        fit(self.forward, target, &self.evidence.fit, start, &free, schedule)
    }

    /// See [`Search::cost`].
    pub(crate) fn cost(&mut self, theta: &Theta, level: &Level, weighing: &Weighing) -> Result<f64> {
        let frames = spread_out(&self.evidence.fit, level.frames);
        let target = self.target();
        cost_of(self.forward, target, &frames, theta, level, weighing)
    }

    /// See [`Search::weighing`].
    pub(crate) fn weighing(&mut self, theta: &Theta, level: &Level) -> Result<Weighing> {
        let frames = spread_out(&self.evidence.fit, level.frames);
        weighing_of(self.forward, &frames, theta, level, COMPARED_DN)
    }

    /// Where the fit of a candidate begins; `known`: where it may, besides.
    pub(crate) fn starts(
        &mut self,
        theta: &Theta,
        candidate: &CandidateSpec,
        known: Option<Theta>,
    ) -> Result<Vec<Theta>> {
        let target = self.target();
        best_starts(self.forward, target, self.evidence, theta, candidate, (known, STARTS))
    }
}
