//! A round of a search: which candidates are worth a fit beside a set, and what they come to.

use std::collections::BTreeMap;
use std::time::Instant;

use super::exchange::sorted;
use super::{NEARLY_ALL, probe};
use crate::diagnose::evidence::budget::in_time;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::model::{CandidateSpec, P, candidate_of, free, is_discrete};
use crate::diagnose::expect::room::{is_description, is_in_surfaces};
use crate::diagnose::expect::tone::Tone;
use crate::diagnose::fit::cost::Level;
use crate::diagnose::fit::intervals::Slopes;
use crate::diagnose::fit::normal::screened;
use crate::diagnose::fit::starts::is_hopeful;
use crate::diagnose::judge::Scores;
use crate::diagnose::search::{Search, Tried, Watch};
use shutterbug::error::Result;

/// Candidates that get a joint fit in each round after the first.
const MOST_JOINT_FITS: usize = 4;
/// Candidates that slopes may tell nothing of: what they change is where a shaking camera was at another time, or how
/// bright a lamp was, whose frequency is not known yet.
const FAR_FROM_LINEAR: [&str; 3] = ["time_offset", "rolling_shutter", "flicker"];
/// Candidates that promise less than this share of what the best one promises wait, if that one gains.
const WAITS_BELOW: f64 = 0.25;

