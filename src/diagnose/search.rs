//! Which candidates explain the gap: each alone, then sets by forward selection with pruning, refitted jointly.

use std::collections::BTreeMap;

use super::evidence::Evidence;
use super::fit::{Fit, Schedule, Target, fit};
use super::forward::Forward;
use super::judge::{Judge, Scores};
use super::model::{CANDIDATES, CandidateSpec, P, Theta, candidate_of};
use super::noise::NoiseData;
use super::starts::best_starts;
use crate::error::Result;
use crate::plane::Plane;

/// Least share of the gap that an effect must be worth.
const LEAST_SHARE: f64 = 0.01;
/// Least share of what would remain unexplained: a cause that leaves nearly everything unexplained is none.
const LEAST_OF_REST: f64 = 0.05;
/// A simpler candidate is preferred to one that gains less than this share more.
const PARSIMONY: f64 = 0.02;
/// Most effects of a set.
const MOST_EFFECTS: usize = 7;
/// Candidates that get a joint fit in each round after the first.
const SHORTLIST: usize = 4;

/// Where the search stands, for people who wait.
pub(super) trait Watch {
    /// A stage began: its name, and how many steps it has.
    fn stage(&mut self, name: &str, steps: usize);
    /// A step of the stage is about to be taken.
    fn step(&mut self, what: &str);
}

/// A candidate fitted alone.
#[derive(Clone, Debug)]
pub(super) struct Alone {
    pub name: &'static str,
    pub fit: Fit,
    pub scores: Scores,
}

/// The outcome of a search.
pub(super) struct Found {
    /// In the order in which they were taken.
    pub set: Vec<&'static str>,
    pub fit: Fit,
    pub alone: Vec<Alone>,
    pub before: Scores,
    pub after: Scores,
}

/// All that a search works on.
pub(super) struct Search<'a> {
    pub forward: &'a mut Forward,
    pub judge: Judge<'a>,
    pub evidence: &'a Evidence,
    pub masks: Option<&'a [Plane<f32>]>,
    /// The camera as given.
    pub base: Theta,
    /// What two correct renderers may differ by, DN.
    pub renderer_difference: f64,
    /// Candidates that are considered.
    pub names: Vec<&'static str>,
    /// Whether intervals of noise parameters are wanted: they cost time.
    pub intervals: bool,
}

