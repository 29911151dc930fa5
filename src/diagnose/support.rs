//! What counts: when a gain supports an effect, which of several candidates is taken, and what becomes superfluous.

use super::fit::{FINE, Fit};
use super::judge::Scores;
use super::model::{CandidateSpec, P, Theta, candidate_of};
use super::search::{Search, Tried};
use crate::error::Result;

/// Least share of the gap that an effect must be worth.
pub(super) const LEAST_SHARE: f64 = 0.01;
/// Least part of what two correct renderers may differ by that an effect must be worth.
pub(super) const LEAST_DIFFERENCE: f64 = 0.12;
/// Of a gap that is noise alone, the part that a model with that noise takes away: 1 - 1 / sqrt(2).
const NOISE_EXCESS: f64 = 0.29;
/// What is worth less than [`LEAST_SHARE`] of the whole gap must be worth this share of what the others leave.
const CLEAR_SHARE: f64 = 0.4;
/// How well a floor is known, as a part of it: less than that is not left.
pub(super) const FLOOR_PART: f64 = 0.05;
/// What correct renderers make differently of colours, DN: half of what devices were seen to (see [`super::intervals`]).
const COLOURS_DN: f64 = 0.05;
/// A simpler candidate is preferred to one that gains less than this share more.
const PARSIMONY: f64 = 0.02;

/// What is left above the floor: where noise is expected to make more than there is that is nothing, but for what a floor is not
/// known to.
fn rest_of(scores: &Scores) -> f64 {
    (scores.mean() - scores.floor()).max(FLOOR_PART * scores.floor())
}