impl Search<'_> {
    pub(super) fn log(&self, name: &str, fit: &Fit, scores: &Scores, clock: Instant) {
        let parameters = fit.theta.report(candidate_of(name), &BTreeMap::new());
        let values: Vec<String> = parameters.iter().map(|(k, v)| format!("{k} {}", v.value)).collect();
        let (count, spent_s) = self.forward.renders_made();
        tracing::info!(
            "{name}: {:.3} DN ({:.3}) in {:.1} s, {} [{count} renders, {spent_s:.1} s]",
            scores.mean(),
            scores.floor(),
            clock.elapsed().as_secs_f64(),
            values.join(", ")
        );
    }

    /// Candidates that a round asks of.
    pub(super) fn left_beside(&self, set: &[&'static str]) -> Vec<&'static str> {
        let beside = |n: &&str| !set.contains(n) && !candidate_of(n).noise && !is_in_surfaces(n, set);
        let open = |n: &&'static str| !self.outdone.contains(&sorted(set, Some(n)));
        self.names.iter().copied().filter(beside).filter(open).collect()
    }

    /// Candidates beside the set: ranked by what the linearised model promises, the best of them fitted jointly, and
    /// what may be wrong with the description early, so that what promises little beside that waits.
    pub(crate) fn round(
        &mut self,
        watch: &mut dyn Watch,
        set: &[&'static str],
        current: &Fit,
        now: &Scores,
        late: &mut Vec<&'static str>,
    ) -> Result<Vec<Tried>> {
        let (smooth, rest): (Vec<_>, Vec<_>) =
            self.left_beside(set).into_iter().partition(|n| !is_discrete(candidate_of(n)));
        // At most: what promises nothing is not fitted.
        let most = 1 + MOST_JOINT_FITS + FAR_FROM_LINEAR.len() + rest.len();
        watch.stage(&format!("candidates beside {}", set.join(" + ")), most);
        watch.step("which of them promise most");
        let Some(ranked) = in_time(self.shortlist(set, current, &smooth))? else {
            late.extend(smooth.into_iter().chain(rest));
            return Ok(Vec::new());
        };
        let mut out = self.by_promise(watch, (set, current, now), &ranked, late)?;
        if out.iter().any(|tried| !is_description(tried.0) && closes_nearly_all(now, tried)) {
            return Ok(out);
        }
        let ranked: Vec<_> = ranked.into_iter().map(|r| r.0).collect();
        let waiting = self.may_wait(current, &out)?;
        let waits = |name: &&str| waiting.contains(name);
        for name in
            FAR_FROM_LINEAR.into_iter().filter(|n| smooth.contains(n) && !ranked.contains(n) && !waits(n))
        {
            let (target, candidate) = (self.target(), candidate_of(name));
            let hopeful = is_hopeful(self.forward, target, self.evidence, &current.theta, candidate);
            if in_time(hopeful)?.unwrap_or(true) {
                out.extend(self.beside(watch, name, set, current, late)?);
            }
        }
        for name in rest.into_iter().filter(|n| !waits(n)) {
            out.extend(self.beside(watch, name, set, current, late)?);
        }
        let idle = out.iter().filter(|o| o.2.mean() >= now.mean()).map(|o| o.0);
        self.idle = idle.chain(waiting.iter().copied()).collect();
        Ok(out)
    }

    /// Fits of candidates in the order of what they promise, the description behind the first. What promises little
    /// beside one that keeps its promise waits; a promise that its fit did not keep makes nothing wait.
    fn by_promise(
        &mut self,
        watch: &mut dyn Watch,
        (set, current, now): (&[&'static str], &Fit, &Scores),
        ranked: &[(&'static str, f64)],
        late: &mut Vec<&'static str>,
    ) -> Result<Vec<Tried>> {
        let mut out: Vec<Tried> = Vec::new();
        let mut most: f64 = 0.0;
        for (place, &(name, promised)) in ranked.iter().enumerate() {
            if promised < WAITS_BELOW * most {
                tracing::info!("{name} waits for the next round");
                continue;
            }
            let tried = self.beside(watch, name, set, current, late)?;
            if tried.as_ref().is_some_and(|tried| self.gains(now, &tried.2)) {
                most = most.max(promised);
            }
            out.extend(tried);
            if place == 0 {
                let described = self.described(watch, (set, current), now, &out)?;
                let gained = described.iter().filter(|o| self.gains(now, &o.2));
                most = gained.map(|o| 1.0 - o.2.mean() / now.mean()).fold(most, f64::max);
                out.extend(described);
            }
        }
        if ranked.is_empty() {
            out.extend(self.described(watch, (set, current), now, &out)?);
        }
        Ok(out)
    }

    /// What may be wrong with the description, fitted beside a set, unless a candidate closes nearly all.
    pub(super) fn described(
        &mut self,
        watch: &mut dyn Watch,
        (set, current): (&[&'static str], &Fit),
        now: &Scores,
        tried: &[Tried],
    ) -> Result<Vec<Tried>> {
        if best_of(tried).is_some_and(|best| closes_nearly_all(now, best)) {
            return Ok(Vec::new());
        }
        let beside = self.description_beside(watch, set, &current.theta, now);
        Ok(in_time(beside)?.unwrap_or_default())
    }

    /// Candidates that explained nothing beside a part of this set, where another one explains something: they are
    /// asked again when that is in the set, in the last round at the latest.
    fn may_wait(&mut self, current: &Fit, tried: &[Tried]) -> Result<Vec<&'static str>> {
        let Some((_, best, _)) = best_of(tried).filter(|_| !self.idle.is_empty()) else {
            return Ok(Vec::new());
        };
        let explains = in_time(self.prefers(&current.theta, &best.theta))?.unwrap_or(false);
        Ok(if explains { self.idle.clone() } else { Vec::new() })
    }

    /// Fits a candidate beside the set and scores it, unless there is no more time.
    fn beside(
        &mut self,
        watch: &mut dyn Watch,
        name: &'static str,
        set: &[&'static str],
        current: &Fit,
        late: &mut Vec<&'static str>,
    ) -> Result<Option<Tried>> {
        watch.step(name);
        let clock = Instant::now();
        let mut work = || -> Result<(Fit, Scores)> {
            self.forward.budget.go_on()?;
            let fit = self.add(candidate_of(name), set, &current.theta)?;
            let scores = self.judge.scores(self.forward, &fit.theta)?;
            Ok((fit, scores))
        };
        let Some((fit, scores)) = in_time(work())? else {
            late.push(name);
            return Ok(None);
        };
        self.log(name, &fit, &scores, clock);
        Ok(Some((name, fit, scores)))
    }

    fn shortlist(
        &mut self,
        set: &[&'static str],
        current: &Fit,
        smooth: &[&'static str],
    ) -> Result<Vec<(&'static str, f64)>> {
        let held = free(set);
        let groups: Vec<Vec<P>> = smooth.iter().map(|n| candidate_of(n).parameters.to_vec()).collect();
        let mut all: Vec<P> = held.iter().chain(groups.iter().flatten()).copied().collect();
        all.sort();
        all.dedup();
        let level = Level { block: 2, iterations: 0, quality: Quality::Fit, frames: 4 };
        let (target, probe) = (self.target(), probe(&current.theta));
        let slopes = Slopes::at(self.forward, target, self.fit_frames(), &probe, &all, &level)?;
        let gains = screened(slopes.equations(), &all, &held, &groups);
        let mut ranked: Vec<_> = smooth.iter().copied().zip(gains).collect();
        let by_promise = |a: &(&str, f64), b: &(&str, f64)| b.1.total_cmp(&a.1);
        ranked.sort_by(by_promise);
        tracing::info!("ranking beside {set:?}: {:?}", &ranked[..ranked.len().min(6)]);
        // What one step would not move beyond chance and discrepancy is not rendered for.
        ranked.retain(|(name, _)| self.would_move(&slopes, &all, &held, candidate_of(name)));
        self.rank_as_alone(&mut ranked, &current.theta, smooth)?;
        ranked.sort_by(by_promise);
        ranked.truncate(MOST_JOINT_FITS);
        tracing::info!("worth a fit: {ranked:?}");
        Ok(ranked)
    }

    /// Whether a step from none would move a candidate beside `held` by more than chance and discrepancy can.
    fn would_move(&self, slopes: &Slopes, all: &[P], held: &[P], candidate: &CandidateSpec) -> bool {
        let a = &slopes.equations().a;
        let places = |p: &P| all.iter().position(|a| a == p).filter(|&i| a[i][i] > 0.0);
        let own: Vec<usize> = candidate.parameters.iter().filter_map(places).collect();
        if own.is_empty() {
            return false;
        }
        let mut of: Vec<usize> = held.iter().filter_map(places).chain(own).collect();
        of.sort_unstable();
        of.dedup();
        slopes.step(&of).is_none_or(|way| way.share > way.half)
    }
}

/// The option that leaves least.
fn best_of(options: &[Tried]) -> Option<&Tried> {
    options.iter().min_by(|a, b| a.2.mean().total_cmp(&b.2.mean()))
}

/// Whether a candidate closes so much of what is left that whatever else there is shows better beside it. A time offset
/// may be nothing but the delay of an exposure, which promises about as much.
fn closes_nearly_all(now: &Scores, (name, fit, scores): &Tried) -> bool {
    // What is left may have been taken for noise, which no model is then far from.
    if Tone::new(&fit.theta).is_noisy() {
        return false;
    }
    let closed = now.mean() - scores.mean();
    *name != "time_offset" && closed > NEARLY_ALL * (now.mean() - scores.floor())
}
