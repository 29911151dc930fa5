//! Fewer causes for what several explain: a gain below 1 and a black level together are what glare alone is, and a white
//! balance that may as well be none is none.

use super::fit::{Fit, LAST, Level};
use super::forward::Quality;
use super::judge::Scores;
use super::model::{P, candidate_of};
use super::search::{Found, Search};
use super::support::{changes_colours, restored};
use crate::error::Result;

/// Means over blocks, in which rounding is a small part of a DN.
const MEANS: Level = Level { block: 4, iterations: 0, quality: Quality::Fit, frames: 6 };
/// How much lower the cost must be, and what share of it may be left, for glare to be taken instead of a black level. What
/// devices make differently of colours, a tenth of a DN, costs 0.003.
const CLEARER: [f64; 2] = [0.006, 0.7];

/// Effects of two numbers, and those of one that they hold.
const ONE_FOR_TWO: [(&str, &str); 3] =
    [("lens_distortion", "focal_length_error"), ("glare", "exposure_gain"), ("glare", "black_level")];

impl Search<'_> {
    /// Takes out effects on colours that may as well not be there: all their values are neutral within their intervals.
    /// Behind compression a colour that is off by a tenth of a DN may be off by a whole step of its quantizer, and a
    /// white balance of a thousandth can be worth half the gap. Returns whether there were such.
    pub(super) fn drop_insignificant(&mut self, found: &mut Found) -> Result<bool> {
        let (known, count) = (found.fit.half.clone(), found.set.len());
        while found.set.len() > 1 && found.set.iter().any(|n| changes_colours(n)) {
            let native = self.forward.native;
            self.mean_intervals(found)?;
            self.forward.native = native;
            let within = |p: &P| {
                let half = found.fit.half.get(p).copied().unwrap_or(0.0);
                (found.fit.theta.get(*p) - self.base.get(*p)).abs() < half
            };
            let idle = |n: &&'static str| changes_colours(n) && candidate_of(n).parameters.iter().all(within);
            let Some(i) = found.set.iter().position(idle) else { break };
            tracing::info!("at last drops {}: it may as well be none", found.set[i]);
            found.fit.theta = restored(&found.fit.theta, &self.base, candidate_of(found.set[i]));
            found.set.remove(i);
            self.refit_to_the_end(found)?;
        }
        found.fit.half = known;
        Ok(found.set.len() < count)
    }

    /// Puts glare in the place of a black level where that fits clearly better. Both lighten what is dark, by a straight line
    /// that black level leaves one number to and glare two; the score forgives rounding, and with it a slope that is two per
    /// cent off, means over blocks do not.
    pub(super) fn veil_or_black(&mut self, found: &mut Found) -> Result<()> {
        let (black, veil) = ("black_level", "glare");
        if !found.set.contains(&black) || found.set.contains(&veil) || !self.names.contains(&veil) {
            return Ok(());
        }
        let set: Vec<_> = found.set.iter().map(|n| if *n == black { veil } else { *n }).collect();
        // A white veil is a black level.
        let start = restored(&found.fit.theta, &self.base, candidate_of(black));
        let start = start.with(P::Veil, found.fit.theta.get(P::Black).max(0.0)).with(P::Level, 1.0);
        let other = self.refit(&set, &start, LAST)?;
        let weighing = self.weighing(&found.fit.theta, &MEANS)?;
        let was = self.cost(&found.fit.theta.clone(), &MEANS, &weighing)?;
        let now = self.cost(&other.theta, &MEANS, &weighing)?;
        tracing::info!("glare for a black level: {now:.5} for {was:.5}");
        if was - now > CLEARER[0] && now < CLEARER[1] * was {
            found.set = set;
            found.fit.theta = other.theta;
            self.refit_to_the_end(found)?;
        }
        Ok(())
    }

    /// Puts an effect of one number in the place of one of two where that is no worse: behind noise, or beside a pose that is off,
    /// a lens that bends to one side and back is taken for a focal length, and glare without light for a gain.
    pub(super) fn one_number_for_two(
        &mut self,
        set: &mut Vec<&'static str>,
        current: &mut Fit,
        scores: &mut Scores,
    ) -> Result<()> {
        for (two, one) in ONE_FOR_TWO {
            let asked = set.contains(&two) && !set.contains(&one) && self.names.contains(&one);
            if !asked || self.late() {
                continue;
            }
            let rest: Vec<_> = set.iter().copied().filter(|n| *n != two).collect();
            let start = restored(&current.theta, &self.base, candidate_of(two));
            let mut fit = self.add(candidate_of(one), &rest, &start)?;
            fit.theta = self.with_noise(&fit.theta)?;
            let found = self.judge.scores(self.forward, &fit.theta)?;
            tracing::info!("{one} for {two}: {:.4} for {:.4} DN", found.mean(), scores.mean());
            if self.judge.gain(&found, scores).1[0] <= 0.0 {
                (*set, *current, *scores) = (rest.into_iter().chain([one]).collect(), fit, found);
            }
        }
        Ok(())
    }

    /// Puts one candidate in the place of two effects on colours for as long as nothing is lost by it.
    pub(super) fn simplify(
        &mut self,
        before: &Scores,
        set: &mut Vec<&'static str>,
        current: &mut Fit,
        scores: &mut Scores,
    ) -> Result<()> {
        while !self.late() {
            let Some((next, fit, simpler)) = self.one_for_two(before, set, current, scores)? else { break };
            tracing::info!("{next:?} for {set:?}: {:.3} for {:.3} DN", simpler.mean(), scores.mean());
            (*set, *current, *scores) = (next, fit, simpler);
        }
        Ok(())
    }

    /// The best set with one candidate instead of two of its members, if the two are worth no more than the one.
    fn one_for_two(
        &mut self,
        before: &Scores,
        set: &[&'static str],
        current: &Fit,
        scores: &Scores,
    ) -> Result<Option<(Vec<&'static str>, Fit, Scores)>> {
        let colours: Vec<_> = set.iter().copied().filter(|n| changes_colours(n)).collect();
        let beside = |n: &&'static str| changes_colours(n) && !set.contains(n);
        let others: Vec<_> = self.names.iter().copied().filter(beside).collect();
        let mut best: Option<(Vec<&'static str>, Fit, Scores)> = None;
        for (i, &one) in colours.iter().enumerate() {
            for &two in &colours[..i] {
                let rest: Vec<_> = set.iter().copied().filter(|n| *n != one && *n != two).collect();
                let start = restored(&current.theta, &self.base, candidate_of(one));
                let start = restored(&start, &self.base, candidate_of(two));
                for &other in &others {
                    let fit = self.add(candidate_of(other), &rest, &start)?;
                    let found = self.judge.scores(self.forward, &fit.theta)?;
                    let worth_two = self.supports(two, before, &found, scores);
                    if !worth_two && best.as_ref().is_none_or(|b| found.mean() < b.2.mean()) {
                        let next = rest.iter().copied().chain([other]).collect();
                        best = Some((next, fit, found));
                    }
                }
            }
        }
        Ok(best)
    }
}
