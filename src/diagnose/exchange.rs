//! Which effects do the same on these frames: a class is named by its simplest member, and the others are its alternatives.
//!
//! A black level lightens what is dark as glare does; an exposure delays what it blurs. What the normal equations promise says
//! which candidates resemble a member of the set; whether they explain the frames as well is decided by fits and scores, as
//! every other question is.

use super::description::is_description;
use super::fit::{Fit, Level, spread_out};
use super::forward::Quality;
use super::judge::{Scores, gain};
use super::model::{P, candidate_of};
use super::normal::{linearise, screened};
use super::search::{Found, Search, is_discrete, moves};
use super::support::restored;
use crate::error::Result;

/// Where slopes are compared.
const LOOK: Level = Level { block: 2, iterations: 0, quality: Quality::Fit, frames: 3 };
/// Share of what a member gains that a candidate must promise in its place to be fitted there: slopes at none foresee gains to
/// within a factor of two (bent effects: an exposure, a defocus).
const RESEMBLES: f64 = 0.5;

/// Most candidates that are fitted in the place of a member.
const MOST: usize = 2;

/// A set that does what another one does.
struct Other {
    set: Vec<&'static str>,
    fit: Fit,
    scores: Scores,
}

impl Search<'_> {
    /// Puts simpler effects, or ones that explain the frames better, in the place of members of the set; notes the rest of each
    /// class.
    pub(super) fn exchange(&mut self, found: &mut Found) -> Result<()> {
        let mut scores = self.judge.scores(self.forward, &found.fit.theta.clone())?;
        // Each exchange explains more, or as much with less: it cannot go round.
        for _ in 0..2 * self.names.len() {
            let Some(other) = self.exchanged(found, &scores)? else { break };
            tracing::info!(
                "{:?} for {:?}: {:.4} for {:.4} DN",
                other.set,
                found.set,
                other.scores.mean(),
                scores.mean()
            );
            (found.set, found.fit, scores) = (other.set, other.fit, other.scores);
        }
        Ok(())
    }

    /// The first exchange that is worth making.
    fn exchanged(&mut self, found: &mut Found, now: &Scores) -> Result<Option<Other>> {
        found.alternatives.clear();
        let members: Vec<_> = found.set.iter().copied().filter(|n| self.may_change(n)).collect();
        for groups in [alike_pairs(&members), members.iter().map(|&m| vec![m]).collect()] {
            for out in groups {
                let Some(other) = self.in_place_of(&out, found, now)? else { continue };
                return Ok(Some(other));
            }
        }
        Ok(None)
    }

    /// Whether slopes say what an effect does, and the frames themselves do not say that it is there.
    fn may_change(&self, name: &str) -> bool {
        let candidate = candidate_of(name);
        let plain = !candidate.noise && !is_discrete(candidate) && !is_description(name);
        plain && !self.is_known(name) && name != "flicker"
    }

    /// One candidate in the place of the members `out`, if that is simpler and as good, or better. Notes what is as good and no
    /// simpler as an alternative.
    fn in_place_of(
        &mut self,
        out: &[&'static str],
        found: &mut Found,
        now: &Scores,
    ) -> Result<Option<Other>> {
        let rest: Vec<_> = found.set.iter().copied().filter(|n| !out.contains(n)).collect();
        let start =
            out.iter().fold(found.fit.theta.clone(), |t, n| restored(&t, &self.base, candidate_of(n)));
        // What moves the picture does not do what changes its values, and the other way round.
        let kind = moves(candidate_of(out[0]));
        let beside =
            |n: &&'static str| !found.set.contains(n) && self.may_change(n) && moves(candidate_of(n)) == kind;
        let others: Vec<_> = self.names.iter().copied().filter(beside).collect();
        let alike = self.alike(out, &rest, &others, &start)?;
        let size = |names: &[&str]| names.iter().map(|n| candidate_of(n).parameters.len()).sum::<usize>();
        for name in alike {
            if self.late() {
                return Ok(None);
            }
            let fit = self.add(candidate_of(name), &rest, &start)?;
            let scores = self.judge.scores(self.forward, &fit.theta)?;
            tracing::info!("{name} in place of {out:?}: {:.4} for {:.4} DN", scores.mean(), now.mean());
            let worse = self.prefers(&fit.theta, &found.fit.theta)?;
            let better = self.prefers(&found.fit.theta, &fit.theta)?;
            let simpler = out.len() > 1 || size(&[name]) < size(out);
            // As simple and as good: what scores better is named, the other is its alternative.
            let rather = size(&[name]) == size(out) && gain(now, &scores).value > 0.0;
            let mut set = rest.clone();
            set.push(name);
            if better || (!worse && (simpler || rather)) {
                let fit = self.refit(&set, &fit.theta, super::fit::FINE)?;
                let scores = self.judge.scores(self.forward, &fit.theta)?;
                if !self.prefers(&fit.theta, &found.fit.theta)? {
                    return Ok(Some(Other { set, fit, scores }));
                }
            } else if let (false, [member]) = (worse, out) {
                found.alternatives.entry(member).or_default().push(name);
            }
        }
        Ok(None)
    }

    /// Candidates that promise, beside `rest`, about what the members `out` do; the most like first.
    fn alike(
        &mut self,
        out: &[&'static str],
        rest: &[&'static str],
        others: &[&'static str],
        start: &super::model::Theta,
    ) -> Result<Vec<&'static str>> {
        let held = Self::free(rest);
        let own = Self::free(out);
        let mut groups: Vec<Vec<P>> = vec![own];
        groups.extend(others.iter().map(|n| candidate_of(n).parameters.to_vec()));
        let mut all: Vec<P> = held.iter().chain(groups.iter().flatten()).copied().collect();
        all.sort();
        all.dedup();
        let frames = spread_out(&self.evidence.fit, LOOK.frames);
        let (target, probe) = (self.target(), super::search::probe(start));
        let e = linearise(self.forward, target, &frames, &probe, &all, &LOOK, None)?;
        let gains = screened(&e, &all, &held, &groups);
        let mut alike: Vec<_> = others.iter().copied().zip(gains[1..].iter().copied()).collect();
        alike.retain(|a| a.1 > RESEMBLES * gains[0]);
        alike.sort_by(|a, b| b.1.total_cmp(&a.1));
        Ok(alike.into_iter().take(MOST).map(|a| a.0).collect())
    }
}

/// All pairs of one kind: both move the picture, or neither does.
fn alike_pairs(names: &[&'static str]) -> Vec<Vec<&'static str>> {
    let kind = |n: &str| moves(candidate_of(n));
    let with = |i: usize| {
        let before = names[..i].iter().filter(move |b| kind(b) == kind(names[i]));
        before.map(move |&b| vec![names[i], b])
    };
    (0..names.len()).flat_map(with).collect()
}