impl Search<'_> {
    /// Continuous parameters of a set that change the mean.
    fn free(set: &[&'static str]) -> Vec<P> {
        let discrete = |p: &P| matches!(p, P::Quality | P::Chroma | P::Mosaic);
        set.iter()
            .map(|n| candidate_of(n))
            .filter(|c| !c.noise)
            .flat_map(|c| c.parameters.iter().copied())
            .filter(|p| !discrete(p))
            .collect()
    }

    /// Fits a set jointly from a start.
    pub(super) fn refit(&mut self, set: &[&'static str], start: &Theta, schedule: Schedule) -> Result<Fit> {
        let free = Self::free(set);
        let mut found = if free.is_empty() {
            Fit { theta: start.clone(), cost: 0.0, half: BTreeMap::new() }
        } else {
            let target = Target { evidence: self.evidence, masks: self.masks };
            fit(self.forward, &target, &self.evidence.fit, start, &free, schedule)?
        };
        if set.iter().any(|n| candidate_of(n).noise) {
            self.fit_noise(set, &mut found)?;
        }
        Ok(found)
    }

    /// Noise of a set, from the differences that its mean leaves; half widths from single frames.
    fn fit_noise(&mut self, set: &[&'static str], found: &mut Fit) -> Result<()> {
        let noise: Vec<&str> = set.iter().copied().filter(|n| candidate_of(n).noise).collect();
        let frames = &self.evidence.fit;
        let means = self.forward.simulate(frames, &found.theta)?;
        let data = NoiseData::measure(self.evidence, frames, &means, &found.theta, self.masks);
        let theta = data.fit(&found.theta, &noise);
        let parameters: Vec<P> =
            noise.iter().flat_map(|n| candidate_of(n).parameters.iter().copied()).collect();
        let mut spread: BTreeMap<P, Vec<f64>> = BTreeMap::new();
        // Leaving out one frame at a time (jackknife).
        for i in 0..if self.intervals { frames.len() } else { 0 } {
            let rest: Vec<usize> = frames.iter().copied().filter(|f| *f != frames[i]).collect();
            let rest_means: Vec<_> =
                means.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, m)| m.clone()).collect();
            let part = NoiseData::measure(self.evidence, &rest, &rest_means, &found.theta, self.masks)
                .fit(&found.theta, &noise);
            parameters.iter().for_each(|&p| spread.entry(p).or_default().push(part.get(p)));
        }
        for (p, values) in spread {
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() * (n - 1.0) / n;
            // Bins of brightness and the flatness rule leave a per cent beyond what frames tell.
            let half = 2.4 * variance.sqrt() + 0.02 * theta.get(p);
            found.half.insert(p, half);
        }
        found.theta = theta;
        Ok(())
    }

    /// Fits a candidate beside a set. What stays above `worth_dn` after a first look is not looked at further.
    fn add(
        &mut self,
        candidate: &'static CandidateSpec,
        set: &[&'static str],
        theta: &Theta,
        starts: usize,
        worth_dn: Option<f64>,
    ) -> Result<Fit> {
        let mut joint = set.to_vec();
        joint.push(candidate.name);
        if candidate.noise {
            return self.refit(&joint, theta, Schedule::FINE);
        }
        if is_discrete(candidate) {
            return self.add_discrete(candidate, theta);
        }
        let begin = {
            let target = Target { evidence: self.evidence, masks: self.masks };
            best_starts(self.forward, &target, self.evidence, theta, candidate, starts)?
        };
        if let Some(worth) = worth_dn {
            let glance = self.refit(&joint, &begin[0], Schedule::GLANCE)?;
            if self.judge.scores(self.forward, &glance.theta)?.mean() > worth {
                return Ok(glance);
            }
        }
        let mut best: Option<Fit> = None;
        for start in &begin {
            let coarse = self.refit_mean(&joint, start, Schedule::COARSE)?;
            if best.as_ref().is_none_or(|b| coarse.cost < b.cost) {
                best = Some(coarse);
            }
        }
        let start = best.map_or_else(|| theta.clone(), |b| b.theta);
        self.refit(&joint, &start, Schedule::FINE)
    }

    fn refit_mean(&mut self, set: &[&'static str], start: &Theta, schedule: Schedule) -> Result<Fit> {
        let free = Self::free(set);
        let target = Target { evidence: self.evidence, masks: self.masks };
        fit(self.forward, &target, &self.evidence.fit, start, &free, schedule)
    }

    /// Tries the values of a choice, or qualities from coarse to fine.
    fn add_discrete(&mut self, candidate: &'static CandidateSpec, theta: &Theta) -> Result<Fit> {
        let p = candidate.parameters[0];
        let frames = self.evidence.fit.clone();
        let mut best = (f64::INFINITY, theta.clone());
        let mut tried: Vec<i64> = Vec::new();
        let mut attempt = |search: &mut Self, value: f64, best: &mut (f64, Theta)| -> Result<()> {
            let value = value.clamp(1.0, p.spec().range[1]).round();
            if tried.contains(&(value as i64)) {
                return Ok(());
            }
            tried.push(value as i64);
            let trial = theta.with(p, value);
            let target = Target { evidence: search.evidence, masks: search.masks };
            let cost = super::fit::cost_of(search.forward, &target, &frames, &trial, 1, 0.5)?;
            if cost < best.0 {
                *best = (cost, trial);
            }
            Ok(())
        };
        if p == P::Quality {
            for value in [20.0, 40.0, 60.0, 75.0, 85.0, 92.0, 97.0] {
                attempt(self, value, &mut best)?;
            }
            for step in [6.0, 3.0, 2.0, 1.0] {
                let at = best.1.get(p);
                for value in [at - step, at + step] {
                    attempt(self, value, &mut best)?;
                }
            }
        } else {
            for value in 1..=p.spec().range[1] as usize {
                attempt(self, value as f64, &mut best)?;
            }
        }
        Ok(Fit { theta: best.1, cost: best.0, half: BTreeMap::from([(p, 1.0)]) })
    }

    /// Whether a gain counts.
    fn supports(&self, before: f64, worse: &Scores, better: &Scores) -> bool {
        let (gain, [low, _]) = self.judge.gain(worse, better);
        let excess = (better.mean() - better.floor()).max(0.0);
        let unexplained = (excess - self.renderer_difference).max(0.0);
        low > 0.0
            && gain > LEAST_SHARE * before
            && gain > LEAST_OF_REST * unexplained
            && gain > 0.12 * self.renderer_difference
    }

    /// Runs the search.
    pub(super) fn run(&mut self, watch: &mut dyn Watch) -> Result<Found> {
        let before = self.judge.scores(self.forward, &self.base.clone())?;
        let alone = self.each_alone(watch)?;
        let mut set: Vec<&'static str> = Vec::new();
        let mut current = Fit { theta: self.base.clone(), cost: 0.0, half: BTreeMap::new() };
        let mut scores = before.clone();
        for round in 0..MOST_EFFECTS {
            let options = if round == 0 {
                alone.iter().map(|a| (a.name, a.fit.clone(), a.scores.clone())).collect()
            } else {
                self.round(watch, &set, &current, &alone)?
            };
            let Some((name, fit, better)) = self.choose(&before, &scores, options) else { break };
            tracing::info!("takes {name}: {:.3} to {:.3} DN", scores.mean(), better.mean());
            set.push(name);
            (current, scores) = (fit, better);
            self.prune(&before, &mut set, &mut current, &mut scores)?;
        }
        if !set.is_empty() {
            self.intervals = true;
            let last = self.refit(&set, &current.theta.clone(), Schedule::FINE)?;
            self.intervals = false;
            let last_scores = self.judge.scores(self.forward, &last.theta)?;
            if last_scores.mean() <= scores.mean() * 1.001 {
                (current, scores) = (last, last_scores);
            }
        }
        Ok(Found { set, fit: current, alone, before, after: scores })
    }

    fn each_alone(&mut self, watch: &mut dyn Watch) -> Result<Vec<Alone>> {
        watch.stage("each candidate alone", self.names.len());
        let worth_dn = self.judge.scores(self.forward, &self.base.clone())?.mean() * (1.0 - LEAST_SHARE);
        let mut alone = Vec::new();
        for name in self.names.clone() {
            watch.step(name);
            let clock = std::time::Instant::now();
            let base = self.base.clone();
            let fit = self.add(candidate_of(name), &[], &base, 2, Some(worth_dn))?;
            let scores = self.judge.scores(self.forward, &fit.theta)?;
            tracing::info!(
                "{name}: {:.3} DN in {:.1} s, {:?}",
                scores.mean(),
                clock.elapsed().as_secs_f64(),
                fit.theta.report(candidate_of(name), &fit.half)
            );
            alone.push(Alone { name, fit, scores });
        }
        Ok(alone)
    }

    /// Candidates beside the set: all with the set held still at a coarse size, the best of them jointly.
    fn round(
        &mut self,
        watch: &mut dyn Watch,
        set: &[&'static str],
        current: &Fit,
        alone: &[Alone],
    ) -> Result<Vec<(&'static str, Fit, Scores)>> {
        let left: Vec<_> = alone.iter().map(|a| a.name).filter(|n| !set.contains(n)).collect();
        let (smooth, rest): (Vec<_>, Vec<_>) =
            left.into_iter().partition(|n| !candidate_of(n).noise && !is_discrete(candidate_of(n)));
        watch.stage(&format!("candidates beside {}", set.join(" + ")), rest.len() + SHORTLIST + 1);
        watch.step("ranking");
        let held = Self::free(set);
        let groups: Vec<Vec<P>> = smooth.iter().map(|n| candidate_of(n).parameters.to_vec()).collect();
        let target = Target { evidence: self.evidence, masks: self.masks };
        let probe = probe(&current.theta);
        let gains = super::fit::screen(self.forward, &target, &self.evidence.fit, &probe, &held, &groups)?;
        let mut ranked: Vec<_> = smooth.into_iter().zip(gains).collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
        tracing::info!("ranking beside {set:?}: {:?}", &ranked[..ranked.len().min(6)]);
        let now = self.judge.scores(self.forward, &current.theta)?.mean();
        let mut out = Vec::new();
        for (name, _) in ranked.into_iter().take(SHORTLIST) {
            watch.step(name);
            let fit =
                self.add(candidate_of(name), set, &current.theta, 2, Some(now * (1.0 - 0.5 * LEAST_SHARE)))?;
            let scores = self.judge.scores(self.forward, &fit.theta)?;
            out.push((name, fit, scores));
        }
        for name in rest {
            watch.step(name);
            let fit = self.add(candidate_of(name), set, &current.theta, 1, None)?;
            let scores = self.judge.scores(self.forward, &fit.theta)?;
            out.push((name, fit, scores));
        }
        for (name, fit, scores) in &out {
            tracing::info!(
                "  {name} beside {set:?}: {:.3} DN {:?}",
                scores.mean(),
                fit.theta.report(candidate_of(name), &BTreeMap::new())
            );
        }
        Ok(out)
    }

    /// The candidate to take, if any gain counts: the best, or a simpler one that is nearly as good.
    fn choose(
        &self,
        before: &Scores,
        now: &Scores,
        options: Vec<(&'static str, Fit, Scores)>,
    ) -> Option<(&'static str, Fit, Scores)> {
        let gain = |o: &(&'static str, Fit, Scores)| now.mean() - o.2.mean();
        let counted: Vec<_> =
            options.into_iter().filter(|o| self.supports(before.mean(), now, &o.2)).collect();
        let best = counted.iter().map(gain).fold(0.0, f64::max);
        let size = |name: &str| candidate_of(name).parameters.len();
        counted
            .into_iter()
            .filter(|o| gain(o) >= (1.0 - PARSIMONY) * best)
            .min_by(|a, b| size(a.0).cmp(&size(b.0)).then(gain(b).total_cmp(&gain(a))))
    }

    /// Takes out what the others make superfluous.
    fn prune(
        &mut self,
        before: &Scores,
        set: &mut Vec<&'static str>,
        current: &mut Fit,
        scores: &mut Scores,
    ) -> Result<()> {
        while set.len() > 1 {
            let mut weakest: Option<(usize, Fit, Scores)> = None;
            for i in 0..set.len() - 1 {
                let (fit, rest_scores) = self.leave_out(set, i, current)?;
                if !self.supports(before.mean(), &rest_scores, scores)
                    && weakest.as_ref().is_none_or(|w| rest_scores.mean() < w.2.mean())
                {
                    weakest = Some((i, fit, rest_scores));
                }
            }
            let Some((i, fit, rest_scores)) = weakest else { return Ok(()) };
            tracing::info!("drops {}: {:.3} DN without", set[i], rest_scores.mean());
            set.remove(i);
            (*current, *scores) = (fit, rest_scores);
        }
        Ok(())
    }

    /// The set without one effect, the others fitted anew.
    pub(super) fn leave_out(
        &mut self,
        set: &[&'static str],
        i: usize,
        current: &Fit,
    ) -> Result<(Fit, Scores)> {
        let rest: Vec<_> = set.iter().copied().filter(|n| *n != set[i]).collect();
        let start = restored(&current.theta, &self.base, candidate_of(set[i]));
        let fit = self.refit(&rest, &start, Schedule { levels: &[(4, 2), (2, 2), (1, 2)] })?;
        let scores = self.judge.scores(self.forward, &fit.theta)?;
        Ok((fit, scores))
    }
}

/// `theta` with an effect as the given camera has it.
pub(super) fn restored(theta: &Theta, base: &Theta, candidate: &CandidateSpec) -> Theta {
    let mut out = theta.without(candidate);
    for &p in candidate.parameters {
        out.set(p, base.get(p));
    }
    if candidate.name == "rolling_shutter" && base.is_on(P::Readout) {
        out.scan_order = base.scan_order;
    }
    out
}

fn is_discrete(candidate: &CandidateSpec) -> bool {
    matches!(candidate.parameters, [P::Quality] | [P::Chroma] | [P::Mosaic])
}

/// `theta` moved off the places where a parameter has no slope because its partner is neutral.
fn probe(theta: &Theta) -> Theta {
    let mut probe = theta.clone();
    if !theta.is_on(P::Sharpen) {
        probe.set(P::Radius, 1.0);
    }
    probe
}

/// Names of all candidates.
pub(super) fn all_names() -> Vec<&'static str> {
    CANDIDATES.iter().map(|c| c.name).collect()
}
