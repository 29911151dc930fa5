//! The end of a search: parameters that are freed last, and which kinds of noise there are.

use std::collections::BTreeMap;

use super::fit::{FILTERS, FINE};
use super::forward::Quality;
use super::judge::Scores;
use super::model::{P, Theta, candidate_of};
use super::noise::{NOISES, NoiseData};
use super::placed::placed;
use super::residue::{MOST_SPREAD, outliers, residue, solved};
use super::score::FAMILIES;
use super::search::{Found, Search, is_discrete, last_of};
use super::support::{LEAST_DIFFERENCE, LEAST_SHARE, is_a_filter, restored};
use crate::error::Result;
use crate::plane::Plane;

/// Share of a family's own score that a kind of noise must be worth there, where its worth in the whole score is small.
const FAMILY_SHARE: f64 = 0.03;
/// Standard errors that read noise beside shot noise, and the reverse, must stand above none, on frames to fit as on
/// held-out ones.
const SIGNIFICANT: f64 = 3.5;

/// What correct renderers may make of a colour, as a gain: a tenth of a DN in the middle of the range.
const COLOURS: f64 = 1.0015;
/// Stuck pixels that are named whatever they are worth.
const FEWEST_STUCK: usize = 8;

/// Whether rows, a fixed pattern or the spread of single values stand out of the other noise, on frames to fit as on held-out
/// ones, `without` a kind of noise and not `with` it: what the score hardly shows beside other noise.
fn stands_out(name: &str, data: [&NoiseData; 2], [without, with]: [&Theta; 2]) -> bool {
    let shows = |d: &NoiseData, theta: &Theta| match name {
        "row_noise" => d.shows(theta)[0],
        "fixed_pattern_noise" => d.shows(theta)[1],
        _ if is_spread(name) => d.misfit(theta).0 > MOST_SPREAD,
        _ => false,
    };
    data.iter().all(|d| shows(d, without) && !shows(d, with))
}

/// Whether a kind of noise is a spread of single values, new in every frame.
fn is_spread(name: &str) -> bool {
    matches!(name, "read_noise" | "shot_noise")
}

