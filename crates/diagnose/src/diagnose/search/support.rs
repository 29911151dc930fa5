//! Which of several candidates is taken, and what becomes superfluous: every question is put to [`Search::prefers`].

use super::found::Found;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::model::{CandidateSpec, P, Theta, candidate_of, mixes_pixels};
use crate::diagnose::fit::FINE;
use crate::diagnose::judge::placed::displacements;
use crate::diagnose::judge::{Estimate, Scores, gain};
use crate::diagnose::search::candidates::{after_what_moves, size};
use crate::diagnose::search::{Search, Tried, Watch};
use shutterbug::error::Result;

impl Search<'_> {
    /// The candidate to take, if any counts: the best, or a simpler one that is as good but for chance and discrepancy.
    pub(crate) fn choose(
        &mut self,
        current: &Theta,
        now: &Scores,
        options: Vec<Tried>,
    ) -> Result<Option<Tried>> {
        let mut counted = Vec::new();
        for option in options {
            if self.prefers(current, &option.1.theta)? {
                counted.push(option);
            }
        }
        after_what_moves(&mut counted);
        let gained = |o: &Tried| gain(now, &o.2).value;
        let Some(best) = counted.iter().max_by(|a, b| gained(a).total_cmp(&gained(b))).cloned() else {
            return Ok(None);
        };
        let mut as_good = vec![best.clone()];
        for option in counted.into_iter().filter(|o| o.0 != best.0 && size(o.0) <= size(best.0)) {
            if !self.prefers(&option.1.theta, &best.1.theta)? {
                as_good.push(option);
            }
        }
        Ok(as_good.into_iter().min_by(|a, b| size(a.0).cmp(&size(b.0)).then(gained(b).total_cmp(&gained(a)))))
    }

    /// A candidate that tells only beside another, and the set with that one: what each of two effects leaves may hide
    /// the other. Asked where no single candidate counts although something is left.
    pub(crate) fn by_way_of_another(
        &mut self,
        watch: &mut dyn Watch,
        found: &Found,
        now: &Scores,
        options: Vec<Tried>,
    ) -> Result<(Vec<&'static str>, Option<Tried>)> {
        let mut set = found.set.clone();
        let gained = |from: &Scores, o: &Tried| gain(from, &o.2).value;
        let gains = options.into_iter().filter(|o| self.gains(now, &o.2));
        let first = gains.max_by(|a, b| gained(now, a).total_cmp(&gained(now, b)));
        let Some((name, fit, seen)) = first.filter(|_| !now.beyond_bounds().is_empty()) else {
            return Ok((set, None));
        };
        set.extend(self.members_of(name, &fit.theta, &set));
        let mut both = Vec::new();
        // What explained nothing without this one may be what it hid.
        self.idle.clear();
        for option in self.round(watch, &set, &fit, &seen, &mut Vec::new())? {
            let theta = &option.1.theta;
            if self.prefers(&fit.theta, theta)? && self.prefers(&found.fit.theta, theta)? {
                both.push(option);
            }
        }
        Ok((set, both.into_iter().max_by(|a, b| gained(&seen, a).total_cmp(&gained(&seen, b)))))
    }

    /// Whether `better` puts more of what photographs by a camera at rest show in its place than `worse`, beyond
    /// chance. Each of them has light of its own, and from the few there are the score alone hardly tells a lens from a
    /// focal length.
    pub(crate) fn places_better(&mut self, worse: &Theta, better: &Theta) -> Result<bool> {
        if !self.forward.static_camera {
            return Ok(false);
        }
        let frames = &self.evidence.choose;
        let pictures = [worse, better].map(|t| self.forward.pictures(frames, t, self.judge.quality));
        let [a, b] = pictures;
        let [a, b] = [a?, b?].map(|p| displacements(self.evidence, frames, &p, self.masks));
        let gains: Vec<f64> = a.iter().zip(&b).filter(|(a, b)| **a + **b > 0.0).map(|(a, b)| a - b).collect();
        Ok(Estimate::of(&gains).is_above(self.tests()))
    }

    /// Takes out what the others make superfluous.
    pub(crate) fn prune(
        &mut self,
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
                if !self.prefers(&fit.theta, &current.theta)?
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

    /// The set without one effect, the others fitted anew, and the noise too where the effect changes how noise is
    /// seen: what a compression has left of it is all there is to a model without one.
    pub(crate) fn pruned(&mut self, set: &[&'static str], i: usize, theta: &Theta) -> Result<(Fit, Scores)> {
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
    pub(crate) fn leave_out(
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
pub(crate) fn restored(theta: &Theta, base: &Theta, candidate: &CandidateSpec) -> Theta {
    let mut out = theta.without(candidate);
    out.room = theta.room.without(candidate.name);
    for &p in candidate.parameters.iter().chain(candidate.more) {
        out.set(p, base.get(p));
    }
    if candidate.name == "rolling_shutter" && base.is_on(P::Readout) {
        out.scan_order = base.scan_order;
    }
    out
}
