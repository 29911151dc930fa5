//! Which effects do the same on these frames: a class is named by its simplest member, and the others are its
//! alternatives.
//!
//! A black level lightens what is dark as glare does; an exposure delays what it blurs. What the normal equations
//! promise says which candidates resemble a member of the set; whether they explain the frames as well is decided by
//! fits and scores, as every other question is.

use super::candidates::MOST_OF_IT;
use super::doings::Doings;
use super::found::Found;
use super::support::restored;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::model::{P, Theta, candidate_of, is_discrete, mixes_pixels, moves};
use crate::diagnose::expect::room::{Room, is_description, is_in_surfaces};
use crate::diagnose::expect::tone::Tone;
use crate::diagnose::fit::{FINE, VALUES};
use crate::diagnose::judge::{Scores, gain};
use crate::diagnose::search::{Search, Tried};
use shutterbug::chain::{ParamKind, Work};
use shutterbug::effects;
use shutterbug::error::Result;

/// A set that does what another one does.
struct Other {
    set: Vec<&'static str>,
    fit: Fit,
    scores: Scores,
}

/// How another set compares with the one that was found.
enum Compared {
    Rather(Other),
    AsGood,
    Worse,
}

/// Parameters of an effect that delay the picture, and by which part of their value on average.
fn delays_of(name: &str) -> impl Iterator<Item = (P, f64)> {
    candidate_of(name).parameters.iter().filter_map(|&p| Some((p, p.delays()?)))
}

