//! Which effects do the same on these frames: a class is named by its simplest member, and the others are its
//! alternatives.
//!
//! A black level lightens what is dark as glare does; an exposure delays what it blurs. What the normal equations
//! promise says which candidates resemble a member of the set; whether they explain the frames as well is decided by
//! fits and scores, as every other question is.

use super::found::Found;
use super::support::restored;
use crate::diagnose::evidence::blocks::pooled;
use crate::diagnose::evidence::spread_out;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::forward::Quality;
use crate::diagnose::expect::linear::solve;
use crate::diagnose::expect::model::{P, Theta, candidate_of, free, is_discrete, mixes_pixels, moves};
use crate::diagnose::expect::room::is_description;
use crate::diagnose::expect::tone::Tone;
use crate::diagnose::fit::VALUES;
use crate::diagnose::fit::cost::{Level, hide};
use crate::diagnose::fit::normal::{assemble, linearise};
use crate::diagnose::judge::{Scores, gain};
use crate::diagnose::search::Search;
use shutterbug::chain::{ParamKind, Work};
use shutterbug::effects;
use shutterbug::error::Result;

/// Where slopes are compared: of blocks, whose steps are long enough for what a short exposure does to show beside what
/// few samples a pixel miss.
const LOOK: Level = Level { block: 4, iterations: 0, quality: Quality::Fit, frames: 3 };
/// Share of what a member does to the frames, in squares, that a candidate must be able to do to be fitted in its
/// place: with less it does more that is wrong than right.
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
    /// Puts simpler effects, or ones that explain the frames better, in the place of members of the set; notes the rest
    /// of each class.
    pub(crate) fn exchange(&mut self, found: &mut Found) -> Result<()> {
        // Of effects that do nearly the same, few samples a pixel may hide what the one does and the other does not.
        let quality = std::mem::replace(&mut self.judge.quality, Quality::Fine);
        let done = self.exchange_all(found);
        self.judge.quality = quality;
        done
    }

    fn exchange_all(&mut self, found: &mut Found) -> Result<()> {
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
        if members.is_empty() {
            return Ok(None);
        }
        let doings = self.doings(found)?;
        for groups in [alike_pairs(&members), members.iter().map(|&m| vec![m]).collect()] {
            for out in groups {
                let Some(other) = self.in_place_of(&out, &doings, found, now)? else { continue };
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

    /// One candidate in the place of the members `out`, if that is simpler and as good, or better. Notes what is as
    /// good and no simpler as an alternative.
    fn in_place_of(
        &mut self,
        out: &[&'static str],
        doings: &Doings,
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
        let mut alike = doings.alike(out, &rest, &others);
        alike.extend(self.choices_like(out, &found.set));
        let size = |names: &[&str]| names.iter().map(|n| candidate_of(n).parameters.len()).sum::<usize>();
        for name in alike {
            if self.late() {
                return Ok(None);
            }
            let mut set = rest.clone();
            set.push(name);
            let mut fit = self.add(candidate_of(name), &rest, &start)?;
            if !kind && Tone::new(&fit.theta).is_noisy() {
                // It was fitted under the noise of what it replaces, which moves means that are bent otherwise.
                fit = self.refit(&set, &fit.theta, VALUES)?;
                fit.theta = self.with_noise(&fit.theta)?;
            }
            let scores = self.judge.scores(self.forward, &fit.theta)?;
            tracing::info!("{name} in place of {out:?}: {:.4} for {:.4} DN", scores.mean(), now.mean());
            let worse = self.prefers(&fit.theta, &found.fit.theta)?;
            let better = self.prefers(&found.fit.theta, &fit.theta)?;
            let simpler = out.len() > 1 || size(&[name]) < size(out);
            // As simple and as good: what scores better is named, the other is its alternative.
            let rather = size(&[name]) == size(out) && gain(now, &scores).value > 0.0;
            if better || (!worse && (simpler || rather)) {
                let fit = self.refit(&set, &fit.theta, crate::diagnose::fit::FINE)?;
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

    /// Choices that may be what members `out` were taken for: a mosaic blurs as a defocus does. They have no slope that
    /// would tell.
    fn choices_like(&self, out: &[&'static str], set: &[&'static str]) -> Vec<&'static str> {
        let filters = |n: &&str| {
            let effect = effects::by_id(n);
            effect.is_some_and(|e| matches!(e.work(), Work::Neighbourhood { .. }))
        };
        if !out.iter().all(filters) {
            return Vec::new();
        }
        let is_choice = |n: &&'static str| {
            let chosen = |p: &P| matches!(p.spec().kind, ParamKind::Choice { .. });
            is_discrete(candidate_of(n)) && candidate_of(n).parameters.iter().all(chosen)
        };
        let open = |n: &&'static str| mixes_pixels(n) && !set.contains(n) && !self.is_known(n);
        self.names.iter().copied().filter(is_choice).filter(open).collect()
    }

    /// What single parameters, and the set's members, do to the frames beside the set as it is.
    fn doings(&mut self, found: &Found) -> Result<Doings> {
        let others = self.names.iter().copied().filter(|n| self.may_change(n));
        let more = others.flat_map(|n| candidate_of(n).parameters.iter().copied());
        let mut all: Vec<P> = free(&found.set).into_iter().chain(more).collect();
        all.sort();
        all.dedup();
        let frames = spread_out(&self.evidence.fit, LOOK.frames);
        let (target, probe) = (self.target(), crate::diagnose::search::probe(&found.fit.theta));
        let e = linearise(self.forward, target, &frames, &probe, &all, &LOOK, None)?;
        let members: Vec<_> = found.set.iter().copied().filter(|n| self.may_change(n)).collect();
        let mut values = e.values;
        for member in &members {
            let without = restored(&found.fit.theta, &self.base, candidate_of(member));
            let done = self.difference(&frames, &found.fit.theta, &without)?;
            values.iter_mut().zip(done).for_each(|(frame, done)| frame.1.push(done));
        }
        let e = assemble(values, all.len() + members.len(), e.weighing);
        Ok(Doings { a: e.a, all, members })
    }

    /// By frame: what is simulated of one point less that of another, ahead of compression, as fits compare it.
    fn difference(&mut self, frames: &[usize], theta: &Theta, other: &Theta) -> Result<Vec<Vec<f32>>> {
        let smooth = [theta, other].map(|t| t.with(P::Quality, 0.0));
        let [a, b] = smooth.each_ref().map(|t| self.forward.pictures(frames, t, LOOK.quality));
        let (a, b, target) = (a?, b?, self.target());
        let one = |i: usize| {
            let pairs = a[i].data.iter().zip(&b[i].data);
            let mut data: Vec<f32> = pairs.map(|(a, b)| a - b).collect();
            hide(target, frames[i], &mut data);
            pooled(&data, a[i].width, a[i].height, LOOK.block)
        };
        Ok((0..frames.len()).map(one).collect())
    }
}

/// What parameters do to the frames, to first order at the solution, and what members of the set do there: products of
/// the derivatives, in units of the parameters' steps, and of the differences that the members make.
struct Doings {
    all: Vec<P>,
    /// Behind the parameters.
    members: Vec<&'static str>,
    a: Vec<Vec<f64>>,
}

impl Doings {
    /// How much of what the members `out` do is left that the parameters `by` cannot do: squares, weighted.
    fn left(&self, out: &[&str], by: &[P]) -> f64 {
        let members = self.members.iter().enumerate().filter(|(_, m)| out.contains(m));
        let moved: Vec<usize> = members.map(|(k, _)| self.all.len() + k).collect();
        let with = |i: usize| moved.iter().map(|&j| self.a[i][j]).sum::<f64>();
        let whole: f64 = moved.iter().map(|&i| with(i)).sum();
        let at: Vec<usize> =
            (0..self.all.len()).filter(|&i| by.contains(&self.all[i]) && self.a[i][i] > 0.0).collect();
        let a: Vec<Vec<f64>> = at.iter().map(|&i| at.iter().map(|&j| self.a[i][j]).collect()).collect();
        let b: Vec<f64> = at.iter().map(|&i| with(i)).collect();
        let done = solve(&a, &b, 1e-6).map_or(0.0, |x| x.iter().zip(&b).map(|(x, b)| x * b).sum::<f64>());
        (whole - done).max(0.0)
    }

    /// Of the candidates `others` those that do, beside `rest`, most of what the members `out` do; the most like first.
    fn alike(&self, out: &[&str], rest: &[&'static str], others: &[&'static str]) -> Vec<&'static str> {
        let held = crate::diagnose::expect::model::free(rest);
        let without = self.left(out, &held);
        let like = |name: &&'static str| {
            let by: Vec<P> = held.iter().chain(candidate_of(name).parameters).copied().collect();
            (*name, 1.0 - self.left(out, &by) / without.max(1e-12))
        };
        let mut alike: Vec<_> = others.iter().map(like).filter(|a| a.1 > RESEMBLES).collect();
        alike.sort_by(|a, b| b.1.total_cmp(&a.1));
        tracing::info!("like {out:?} beside {rest:?}: {alike:?}");
        alike.into_iter().take(MOST).map(|a| a.0).collect()
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
