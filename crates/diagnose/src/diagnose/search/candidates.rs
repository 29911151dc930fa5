//! The description among the candidates of a search: tried where the frames show more than the camera explains, and
//! asked the same question as every other candidate.

use std::collections::BTreeMap;

use crate::diagnose::expect::description::settle::BLOCKS;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::{P, Theta, candidate_of, is_discrete, moves};
use crate::diagnose::expect::room::{POSES, SURFACES, is_description};
use crate::diagnose::fit::{FINE, VALUES};
use crate::diagnose::judge::{Scores, gain, quantile_of_length, share_beyond_bounds};
use crate::diagnose::search::tracked::Turns;
use crate::diagnose::search::{Search, Tried, Watch};
use shutterbug::error::Result;

/// Share of what a camera leaves that the description must be able to explain beside it, for a search of both: most of
/// it, as for objects. Measured: 94 and 74 % on d10 and d13, whose descriptions are wrong; 12 % on the ghosts of d07.
pub(super) const MOST_OF_IT: f64 = 0.5;

/// How many numbers a member of a set has, to tell which of two is simpler: the description has more than any camera.
pub(crate) fn size(name: &str) -> usize {
    if is_description(name) { usize::from(u16::MAX) } else { candidate_of(name).size() }
}

/// Errors of poses move the picture of each frame by itself, and so do in part what any delay, lens or offset does with
/// a few numbers: they wait until no such candidate counts.
pub(crate) fn after_what_moves(counted: &mut Vec<Tried>) {
    if counted.iter().any(|o| moves(candidate_of(o.0))) {
        counted.retain(|o| o.0 != POSES);
    }
}

/// How far a description that may be wrong explains what a camera leaves.
pub(super) struct Freed {
    /// The camera, and what is free beside it.
    pub theta: Theta,
    /// What is explained, DN.
    pub gain: f64,
    /// Share of what lay beyond the discrepancy that is explained.
    pub share: f64,
}