impl Search<'_> {
    /// The least gain that may count, as a share of the score `now`.
    pub(super) fn least_share(&self, before: &Scores, now: &Scores) -> f64 {
        let gap = (before.mean() - now.floor()).max(0.0);
        let least = damped(LEAST_DIFFERENCE * self.renderer_difference, now.floor());
        least.max(f64::min(LEAST_SHARE * gap, CLEAR_SHARE * rest_of(now))) / now.mean().max(1e-9)
    }

    /// Whether a gain counts.
    pub(super) fn supports(&self, name: &str, before: &Scores, worse: &Scores, better: &Scores) -> bool {
        let (gain, [low, _]) = self.judge.gain(worse, better);
        // Behind compression a colour that is off by that may be off by a step of the quantizer.
        let packed = if self.compression.is_some() { 2.0 } else { 1.0 };
        let values = changes_colours(name) || name == "vignetting";
        let colours_dn = if values { packed * COLOURS_DN } else { 0.0 };
        let least = damped(colours_dn.max(LEAST_DIFFERENCE * self.renderer_difference), better.floor());
        // What noise makes of the score is no gap once the model has that noise.
        let whole = (before.mean() - before.floor()).max(0.0);
        let gap = (before.mean() - better.floor()).clamp(NOISE_EXCESS * whole, whole);
        low > 0.0 && gain > least && (gain > LEAST_SHARE * gap || gain > CLEAR_SHARE * rest_of(worse))
    }

    /// The candidate to take, if any gain counts: the best, or a simpler one that is nearly as good.
    pub(super) fn choose(&self, before: &Scores, now: &Scores, options: Vec<Tried>) -> Option<Tried> {
        let gain = |o: &Tried| now.mean() - o.2.mean();
        let counted: Vec<_> = options
            .into_iter()
            .filter(|o| self.supports(o.0, before, now, &o.2) && !is_a_filter(o.0, &o.1.theta))
            .collect();
        let best = counted.iter().max_by(|a, b| gain(a).total_cmp(&gain(b)))?.clone();
        let size = |name: &str| candidate_of(name).parameters.len();
        // Nearly as good is only what the better one would not be taken beside: of a large gap, a share that two renderers
        // cannot differ by may be what tells a black level from glare.
        let as_good = |o: &Tried| {
            o.0 == best.0
                || (gain(o) >= (1.0 - PARSIMONY) * gain(&best)
                    && !self.supports(best.0, before, &o.2, &best.2))
        };
        counted
            .into_iter()
            .filter(as_good)
            .min_by(|a, b| size(a.0).cmp(&size(b.0)).then(gain(b).total_cmp(&gain(a))))
    }

    /// Takes out what the others make superfluous.
    pub(super) fn prune(
        &mut self,
        before: &Scores,
        set: &mut Vec<&'static str>,
        current: &mut Fit,
        scores: &mut Scores,
    ) -> Result<()> {
        while set.len() > 1 {
            let mut weakest: Option<(usize, Fit, Scores)> = None;
            for i in 0..set.len() - 1 {
                if self.is_known(set[i]) {
                    continue;
                }
                let (fit, rest) = self.pruned(set, i, &current.theta)?;
                if !self.supports(set[i], before, &rest, scores)
                    && weakest.as_ref().is_none_or(|w| rest.mean() < w.2.mean())
                {
                    weakest = Some((i, fit, rest));
                }
            }
            let Some((i, fit, rest)) = weakest else { return Ok(()) };
            tracing::info!("drops {}: {:.3} DN without", set[i], rest.mean());
            set.remove(i);
            (*current, *scores) = (fit, rest);
        }
        Ok(())
    }

    /// The set without one effect, the others fitted anew, and the noise too where the effect changes how noise is seen: what
    /// a compression has left of it is all there is to a model without one.
    pub(super) fn pruned(&mut self, set: &[&'static str], i: usize, theta: &Theta) -> Result<(Fit, Scores)> {
        let mut start = restored(theta, &self.base, candidate_of(set[i]));
        if mixes_pixels(set[i]) {
            start = self.with_noise(&start)?;
        }
        let (mut fit, mut scores) = self.rest_of(set, i, &start)?;
        if set.contains(&"sharpening") && set[i] != "sharpening" {
            fit.theta = self.with_noise(&fit.theta)?;
            scores = self.judge.scores(self.forward, &fit.theta)?;
        }
        Ok((fit, scores))
    }

    /// The set without one effect, the others fitted anew, the noise as it is.
    pub(super) fn leave_out(
        &mut self,
        set: &[&'static str],
        i: usize,
        theta: &Theta,
    ) -> Result<(Fit, Scores)> {
        let start = restored(theta, &self.base, candidate_of(set[i]));
        self.rest_of(set, i, &start)
    }

    fn rest_of(&mut self, set: &[&'static str], i: usize, start: &Theta) -> Result<(Fit, Scores)> {
        let rest: Vec<_> = set.iter().copied().filter(|n| *n != set[i]).collect();
        let fit = self.refit(&rest, start, FINE)?;
        let scores = self.judge.scores(self.forward, &fit.theta)?;
        Ok((fit, scores))
    }
}

/// `theta` with an effect as the given camera has it.
pub(super) fn restored(theta: &Theta, base: &Theta, candidate: &CandidateSpec) -> Theta {
    let mut out = theta.without(candidate);
    for &p in candidate.parameters.iter().chain(candidate.more) {
        out.set(p, base.get(p));
    }
    if candidate.name == "rolling_shutter" && base.is_on(P::Readout) {
        out.scan_order = base.scan_order;
    }
    out
}

/// Whether a filter is no stronger than what the pixel filters of two correct renderers differ by: the variance of a
/// pixel's square is 1/12 px^2, and few samples a pixel gain from a blur a little wider (0.33 px, measured).
pub(super) fn is_a_filter(name: &str, theta: &Theta) -> bool {
    match name {
        "defocus" => theta.get(P::Defocus).powi(2) < 1.5 / 12.0,
        "sharpening" => theta.get(P::Sharpen) * theta.get(P::Radius).powi(2) < 1.0 / 12.0,
        _ => false,
    }
}

/// Whether a candidate changes values by what they are, wherever they are.
pub(super) fn changes_colours(name: &str) -> bool {
    matches!(name, "exposure_gain" | "glare" | "black_level" | "white_balance" | "gamma")
}

/// Whether a candidate mixes neighbouring pixels behind the noise: it changes the spread, and how much noise there must be to
/// make the spread that is seen.
pub(super) fn mixes_pixels(name: &str) -> bool {
    matches!(name, "bayer_mosaic" | "sharpening" | "chroma_subsampling" | "jpeg")
}

/// What a difference of pictures counts in the score beside noise that scores `floor`: less than its size, DN.
pub(super) fn damped(difference_dn: f64, floor: f64) -> f64 {
    difference_dn * (difference_dn / (difference_dn + floor)).max(0.25)
}