/// Numbers of some effects.
fn size(names: &[&str]) -> usize {
    names.iter().map(|n| candidate_of(n).size()).sum()
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
            self.outdone.push(sorted(&found.set, None));
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
        self.two_for_two(&members, &doings, found, now)
    }

    /// Keeps which candidates that move the picture explained more than which others, when both were tried beside the
    /// same set: beside another one the weaker may be taken, and stands for the stronger where rounded values have no
    /// slopes to tell them by.
    pub(super) fn remember_rivals(&mut self, now: &Scores, options: &[Tried]) {
        let counts = |o: &&Tried| moves(candidate_of(o.0)) && self.may_change(o.0) && self.gains(now, &o.2);
        let moved: Vec<&Tried> = options.iter().filter(counts).collect();
        let pairs = moved.iter().flat_map(|a| moved.iter().map(move |b| (a, b)));
        let better = pairs.filter(|(a, b)| b.2.mean() < a.2.mean()).map(|(a, b)| [a.0, b.0]);
        let new: Vec<_> = better.filter(|pair| !self.rivals.contains(pair)).collect();
        self.rivals.extend(new);
    }

    /// Whether slopes say what an effect does, and the frames themselves do not say that it is there.
    pub(crate) fn may_change(&self, name: &str) -> bool {
        let candidate = candidate_of(name);
        let plain = !candidate.noise && !is_discrete(candidate) && !is_description(name);
        plain && !self.is_known(name) && name != "flicker"
    }

    /// Whether a candidate may take the place of a member of the set.
    fn may_come(&self, name: &str, set: &[&'static str]) -> bool {
        !set.contains(&name) && self.may_change(name) && !is_in_surfaces(name, set)
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
        let beside = |n: &&'static str| self.may_come(n, &found.set) && moves(candidate_of(n)) == kind;
        let others: Vec<_> = self.names.iter().copied().filter(beside).collect();
        let mut alike = doings.alike(out, &rest, &others);
        alike.extend(self.choices_like(out, &found.set));
        let rivals = self.rivals.iter().filter(|r| *out == [r[0]]).map(|r| r[1]);
        let rivals: Vec<_> = rivals.filter(|n| beside(n) && !alike.contains(n)).collect();
        alike.extend(rivals);
        let delays = self.delays_like(out).into_iter().filter(|n| beside(n));
        let more: Vec<_> = delays.filter(|n| !alike.contains(n)).collect();
        alike.extend(self.delaying_as(out, &more, (&found.fit.theta, &start), now)?);
        for name in alike {
            if self.late() {
                return Ok(None);
            }
            let mut set = rest.clone();
            set.push(name);
            let fit = self.add(candidate_of(name), &rest, &start)?;
            // What comes to nothing there says that nothing may do as well.
            let nothing = is_as_given(name, &fit.theta, &self.base);
            if nothing {
                set.pop();
            }
            let other = self.under_its_noise(set, fit, moves(candidate_of(name)))?;
            let by = if nothing { "nothing" } else { name };
            tracing::info!("{by} in place of {out:?}: {:.4} for {:.4} DN", other.scores.mean(), now.mean());
            let simpler = nothing || out.len() > 1 || size(&[name]) < size(out);
            match (self.compare(other, found, now, (simpler, size(&[name]) == size(out)))?, out) {
                (Compared::Rather(other), _) => return Ok(Some(other)),
                (Compared::AsGood, [member]) if !nothing => {
                    found.alternatives.entry(member).or_default().push(name);
                }
                _ => {}
            }
        }
        Ok(None)
    }

    /// The best two candidates in the place of two members that change values: where two were taken for two others, no
    /// exchange of one for one leads there.
    fn two_for_two(
        &mut self,
        members: &[&'static str],
        doings: &Doings,
        found: &Found,
        now: &Scores,
    ) -> Result<Option<Other>> {
        let plain = |n: &&'static str| self.may_change(n) && !moves(candidate_of(n));
        let beside = |n: &&'static str| plain(n) && self.may_come(n, &found.set);
        let others: Vec<_> = self.names.iter().copied().filter(beside).collect();
        let members: Vec<_> = members.iter().copied().filter(plain).collect();
        for swap in doings.swaps(&alike_pairs(&members), &alike_pairs(&others), &found.set) {
            if self.late() {
                return Ok(None);
            }
            let mut set: Vec<_> = found.set.iter().copied().filter(|n| !swap.out.contains(n)).collect();
            set.extend(&swap.by);
            let start = swap
                .out
                .iter()
                .fold(found.fit.theta.clone(), |t, n| restored(&t, &self.base, candidate_of(n)));
            let start = swap.steps.iter().fold(start, |t, &(p, step)| {
                let value = t.get(p) + step * p.spec().step;
                t.with(p, value)
            });
            let start = self.forward.bounded(start);
            let fit = self.refit(&set, &start, VALUES)?;
            let other = self.under_its_noise(set, fit, false)?;
            tracing::info!("{swap:?}: {:.4} for {:.4} DN", other.scores.mean(), now.mean());
            let (by, out) = (size(&swap.by), size(&swap.out));
            if let Compared::Rather(other) = self.compare(other, found, now, (by < out, by == out))? {
                return Ok(Some(other));
            }
        }
        Ok(None)
    }

    /// A set with the noise that shows beside it: it was fitted under that of what it replaces, which moves means that
    /// are bent otherwise.
    fn under_its_noise(&mut self, set: Vec<&'static str>, mut fit: Fit, moves: bool) -> Result<Other> {
        if !moves && Tone::new(&fit.theta).is_noisy() {
            fit = self.refit(&set, &fit.theta, VALUES)?;
            fit.theta = self.with_noise(&fit.theta)?;
        }
        let scores = self.judge.scores(self.forward, &fit.theta)?;
        Ok(Other { set, fit, scores })
    }

    /// Whether another set is taken: where it explains more, or as much with less. As simple and as good: what scores
    /// better is named, the other is its alternative.
    fn compare(
        &mut self,
        other: Other,
        found: &Found,
        now: &Scores,
        (simpler, as_simple): (bool, bool),
    ) -> Result<Compared> {
        let worse = self.prefers(&other.fit.theta, &found.fit.theta)?;
        let better = self.prefers(&found.fit.theta, &other.fit.theta)?;
        let open = !worse && !better && !simpler && as_simple;
        let ahead = open && self.is_ahead(&other, &found.fit.theta, now)?;
        if better || (!worse && simpler) || ahead {
            let fit = self.refit(&other.set, &other.fit.theta, FINE)?;
            let scores = self.judge.scores(self.forward, &fit.theta)?;
            if !self.prefers(&fit.theta, &found.fit.theta)? {
                return Ok(Compared::Rather(Other { set: other.set, fit, scores }));
            }
            return Ok(Compared::Worse);
        }
        Ok(if worse { Compared::Worse } else { Compared::AsGood })
    }

    /// Whether another model of as many numbers scores better. The frames that both were fitted to count as those to
    /// choose by do: neither could follow them more closely than the other. Where the description is free it could.
    fn is_ahead(&mut self, other: &Other, found: &Theta, now: &Scores) -> Result<bool> {
        let sum = |a: &Scores, b: &Scores| gain(a, b).value * a.0.len() as f64;
        let chosen = sum(now, &other.scores);
        if [found, &other.fit.theta].iter().any(|t| t.room != Room::default()) {
            return Ok(chosen > 0.0);
        }
        let frames = self.fit_frames();
        let [a, b] = [found, &other.fit.theta].map(|t| self.judge.scores_on(self.forward, t, frames));
        let fitted = sum(&a?, &b?);
        tracing::info!("ahead by {chosen:.4} DN on the frames to choose by, by {fitted:.4} on those to fit");
        Ok(chosen + fitted > 0.0)
    }

    /// What delays as a member `out` does: an exposure delays what it blurs by half of itself, and a readout by what it
    /// takes to come to a line. What a short step does to few samples a pixel hides that.
    fn delays_like(&self, out: &[&'static str]) -> Vec<&'static str> {
        let delays = |n: &&'static str| candidate_of(n).parameters.iter().any(|p| p.is_time());
        if out.len() != 1 || !out.iter().all(delays) {
            return Vec::new();
        }
        self.names.iter().copied().filter(delays).collect()
    }

    /// Those of some candidates that explain most of what the members `out` explain where they delay as those do on
    /// average, with nothing else changed. What does the same in the end begins there.
    fn delaying_as(
        &mut self,
        out: &[&'static str],
        names: &[&'static str],
        (found, without): (&Theta, &Theta),
        now: &Scores,
    ) -> Result<Vec<&'static str>> {
        if names.is_empty() {
            return Ok(Vec::new());
        }
        let delay = |(p, part): (P, f64)| part * (found.get(p) - self.base.get(p));
        let delay_s: f64 = out.iter().flat_map(|n| delays_of(n)).map(delay).sum();
        let nothing = self.judge.scores(self.forward, without)?.mean();
        let mut all = Vec::new();
        for &name in names {
            let Some(like) = self.delayed(name, delay_s, without) else { continue };
            let like = self.judge.scores(self.forward, &like)?.mean();
            if nothing - like > MOST_OF_IT * (nothing - now.mean()) {
                all.push(name);
            }
        }
        tracing::info!("of {names:?} as {out:?} delay {all:?}");
        Ok(all)
    }

    /// `theta` with an effect that delays the picture by so much on average; none if it would have to be negative.
    fn delayed(&self, name: &str, delay_s: f64, theta: &Theta) -> Option<Theta> {
        let mut like = theta.clone();
        for (p, part) in delays_of(name) {
            let value = self.base.get(p) + delay_s / part;
            if p != P::Offset && value < 0.0 {
                return None;
            }
            like.set(p, value);
        }
        Some(self.forward.bounded(like))
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
}

/// Whether an effect was fitted to what the given camera has: to nothing, where that has none. How wide a filter of no
/// strength is does not count.
pub(super) fn is_as_given(name: &str, theta: &Theta, base: &Theta) -> bool {
    let counts = |p: &P| p.spec().fit.rest.is_none();
    candidate_of(name).parameters.iter().copied().filter(counts).all(|p| theta.get(p) == base.get(p))
}

/// The members of a set, with one more or none, in an order that does not depend on how they came.
pub(super) fn sorted(set: &[&'static str], more: Option<&'static str>) -> Vec<&'static str> {
    let mut all: Vec<_> = set.iter().copied().chain(more).collect();
    all.sort_unstable();
    all
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_of_no_strength_is_nothing_however_wide() {
        let base = Theta::neutral();
        let sharpening = base.with(P::Radius, 0.77);
        assert!(is_as_given("sharpening", &sharpening, &base));
        assert!(!is_as_given("sharpening", &sharpening.with(P::Sharpen, 0.1), &base));
        assert!(!is_as_given("lens_distortion", &base.with(P::K2, 0.1), &base), "one of two counts");
        assert!(!is_as_given("sharpening", &base, &base.with(P::Sharpen, 0.5)), "the given camera sharpens");
    }

    #[test]
    fn sets_are_alike_in_whatever_order_they_came() {
        assert_eq!(sorted(&["gamma", "defocus"], None), sorted(&["defocus"], Some("gamma")));
        assert_ne!(sorted(&["gamma"], None), sorted(&["defocus"], Some("gamma")));
    }
}