impl Search<'_> {
    /// Whether errors of poses are smaller beside the parameters that `better` has more, beyond chance: poses that are
    /// free may follow a delay or an offset, but are then all off by what it does (likelihood ratio, [`Turns`]).
    pub(crate) fn poses_shrink(&self, worse: &Theta, better: &Theta) -> bool {
        if worse.room.poses.is_empty() || better.room.poses.is_empty() {
            return false;
        }
        let added = |p: &P| !p.is_discrete() && better.is_on(*p) && !worse.is_on(*p);
        let count = worse.differing(better).filter(added).count();
        let turns = |theta: &Theta| {
            let of = |&at: &usize| {
                let v = theta.room.poses[at];
                (self.forward.starts_s[at], [v[0], v[1], v[2]])
            };
            Turns::new(self.evidence.fit.iter().map(of).collect())
        };
        let likelier = turns(better).likelier_than(&turns(worse));
        tracing::debug!(
            "errors of poses beside {:?}: likelier by {likelier:.1}",
            worse.differing(better).collect::<Vec<_>>()
        );
        count > 0 && likelier > quantile_of_length(self.tests(), count).powi(2)
    }

    /// What may be wrong with the description, fitted beside a set, where something is left to explain.
    pub(crate) fn description_beside(
        &mut self,
        watch: &mut dyn Watch,
        set: &[&'static str],
        theta: &Theta,
        now: &Scores,
    ) -> Result<Vec<Tried>> {
        let mut out = Vec::new();
        if now.beyond_bounds().is_empty() {
            return Ok(out);
        }
        for name in self.room.clone().into_iter().filter(|n| !set.contains(n)) {
            watch.step(name);
            if self.late() {
                break;
            }
            out.extend(self.one_beside(name, set, theta)?);
        }
        Ok(out)
    }

    /// One part of the description fitted beside a set, unless what it does is an effect of its own.
    pub(crate) fn one_beside(
        &mut self,
        name: &'static str,
        set: &[&'static str],
        theta: &Theta,
    ) -> Result<Option<Tried>> {
        let key = format!("{name} {set:?} {theta:?}");
        let work = |search: &mut Self| search.add_description(name, set, theta);
        let fit = Forward::tried(self, |search| search.forward, ("description", &key), work)?;
        if fit.theta.room.radiance && !theta.room.radiance {
            self.forward.find_covered(&fit.theta)?;
            if !self.prefers(theta, &fit.theta)? || !self.is_no_curve(set, theta, &fit.theta)? {
                return Ok(None);
            }
        }
        let tracked = !fit.theta.room.poses.is_empty() && theta.room.poses.is_empty();
        if tracked && !self.is_no_offset(set, theta, &fit.theta)? {
            return Ok(None);
        }
        let scores = self.judge.scores(self.forward, &fit.theta)?;
        tracing::info!("{name} beside {set:?}: {:.3} DN ({:.3})", scores.mean(), scores.floor());
        Ok(Some((name, fit, scores)))
    }

    /// A camera with a part of the description free beside it. Leaves the judge looking where both can be scored.
    pub(super) fn freed(&mut self, exact: &Theta, (radiance, poses): (bool, bool)) -> Result<Freed> {
        let mut theta = exact.clone();
        theta.room.radiance = radiance;
        if poses {
            theta.room.poses = vec![[0.0; 6]; self.evidence.frames.len()];
            self.track_all(&mut theta)?;
        }
        if radiance {
            self.forward.find_covered(&theta)?;
        }
        self.judge.kind = exact.room.kind().and(theta.room.kind());
        // Noise that was measured with the description as it stands may stand for errors of it.
        let theta = self.with_noise(&theta)?;
        let [before, after] = [exact, &theta].map(|t| self.judge.scores(self.forward, t));
        let (before, after) = (before?, after?);
        let (gain, share) = (gain(&before, &after).value, share_beyond_bounds(&before, &after));
        tracing::info!(
            "radiance {radiance}, poses {poses}: {gain:.3} DN, {share:.2} of what is beyond the discrepancy"
        );
        Ok(Freed { theta, gain, share })
    }

    /// Whether a description that may be wrong could be what a finding lacks: free beside the camera that was found
    /// with the description as it stands, does it take away most of what that leaves? A search takes minutes
    /// with it, and what is on no list (a ghost, a filter) leaves errors that factors and poses follow a little, and
    /// never for the most part.
    ///
    /// `most`: the share of that which must go; more where the set may only lack its end.
    pub(crate) fn may_be_the_description(&mut self, exact: &Theta, most: f64) -> Result<bool> {
        let room = self.room.clone();
        let (asked, tracked) = (room.contains(&SURFACES), room.contains(&POSES));
        for (radiance, poses) in [(true, false), (false, true), (true, true)] {
            if (radiance && !asked) || (poses && !tracked) {
                continue;
            }
            if self.freed(exact, (radiance, poses))?.share > most {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn add_description(&mut self, name: &'static str, set: &[&'static str], theta: &Theta) -> Result<Fit> {
        let mut theta = theta.clone();
        if name == SURFACES {
            theta.room.radiance = true;
        } else {
            theta.room.poses = vec![[0.0; 6]; self.evidence.frames.len()];
            self.track_all(&mut theta)?;
        }
        let mut joint = set.to_vec();
        joint.push(name);
        let mut fit = self.refit(&joint, &theta, FINE)?;
        if !fit.theta.room.poses.is_empty() {
            self.track_all(&mut fit.theta)?;
        }
        Ok(fit)
    }

    /// Puts the pose of every frame where it explains most: of those that fits see from all of the frame.
    pub(crate) fn track_all(&mut self, theta: &mut Theta) -> Result<()> {
        let fit = self.evidence.fit.clone();
        let solved = self.forward.track(&fit, theta, &BLOCKS)?;
        for (at, pose) in fit.iter().zip(solved) {
            theta.room.poses[*at] = pose;
        }
        // Where judged frames begin; they go on from there for every camera.
        let judged = self.evidence.choose.iter().chain(&self.evidence.report);
        let judged: Vec<usize> = judged.copied().collect();
        let settled = self.forward.settled(&judged, theta)?.into_owned();
        *theta = settled;
        Ok(())
    }

    /// Whether factors of surfaces do more than one curve for all values and a darker border: a gamma, a gain or a veil
    /// change the radiance of every surface too, with a few numbers.
    pub(super) fn is_no_curve(
        &mut self,
        set: &[&'static str],
        theta: &Theta,
        factors: &Theta,
    ) -> Result<bool> {
        if self.forward.description.no_curve {
            return Ok(true);
        }
        let values = |n: &&'static str| {
            let c = candidate_of(n);
            let plain = !c.noise && !is_discrete(c) && !moves(c);
            plain && !["flicker", "sharpening", "defocus"].contains(n)
        };
        let names: Vec<&'static str> = self.names.iter().copied().filter(values).collect();
        let target = self.target();
        let beside: Vec<P> = names.iter().flat_map(|n| candidate_of(n).parameters.iter().copied()).collect();
        let start = probe(theta, &beside);
        let curve =
            crate::diagnose::fit::fit(self.forward, target, &self.evidence.fit, &start, &beside, VALUES)?;
        // The same darker border beside the factors; what is one curve they do as it is.
        let border = ["vignetting"].into_iter().filter(|n| names.contains(n) && !set.contains(n));
        let mut factors = factors.clone();
        for name in border {
            let mut joint = set.to_vec();
            joint.push(name);
            factors = self.refit(&joint, &factors, VALUES)?.theta;
        }
        let told = self.prefers(&curve.theta, &factors)?;
        tracing::info!("factors of surfaces rather than one curve: {told}");
        self.forward.description.no_curve = told;
        Ok(told)
    }

    /// Whether errors of poses do more than one offset or one delay: those are effects of their own, looked for or not.
    fn is_no_offset(&mut self, set: &[&'static str], theta: &Theta, poses: &Theta) -> Result<bool> {
        for name in ["pose_offset", "time_offset"] {
            if set.contains(&name) || self.names.contains(&name) {
                continue;
            }
            let fit = self.add(candidate_of(name), set, theta)?;
            if !self.prefers(&fit.theta, poses)? {
                tracing::info!("errors of poses do what {name} does");
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// A fit of a set that has no parameter but poses.
    pub(crate) fn refit_poses(&mut self, start: &Theta) -> Result<Fit> {
        let mut theta = start.clone();
        if !theta.room.poses.is_empty() {
            let fit = self.evidence.fit.clone();
            let solved = self.forward.track(&fit, &theta, &BLOCKS[2..])?;
            for (at, pose) in fit.iter().zip(solved) {
                theta.room.poses[*at] = pose;
            }
        }
        Ok(Fit { theta, half: BTreeMap::new() })
    }
}

/// `theta` a little off what is neutral, where slopes are none.
fn probe(theta: &Theta, parameters: &[P]) -> Theta {
    let mut out = theta.clone();
    for &p in parameters.iter().filter(|p| p.spec().name == "veil" && !theta.is_on(**p)) {
        out.set(p, 1e-3);
    }
    out
}