impl Search<'_> {
    /// Frees parameters that every fit leaves neutral (tangential distortion), and keeps those that help.
    pub(super) fn free_more(&mut self, found: &mut Found) -> Result<()> {
        let more: Vec<P> = found.set.iter().flat_map(|n| candidate_of(n).more.iter().copied()).collect();
        if more.is_empty() {
            return Ok(());
        }
        let was = self.judge.scores(self.forward, &found.fit.theta.clone())?;
        let mut free = Self::free(&found.set);
        free.extend(&more);
        let target = self.target();
        let frames = &self.evidence.fit;
        let freed = super::fit::fit(self.forward, target, frames, &found.fit.theta, &free, FINE)?;
        let now = self.judge.scores(self.forward, &freed.theta)?;
        let (gain, [low, _]) = self.judge.gain(&was, &now);
        tracing::info!("with {more:?}: {:.3} to {:.3} DN", was.mean(), now.mean());
        if low > 0.0 && gain > LEAST_SHARE * was.mean() && gain > LEAST_DIFFERENCE * self.renderer_difference
        {
            found.fit.theta = freed.theta;
            found.more = more;
        }
        Ok(())
    }

    /// Fits filters, and all other values with them, once more to pictures of more samples.
    pub(super) fn sharpen(&mut self, found: &mut Found) -> Result<()> {
        if !["sharpening", "defocus"].iter().any(|n| found.set.contains(n)) {
            return Ok(());
        }
        let mut free = Self::free(&found.set);
        free.retain(|p| !p.is_time() && !p.is_remap());
        let target = self.target();
        let fit =
            super::fit::fit(self.forward, target, &self.evidence.fit, &found.fit.theta, &free, FILTERS)?;
        found.fit.theta = fit.theta;
        Ok(())
    }

    /// Chooses anew among qualities and patterns, now that the rest fits.
    pub(super) fn tune_choices(&mut self, found: &mut Found) -> Result<()> {
        for name in found.set.clone() {
            let candidate = candidate_of(name);
            if is_discrete(candidate) {
                found.fit.theta = self.add_discrete(candidate, &found.fit.theta.clone())?.theta;
                found.fit.half.insert(candidate.parameters[0], 1.0);
            }
        }
        Ok(())
    }

    /// Takes out what only coarse renders made look useful.
    pub(super) fn prune_finely(&mut self, found: &mut Found) -> Result<()> {
        let before = self.judge.scores(self.forward, &self.base.clone())?;
        while !found.set.is_empty() {
            let now = self.judge.scores(self.forward, &found.fit.theta.clone())?;
            let mut weakest: Option<(usize, Theta, f64)> = None;
            for i in 0..found.set.len() {
                let (fit, scores) = self.pruned(&found.set, i, &found.fit.theta)?;
                let worse = scores.mean();
                let name = found.set[i];
                let periodic = name != "flicker"
                    || super::flicker::is_periodic(self.forward, self.evidence, &found.fit.theta)?;
                let supported = if self.is_known(name) {
                    self.judge.gain(&scores, &now).1[0] > 0.0
                } else {
                    self.supports(name, &before, &scores, &now)
                };
                let needed = supported && periodic && !is_a_filter(name, &found.fit.theta);
                if !needed && weakest.as_ref().is_none_or(|w| worse < w.2) {
                    weakest = Some((i, fit.theta, worse));
                }
            }
            let Some((i, theta, gap)) = weakest else { break };
            tracing::info!("at last drops {}: {gap:.3} DN without, {:.3} with", found.set[i], now.mean());
            found.set.remove(i);
            found.fit.theta = theta;
            self.refit_to_the_end(found)?;
        }
        Ok(())
    }

    /// Decides which kinds of noise are there: all that can be, less those that nothing is lost without.
    pub(super) fn choose_noise(&mut self, found: &mut Found) -> Result<()> {
        let mut names: Vec<&'static str> = NOISES.into_iter().filter(|n| self.names.contains(n)).collect();
        let fitted = found.fit.theta.clone();
        let means = self.forward.simulate(&self.evidence.fit, &fitted, self.judge.quality)?;
        self.judge.keep_stuck(&self.evidence.fit, &means);
        let data = self.noise_data(&fitted, &self.evidence.fit)?;
        let held_out = self.noise_data(&fitted, &self.evidence.held_out)?;
        tracing::debug!("noise {data:?}");
        let theta = self.noisy(&data, &found.fit.theta, &names);
        names.retain(|n| candidate_of(n).parameters.iter().any(|&p| theta.get(p) > self.base.get(p)));
        let mut theta = self.noisy(&data, &found.fit.theta, &names);
        let mut scores = self.judge.scores(self.forward, &theta)?;
        // Of what the mean leaves: beside a rolling shutter's gap all noise is little.
        let silent = self.noisy(&data, &found.fit.theta, &[]);
        let gap = (self.judge.scores(self.forward, &silent)?.mean() - scores.floor()).max(0.0);
        let clear = |theta: &Theta| {
            let [a, b] = [&data, &held_out].map(|d| d.significance(theta, &self.base));
            [a[0].min(b[0]) > SIGNIFICANT, a[1].min(b[1]) > SIGNIFICANT]
        };
        loop {
            let [read, shot] = clear(&theta);
            // How the spread grows with brightness is not known well enough behind compression, which takes more of it
            // where there is less: there the score decides.
            let told = !found.fit.theta.is_on(P::Quality);
            let both = told && names.contains(&"read_noise") && names.contains(&"shot_noise");
            let mut weakest: Option<(usize, Theta, Scores)> = None;
            for i in 0..names.len() {
                let rest: Vec<_> = names.iter().copied().filter(|n| *n != names[i]).collect();
                let without = self.noisy(&data, &found.fit.theta, &rest);
                let rest_scores = self.judge.scores(self.forward, &without)?;
                let needed = match names[i] {
                    "read_noise" if both => read,
                    "shot_noise" if both => shot,
                    "hot_pixels" if !names.contains(&"fixed_pattern_noise") => {
                        self.are_stuck(gap, &rest_scores, &scores)
                    }
                    name => {
                        let stands_out = told && stands_out(name, [&data, &held_out], [&without, &theta]);
                        let (gain, [low, _]) = self.judge.gain(&rest_scores, &scores);
                        // Beside strong noise of rows the score says little of single values, whose spread is plain.
                        let gains = stands_out && if is_spread(name) { gain > 0.0 } else { low > 0.0 };
                        gains || self.noise_counts(gap, &rest_scores, &scores)
                    }
                };
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
        self.noise_intervals(&names, &theta, found)?;
        found.fit.theta = theta;
        found.set.extend(names);
        Ok(())
    }

    /// Takes out what the noise, now that it is known, has made superfluous: what was taken beside other noise may have stood for
    /// that (chroma shared in pairs behind a compression, for the noise of rows).
    pub(super) fn prune_beside_noise(&mut self, found: &mut Found) -> Result<()> {
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
            found.set.remove(i);
            found.fit.theta = theta;
            self.refit_to_the_end(found)?;
            self.choose_noise_anew(found)?;
        }
    }

    /// Decides once more which kinds of noise there are, after the set has become another.
    pub(super) fn choose_noise_anew(&mut self, found: &mut Found) -> Result<()> {
        found.set.retain(|n| !candidate_of(n).noise);
        self.choose_noise(found)
    }

    /// What the set leaves on held-out frames, see [`super::residue`].
    pub(super) fn look_at_the_rest(&mut self, found: &mut Found) -> Result<()> {
        let theta = &found.fit.theta.clone();
        let held = &self.evidence.held_out;
        let mut means = self.forward.simulate(held, theta, Quality::Fine)?;
        let coarser = self.forward.simulate(held, theta, Quality::Fit)?;
        found.sampling_dn = difference(&means, &coarser);
        if theta.is_on(P::Quality) {
            // A colour that is off by a tenth of a DN may be off by a step of the quantizer.
            let brighter = theta.with(P::Gain, theta.get(P::Gain) * COLOURS);
            let brighter = self.forward.simulate(held, &brighter, Quality::Fine)?;
            found.sampling_dn = found.sampling_dn.max(difference(&means, &brighter));
        }
        // What is stuck is far off for a model that has none, and no sign of anything else.
        let bare = theta.get(P::Hot) == 0.0;
        let far = bare.then(|| outliers(self.evidence, held, &means, self.judge.masks, theta));
        means.iter_mut().for_each(|m| self.judge.hot.put(m));
        let left = self.noise_data(theta, held)?;
        found.residue = residue(self.evidence, held, &means, self.masks, &left, theta);
        let before = self.forward.simulate(held, &self.base.clone(), Quality::Fine)?;
        found.residue.smear = self.smear(held, &means, theta).unwrap_or_default();
        found.residue.outliers =
            far.unwrap_or_else(|| outliers(self.evidence, held, &means, self.judge.masks, theta));
        found.residue.solved = solved(self.evidence, held, [&before, &means], self.masks, theta);
        found.residue.placed = placed(self.evidence, held, [&before, &means], self.masks);
        tracing::info!("left: {:?}, renders differ by {:.3} DN", found.residue, found.sampling_dn);
        Ok(())
    }

    fn noisy(&self, data: &NoiseData, theta: &Theta, names: &[&str]) -> Theta {
        let mut noisy = data.fit(theta, &self.base, names);
        if names.contains(&"hot_pixels") {
            noisy.set(P::Hot, self.judge.hot.fraction());
        }
        noisy
    }

    /// Whether stuck pixels are worth naming: where things move, what stays bright in all frames is nothing else.
    fn are_stuck(&self, gap: f64, worse: &Scores, better: &Scores) -> bool {
        let moves = self.names.iter().any(|n| candidate_of(n).needs_motion);
        let clear = moves && self.judge.hot.count() >= FEWEST_STUCK;
        (clear && self.judge.gain(worse, better).1[0] > 0.0) || self.noise_counts(gap, worse, better)
    }

    /// Whether a kind of noise is worth naming: in the whole score, or in a family of statistics that shows it best.
    fn noise_counts(&self, gap: f64, worse: &Scores, better: &Scores) -> bool {
        let (gain, [low, _]) = self.judge.gain(worse, better);
        if low > 0.0 && gain > LEAST_SHARE * gap && gain > (0.01 * worse.mean()).max(0.03) {
            return true;
        }
        let clear = |family: usize| {
            let own = worse.0.iter().filter_map(|s| s.families[family]).map(|f| f[0]).sum::<f64>()
                / worse.0.len().max(1) as f64;
            let (gain, [low, _]) = self.judge.family_gain(worse, better, family);
            low > 0.0 && gain > FAMILY_SHARE * own && gain > 0.05
        };
        gain > 0.0 && (0..FAMILIES.len()).any(clear)
    }

    /// Half widths of the parameters that change the mean.
    pub(super) fn mean_intervals(&mut self, found: &mut Found) -> Result<()> {
        let (free, target) = (found.free(), self.target());
        let last = last_of(&free);
        let (frames, level) = (&self.evidence.fit, &last[last.len() - 1]);
        self.forward.native = false;
        let mut half =
            super::intervals::intervals(self.forward, target, frames, &found.fit.theta, &free, level)?;
        if let (Some(&f), Some(&c)) = (half.get(&P::FlickerF), half.get(&P::FlickerC)) {
            // A phase counts from time 0, and the frequency is off all the way from there.
            let (depth, middle_s) = (
                found.fit.theta.get(P::FlickerC).hypot(found.fit.theta.get(P::FlickerS)),
                self.forward.middle_s(),
            );
            half.insert(P::FlickerS, c.hypot(depth * std::f64::consts::TAU * f * middle_s));
        }
        self.forward.native = true;
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
        let frames = super::fit::spread_out(&self.evidence.fit, 6);
        let means = self.forward.simulate(&frames, theta, self.judge.quality)?;
        let masks = Some(self.masks);
        let whole = NoiseData::measure(self.evidence, &frames, &means, theta, masks);
        let known = whole.errors(theta, names);
        let mut spread: BTreeMap<P, Vec<f64>> = BTreeMap::new();
        for i in 0..frames.len() {
            let rest = |j: &usize| *j != i;
            let rest_frames: Vec<_> = (0..frames.len()).filter(rest).map(|j| frames[j]).collect();
            let rest_means: Vec<_> = (0..frames.len()).filter(rest).map(|j| means[j].clone()).collect();
            let part = NoiseData::measure(self.evidence, &rest_frames, &rest_means, theta, masks);
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
                // What compression removes of noise is known from flat fields: where it removes most of it the model was
                // seen to be off by up to 13 %.
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

/// Mean absolute difference of pictures, DN.
fn difference(a: &[Plane<f32>], b: &[Plane<f32>]) -> f64 {
    let sum: f64 = a
        .iter()
        .zip(b)
        .map(|(a, b)| {
            let pixels = a.data.iter().zip(&b.data).map(|(a, b)| f64::from((a - b).abs()));
            pixels.sum::<f64>() / a.data.len() as f64
        })
        .sum();
    sum / a.len().max(1) as f64
}
