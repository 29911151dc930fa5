//! The end of a search: parameters that are freed last, and which kinds of noise there are.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::exchange::sorted;
use super::found::{FINER, FITS, Found, INTERVALS, REST};
use super::support::restored;
use crate::diagnose::evidence::budget::{Budgeted, Stage, in_time};
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::model::{P, Theta, candidate_of, free, is_discrete, moves};
use crate::diagnose::expect::room::{Room, is_description};
use crate::diagnose::fit::{FILTERS, FINE};
use crate::diagnose::judge::noise::{NOISES, NoiseData};
use crate::diagnose::judge::placed::placed;
use crate::diagnose::judge::residue::{Residue, outliers, residue, solved};
use crate::diagnose::judge::smear::smear;
use crate::diagnose::judge::{Scores, gains_more_than_is_left};
use crate::diagnose::search::decide::are_far_off;
use crate::diagnose::search::{Search, Watch, finest_of, last_of};
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// How often a set is exchanged and grows: each time it explains more.
const MOST_EXCHANGES: usize = 3;

impl Search<'_> {
    /// The last fit of the mean, then the noise: which kinds of it, and how much. What there is no time for is left
    /// out; only what is scored at the end always is.
    pub(crate) fn finish(&mut self, found: &mut Found, watch: &mut dyn Watch) -> Result<()> {
        let searched = !self.late() && found.late.is_empty() && found.left_out.is_empty();
        self.forward.budget.enter(Stage::End);
        self.forward.forget_tries();
        let fitted = if searched { self.fit_to_the_end(found, watch) } else { Ok(()) };
        if in_time(fitted)?.is_none() || !searched {
            found.leave_out(FITS);
        }
        watch.step("noise");
        if in_time(self.noise_and_rest(found))?.is_none() {
            let open = |n: &&str| self.names.contains(n) && !found.set.contains(n);
            let noises: Vec<_> = NOISES.into_iter().filter(open).collect();
            noises.into_iter().for_each(|n| found.is_late(n));
            found.residue = Residue::unseen();
            found.leave_out(REST);
        }
        watch.step("intervals");
        if in_time(self.mean_intervals(found))?.is_none() {
            found.leave_out(INTERVALS);
        }
        watch.step("scores");
        // Before and after in the same places.
        self.judge.kind = found.fit.theta.room.kind();
        let report = &self.evidence.report;
        if self.forward.budget.affords(report.len(), Quality::Fine) {
            (self.judge.quality, self.forward.native) = (Quality::Fine, true);
        } else {
            (self.judge.quality, self.forward.native) = (Quality::Fit, false);
            found.leave_out(FINER);
        }
        found.quality = self.judge.quality;
        self.within(Stage::Must, |search| {
            found.before = search.judge.scores_on(search.forward, &search.base.clone(), report)?;
            found.after = search.judge.scores_on(search.forward, &found.fit.theta, report)?;
            Ok(())
        })
    }

    /// What only makes a set better that is nearly right.
    fn fit_to_the_end(&mut self, found: &mut Found, watch: &mut dyn Watch) -> Result<()> {
        if !found.set.is_empty() {
            self.tune_choices(found)?;
            self.exchange_and_grow(found, watch)?;
            self.free_more(found)?;
            self.refit_to_the_end(found)?;
            self.tune_choices(found)?;
            self.sharpen(found)?;
        }
        self.judge.quality = finest_of(&found.fit.theta);
        self.prune_finely(found)?;
        self.drop_what_is_at_an_end(found)
    }

    /// Takes a member out, `theta` being a fit without it, and fits the others to the end.
    fn take_out(&mut self, found: &mut Found, i: usize, theta: Theta) -> Result<()> {
        let name = found.set.remove(i);
        found.more.retain(|p| !candidate_of(name).more.contains(p));
        found.fit.theta = theta;
        self.refit_to_the_end(found)
    }

    /// Takes out members that were fitted to the end of their range, as long as others are left: what is beside them
    /// can be named, and is fitted without them. The one that costs least goes first. What moves photographs by a
    /// camera at rest is judged by where things come to lie: the verdict asks for that alone.
    fn drop_what_is_at_an_end(&mut self, found: &mut Found) -> Result<()> {
        while found.set.len() > 1 {
            let mut weakest: Option<(usize, Theta, f64)> = None;
            for i in found.at_an_end() {
                if self.forward.static_camera && moves(candidate_of(found.set[i])) {
                    continue;
                }
                let (fit, scores) = self.pruned(&found.set, i, &found.fit.theta)?;
                if weakest.as_ref().is_none_or(|w| scores.mean() < w.2) {
                    weakest = Some((i, fit.theta, scores.mean()));
                }
            }
            let Some((i, theta, gap)) = weakest else { break };
            tracing::info!("drops {}, at the end of its range: {gap:.3} DN without", found.set[i]);
            self.take_out(found, i, theta)?;
        }
        Ok(())
    }

    /// Exchanges members of the set. What explained nothing beside the set that the search came to may do so beside the
    /// one that it was exchanged for: a blur shows beside a readout, and not beside the delay that stood for both.
    fn exchange_and_grow(&mut self, found: &mut Found, watch: &mut dyn Watch) -> Result<()> {
        for _ in 0..MOST_EXCHANGES {
            let before = found.set.clone();
            self.exchange(found)?;
            // Round and round: what it grew into was exchanged before.
            let seen = self.outdone.contains(&sorted(&found.set, None));
            if found.set == before || seen || self.late() {
                break;
            }
            let exchanged = found.set.clone();
            let scores = self.judge.scores(self.forward, &found.fit.theta.clone())?;
            self.grow(found, (exchanged.len(), scores), &[], watch)?;
            if found.set == exchanged {
                break;
            }
        }
        Ok(())
    }

    fn noise_and_rest(&mut self, found: &mut Found) -> Result<()> {
        (self.judge.quality, self.forward.native) = (Quality::Fine, true);
        self.choose_noise(found)?;
        self.prune_beside_noise(found)?;
        self.look_at_the_rest(found)
    }

    /// Frees parameters that every fit leaves neutral (tangential distortion), and keeps those that help.
    pub(crate) fn free_more(&mut self, found: &mut Found) -> Result<()> {
        let more: Vec<P> = found.set.iter().flat_map(|n| candidate_of(n).more.iter().copied()).collect();
        if more.is_empty() {
            return Ok(());
        }
        let was = self.judge.scores(self.forward, &found.fit.theta.clone())?;
        let mut free = free(&found.set);
        free.extend(&more);
        let target = self.target();
        let frames = &self.evidence.fit;
        let freed = crate::diagnose::fit::fit(self.forward, target, frames, &found.fit.theta, &free, FINE)?;
        let now = self.judge.scores(self.forward, &freed.theta)?;
        tracing::info!("with {more:?}: {:.3} to {:.3} DN", was.mean(), now.mean());
        if self.prefers(&found.fit.theta, &freed.theta)? {
            found.fit.theta = freed.theta;
            found.more = more;
        }
        Ok(())
    }

    /// Fits filters, and all other values with them, once more to pictures of more samples.
    pub(crate) fn sharpen(&mut self, found: &mut Found) -> Result<()> {
        if !["sharpening", "defocus"].iter().any(|n| found.set.contains(n)) {
            return Ok(());
        }
        let mut free = free(&found.set);
        free.retain(|p| !p.is_time() && !p.is_remap());
        let target = self.target();
        let fit = crate::diagnose::fit::fit(
            self.forward,
            target,
            &self.evidence.fit,
            &found.fit.theta,
            &free,
            FILTERS,
        )?;
        found.fit.theta = fit.theta;
        Ok(())
    }

    /// Chooses anew among qualities and patterns, now that the rest fits.
    pub(crate) fn tune_choices(&mut self, found: &mut Found) -> Result<()> {
        let set = found.set.clone();
        for name in &set {
            let candidate = candidate_of(name);
            if is_discrete(candidate) {
                found.fit.theta = self.add_discrete(candidate, &set, &found.fit.theta.clone())?.theta;
                found.fit.half.insert(candidate.parameters[0], 1.0);
            }
        }
        Ok(())
    }

    /// Takes out what only coarse renders made look useful.
    ///
    /// The description is questioned only where the rest leaves more than the discrepancy can make: a part of it
    /// without which nothing is left beyond that goes, however much better the frames are met with it. And an effect
    /// without which more is left than the discrepancy can make, and with which no more is, stays: the verdict would
    /// ask for it.
    pub(crate) fn prune_finely(&mut self, found: &mut Found) -> Result<()> {
        while !found.set.is_empty() {
            let now = self.judge.scores(self.forward, &found.fit.theta.clone())?;
            let passes = now.beyond_bounds().is_empty();
            let mut weakest: Option<(usize, Theta, f64)> = None;
            for i in 0..found.set.len() {
                let name = found.set[i];
                let (fit, scores) = self.pruned(&found.set, i, &found.fit.theta)?;
                let enough = scores.beyond_bounds().is_empty();
                // What the frames show by themselves needs a score that does not speak against it.
                let known = self.is_known(name) && now.mean() <= scores.mean();
                let needed = match (is_description(name), passes && !enough) {
                    _ if known => true,
                    (true, _) if enough => false,
                    (false, true) => self.is_there(found, name)?,
                    _ => self.prefers(&fit.theta, &found.fit.theta)? && self.is_there(found, name)?,
                };
                if !needed && weakest.as_ref().is_none_or(|w| scores.mean() < w.2) {
                    weakest = Some((i, fit.theta, scores.mean()));
                }
            }
            let Some((i, theta, gap)) = weakest else { break };
            tracing::info!("at last drops {}: {gap:.3} DN without, {:.3} with", found.set[i], now.mean());
            self.take_out(found, i, theta)?;
        }
        Ok(())
    }

    /// Whether a member of the set is what its name says.
    fn is_there(&mut self, found: &Found, name: &str) -> Result<bool> {
        let (masks, theta) = (Some(self.masks), &found.fit.theta);
        Ok(name != "flicker"
            || crate::diagnose::fit::flicker::is_periodic(self.forward, self.evidence, masks, theta)?)
    }

    /// Decides which kinds of noise are there: all that can be, less those that nothing is lost without.
    pub(crate) fn choose_noise(&mut self, found: &mut Found) -> Result<()> {
        let mut names: Vec<&'static str> = NOISES.into_iter().filter(|n| self.names.contains(n)).collect();
        let fitted = found.fit.theta.clone();
        // What stuck pixels stand above is simulated without any.
        let bare = fitted.with(P::Hot, 0.0).with(P::Quality, 0.0);
        let means = self.forward.simulate(&self.evidence.fit, &bare, self.judge.quality)?;
        self.judge.keep_stuck(&self.evidence.fit, &means, fitted.file());
        self.forward.hold_stuck(self.judge.hot.places());
        let data = self.noise_data(&fitted, &self.evidence.fit)?;
        let unseen = self.noise_data(&fitted, &self.evidence.choose)?;
        tracing::debug!("noise {data:?}");
        let theta = self.noisy(&data, &found.fit.theta, &names);
        names.retain(|n| candidate_of(n).parameters.iter().any(|&p| theta.get(p) > self.base.get(p)));
        self.keep_what_a_file_lacks(&mut names, &data, &found.fit.theta)?;
        let mut theta = self.noisy(&data, &found.fit.theta, &names);
        let mut scores = self.judge.scores(self.forward, &theta)?;
        let described = theta.room != Room::default();
        loop {
            let mut weakest: Option<(usize, Theta, Scores)> = None;
            for i in 0..names.len() {
                let rest: Vec<_> = names.iter().copied().filter(|n| *n != names[i]).collect();
                let without = self.noisy(&data, &found.fit.theta, &rest);
                let rest_scores = self.judge.scores(self.forward, &without)?;
                // What factors and poses leave at edges spreads as noise does: noise that explains less than is left
                // may be that.
                let clear = !described || gains_more_than_is_left(&rest_scores, &scores);
                let better = self.prefers_noise(&unseen, &without, &theta)? && clear;
                let needed =
                    better || (names[i] == "hot_pixels" && self.stuck_are_missed(&without, &theta)?);
                tracing::info!(
                    "without {}: {:.4}, with {:.4}: {needed}",
                    names[i],
                    rest_scores.mean(),
                    scores.mean()
                );
                if !needed && weakest.as_ref().is_none_or(|w| rest_scores.mean() < w.2.mean()) {
                    weakest = Some((i, without, rest_scores));
                }
            }
            let Some((i, without, rest_scores)) = weakest else { break };
            names.remove(i);
            (theta, scores) = (without, rest_scores);
        }
        // Noise that may as well be none is not named, however its neighbours in the score have turned out.
        loop {
            self.noise_intervals(&names, &theta, found)?;
            let clear = |n: &&str| self.is_clear_of_none(candidate_of(n).parameters, &theta, &found.fit);
            let rest: Vec<&'static str> = names.iter().copied().filter(clear).collect();
            if rest.len() == names.len() {
                break;
            }
            tracing::info!("of {names:?} only {rest:?} have an interval without none");
            theta = self.noisy(&data, &found.fit.theta, &rest);
            names = rest;
        }
        found.fit.theta = theta;
        found.set.extend(names);
        Ok(())
    }

    /// Leaves noise ahead of a file away where nothing lies beyond what correct simulations may differ by without it:
    /// what these do otherwise takes coefficients to other steps, as noise does.
    fn keep_what_a_file_lacks(
        &mut self,
        names: &mut Vec<&'static str>,
        data: &NoiseData,
        fitted: &Theta,
    ) -> Result<()> {
        if names.is_empty() || fitted.file().is_none() {
            return Ok(());
        }
        let silent = self.noisy(data, fitted, &[]);
        if self.judge.scores(self.forward, &silent)?.beyond_bounds().is_empty() {
            tracing::info!("no noise of {names:?}: the file alone leaves nothing beyond its bounds");
            names.retain(|n| *n == "hot_pixels");
        }
        Ok(())
    }

    /// Whether the verdict would ask for stuck pixels: values are far off without them, and none with them. Where few
    /// places are compared, too few of them are stuck to make a difference to the score.
    fn stuck_are_missed(&mut self, without: &Theta, with: &Theta) -> Result<bool> {
        Ok(self.leaves_far_off(without)? && !self.leaves_far_off(with)?)
    }

    /// Whether values of the frames to choose by lie far from those of `theta`.
    fn leaves_far_off(&mut self, theta: &Theta) -> Result<bool> {
        let frames = &self.evidence.choose;
        let mut means = self.forward.simulate(frames, theta, self.judge.quality)?;
        if theta.is_on(P::Hot) {
            means.iter_mut().for_each(|m| self.judge.hot.put(m));
        }
        Ok(are_far_off(self.outliers(frames, &means, theta), theta))
    }

    /// Share of values of frames that lie far from `means`, where the judge compares.
    fn outliers(&self, frames: &[usize], means: &[Plane<f32>], theta: &Theta) -> f64 {
        let masks = self.forward.masked(self.judge.masks, theta.room.kind());
        let given = self.forward.outside.is_some();
        outliers(self.evidence, frames, means, masks.as_deref(), theta, given)
    }

    /// Whether the interval of one of some parameters leaves out the given camera's value.
    fn is_clear_of_none(&self, parameters: &[P], theta: &Theta, fit: &Fit) -> bool {
        let half = |p: &P| fit.half.get(p).copied().unwrap_or(0.0);
        parameters.iter().any(|p| (theta.get(*p) - self.base.get(*p)).abs() > half(p))
    }

    /// Takes out what the noise, now that it is known, has made superfluous: what was taken beside other noise may have
    /// stood for that (chroma shared in pairs behind a compression, for the noise of rows).
    pub(crate) fn prune_beside_noise(&mut self, found: &mut Found) -> Result<()> {
        loop {
            let now = self.judge.scores(self.forward, &found.fit.theta.clone())?.mean();
            let mut least: Option<(f64, usize, Theta)> = None;
            for i in (0..found.set.len()).filter(|&i| !candidate_of(found.set[i]).noise) {
                if self.is_known(found.set[i]) {
                    continue;
                }
                let theta = restored(&found.fit.theta, &self.base, candidate_of(found.set[i]));
                let without = self.judge.scores(self.forward, &theta)?.mean();
                if without <= now && least.as_ref().is_none_or(|l| without < l.0) {
                    least = Some((without, i, theta));
                }
            }
            let Some((without, i, theta)) = least else { return Ok(()) };
            tracing::info!("beside the noise drops {}: {without:.4} DN without, {now:.4} with", found.set[i]);
            self.take_out(found, i, theta)?;
            self.choose_noise_anew(found)?;
        }
    }

    /// Decides once more which kinds of noise there are, after the set has become another.
    pub(crate) fn choose_noise_anew(&mut self, found: &mut Found) -> Result<()> {
        found.set.retain(|n| !candidate_of(n).noise);
        self.choose_noise(found)
    }

    /// What the set leaves on the frames to report by, see [`crate::diagnose::judge::residue`].
    pub(crate) fn look_at_the_rest(&mut self, found: &mut Found) -> Result<()> {
        let theta = &found.fit.theta.clone();
        let frames = &self.evidence.report;
        let mut means = self.forward.simulate(frames, theta, Quality::Fine)?;
        let masks = self.forward.masked(Some(self.masks), theta.room.kind());
        let masks = masks.as_deref().expect("there were some");
        // What is stuck is far off for a model that has none, and no sign of anything else.
        let bare = theta.get(P::Hot) == 0.0;
        let far = bare.then(|| self.outliers(frames, &means, theta));
        means.iter_mut().for_each(|m| self.judge.hot.put(m));
        let left = self.noise_data(theta, frames)?;
        found.residue = residue(self.evidence, frames, &means, masks, &left, theta);
        let before = self.forward.simulate(frames, &self.base.clone(), Quality::Fine)?;
        // Whether or not an exposure is among the candidates: left out of them it must not be sold as something else.
        if self.names.iter().any(|n| candidate_of(n).needs_motion) {
            let velocity: Vec<_> = frames.iter().map(|&at| self.forward.velocity(at, theta)).collect();
            let seen = smear(self.evidence, frames, &means, self.masks, &velocity);
            found.residue.smear = seen.unwrap_or_default();
        }
        found.residue.outliers = far.unwrap_or_else(|| self.outliers(frames, &means, theta));
        found.residue.solved = solved(self.evidence, frames, [&before, &means], masks, theta);
        found.residue.placed = placed(self.evidence, frames, [&before, &means], masks);
        if theta.room.radiance {
            found.residue.by_value = self.forward.by_value(&self.evidence.fit, theta)?;
        }
        tracing::info!("left: {:?}", found.residue);
        Ok(())
    }

    /// `theta` with these kinds of noise as they were measured.
    pub(crate) fn noisy(&self, data: &NoiseData, theta: &Theta, names: &[&str]) -> Theta {
        let mut noisy = data.fit(theta, &self.base, names);
        if names.contains(&"hot_pixels") {
            noisy.set(P::Hot, self.judge.hot.fraction());
        }
        noisy
    }

    /// Half widths of the parameters that change the mean.
    pub(crate) fn mean_intervals(&mut self, found: &mut Found) -> Result<()> {
        let (free, target) = (found.free(), self.target());
        let last = last_of(&free);
        let (frames, level) = (&self.evidence.fit, &last[last.len() - 1]);
        self.forward.native = false;
        let half = crate::diagnose::fit::intervals::intervals(
            self.forward,
            target,
            frames,
            &found.fit.theta,
            &free,
            level,
        );
        self.forward.native = true;
        let mut half = half?;
        if let (Some(&f), Some(&c)) = (half.get(&P::FlickerF), half.get(&P::FlickerC)) {
            // A phase counts from time 0, and the frequency is off all the way from there.
            let (depth, middle_s) = (
                found.fit.theta.get(P::FlickerC).hypot(found.fit.theta.get(P::FlickerS)),
                self.forward.middle_s(),
            );
            half.insert(P::FlickerS, c.hypot(depth * std::f64::consts::TAU * f * middle_s));
        }
        found.fit.half.extend(half);
        Ok(())
    }

    /// Half widths of the noise parameters, by leaving out one frame at a time (jackknife).
    fn noise_intervals(&mut self, names: &[&'static str], theta: &Theta, found: &mut Found) -> Result<()> {
        let parameters: Vec<P> =
            names.iter().flat_map(|n| candidate_of(n).parameters.iter().copied()).collect();
        if parameters.is_empty() {
            return Ok(());
        }
        let frames = crate::diagnose::evidence::spread_out(&self.evidence.fit, 6);
        let means = self.forward.pictures(&frames, theta, self.judge.quality)?;
        let ahead = self.ahead_of_steps(&frames, theta)?;
        let masks = Some(self.masks);
        let whole = NoiseData::measure(self.evidence, &frames, &means, ahead.as_deref(), theta, masks);
        let known = whole.errors(theta, names);
        let mut spread: BTreeMap<P, Vec<f64>> = BTreeMap::new();
        for i in 0..frames.len() {
            let rest = |j: &usize| *j != i;
            let rest_frames: Vec<_> = (0..frames.len()).filter(rest).map(|j| frames[j]).collect();
            let others = |of: &Vec<Arc<Plane<f32>>>| -> Vec<_> {
                (0..frames.len()).filter(rest).map(|j| of[j].clone()).collect()
            };
            let (rest_means, rest_ahead) = (others(&means), ahead.as_ref().map(others));
            let ahead = rest_ahead.as_deref();
            let part = NoiseData::measure(self.evidence, &rest_frames, &rest_means, ahead, theta, masks);
            let part = part.fit(theta, &self.base, names);
            parameters.iter().for_each(|&p| spread.entry(p).or_default().push(part.get(p)));
        }
        for (p, values) in spread {
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() * (n - 1.0) / n;
            let half = match p {
                // Single pixels are found or not.
                P::Hot => {
                    0.04 * theta.get(p) + 2.0 * theta.get(p) / (self.judge.hot.count().max(1) as f64).sqrt()
                }
                // What compression removes of noise is known from flat fields: where it removes most of it the model
                // was seen to be off by up to 13 %.
                P::Read | P::Shot | P::Dsnu | P::Prnu if theta.is_on(P::Quality) => {
                    let chance = 2.4 * variance.sqrt().hypot(known.get(&p).copied().unwrap_or(0.0));
                    chance.hypot(0.15 * theta.get(p))
                }
                // A pattern is the same in all frames, and a bin of brightness is off by the same in all of them: that
                // comes from the bins. The flatness rule leaves a per cent beyond.
                _ => 2.4 * variance.sqrt().hypot(known.get(&p).copied().unwrap_or(0.0)) + 0.01 * theta.get(p),
            };
            found.fit.half.insert(p, half);
        }
        Ok(())
    }
}
