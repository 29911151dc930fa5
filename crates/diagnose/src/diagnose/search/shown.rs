//! What the real frames show by themselves, whatever the simulation: it is there from the start, and all else is seen
//! through it.

use super::{comb, levels, pairs, sites};
use crate::diagnose::evidence::Evidence;
use crate::diagnose::expect::model::{CandidateSpec, P, Theta};

/// What they show.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shown {
    /// Parameters whose values the frames show, in light-path order.
    values: Vec<(P, f64)>,
    /// Qualities of compression that they have not behind them.
    refuted: Vec<u8>,
}

impl Shown {
    /// Looks for those of the candidates `names` that the given camera does not have. What is compressed shows nothing
    /// of what was before.
    pub(crate) fn in_frames(evidence: &Evidence, names: &[&str], base: &Theta) -> Self {
        let asked = |p: &P| names.contains(&p.spec().effect) && !base.is_on(*p);
        let told = Some(P::Quality).filter(asked).map(|_| comb::told(evidence, &evidence.fit));
        let comb::Told { quality, refuted } = told.unwrap_or_default();
        if quality.is_some() || base.is_on(P::Quality) {
            return Self {
                values: quality.map(|q| (P::Quality, f64::from(q))).into_iter().collect(),
                refuted,
            };
        }
        let mosaic =
            if asked(&P::Mosaic) { sites::mosaic(evidence, &evidence.fit, base) } else { Vec::new() };
        let mut shown = Self { values: mosaic, refuted };
        let (behind, _) = shown.put(base);
        let depth = || levels::bits(evidence, &evidence.fit, &behind);
        let scheme = || pairs::scheme(evidence, &evidence.fit);
        let depth = Some(P::Bits).filter(asked).and_then(|p| Some((p, f64::from(depth()?))));
        let scheme = Some(P::Chroma).filter(asked).and_then(|p| Some((p, f64::from(scheme()?))));
        shown.values.extend(depth.into_iter().chain(scheme));
        shown
    }

    /// `theta` with what they show of a candidate; nothing where they show nothing of it.
    pub(crate) fn of(&self, candidate: &CandidateSpec, theta: &Theta) -> Option<Theta> {
        let shown = self.values.iter().filter(|(p, _)| candidate.parameters.contains(p));
        self.has(candidate.name).then(|| shown.fold(theta.clone(), |theta, &(p, value)| theta.with(p, value)))
    }

    /// Whether they show that a parameter has not this value.
    pub(crate) fn refutes(&self, p: P, value: f64) -> bool {
        p == P::Quality && self.refuted.iter().any(|q| f64::from(*q) == value)
    }

    /// Whether they show an effect.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.values.iter().any(|(p, _)| p.spec().effect == name)
    }

    /// A camera with all that they show, and the effects' names.
    pub(crate) fn put(&self, base: &Theta) -> (Theta, Vec<&'static str>) {
        let theta = self.values.iter().fold(base.clone(), |theta, &(p, value)| theta.with(p, value));
        let mut names: Vec<_> = self.values.iter().map(|(p, _)| p.spec().effect).collect();
        // A pattern and its filter are one effect.
        names.dedup();
        (theta, names)
    }
}
