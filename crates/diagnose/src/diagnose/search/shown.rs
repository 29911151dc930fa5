//! What the real frames show by themselves, whatever the simulation: it is there from the start, and all else is seen
//! through it.

use super::{comb, levels, pairs};
use crate::diagnose::evidence::Evidence;
use crate::diagnose::expect::model::{P, Theta};

/// Parameters whose values the frames show, in light-path order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shown(Vec<(P, f64)>);

impl Shown {
    /// Looks for those of the candidates `names` that the given camera does not have. What is compressed shows nothing
    /// of what was before.
    pub(crate) fn in_frames(evidence: &Evidence, names: &[&str], base: &Theta) -> Self {
        let asked = |p: &P| names.contains(&p.spec().effect) && !base.is_on(*p);
        let quality = || comb::quality(evidence, &evidence.fit);
        let compressed = Some(P::Quality).filter(asked).and_then(|p| Some((p, f64::from(quality()?))));
        if compressed.is_some() || base.is_on(P::Quality) {
            return Self(compressed.into_iter().collect());
        }
        let depth = || levels::bits(evidence, &evidence.fit, base);
        let scheme = || pairs::scheme(evidence, &evidence.fit);
        let depth = Some(P::Bits).filter(asked).and_then(|p| Some((p, f64::from(depth()?))));
        let scheme = Some(P::Chroma).filter(asked).and_then(|p| Some((p, f64::from(scheme()?))));
        Self([depth, scheme].into_iter().flatten().collect())
    }

    /// The value of a parameter that they show.
    pub(crate) fn value(&self, p: P) -> Option<f64> {
        self.0.iter().find(|(shown, _)| *shown == p).map(|(_, value)| *value)
    }

    /// Whether they show an effect.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|(p, _)| p.spec().effect == name)
    }

    /// A camera with all that they show, and the effects' names.
    pub(crate) fn put(&self, base: &Theta) -> (Theta, Vec<&'static str>) {
        let theta = self.0.iter().fold(base.clone(), |theta, &(p, value)| theta.with(p, value));
        (theta, self.0.iter().map(|(p, _)| p.spec().effect).collect())
    }
}
