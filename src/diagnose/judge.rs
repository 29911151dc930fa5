//! Scores of parameters on held-out frames, and whether a gain is beyond chance.

use std::collections::HashMap;

use rayon::prelude::*;

use super::evidence::{BLOCK, Evidence};
use super::forward::{Forward, Quality};
use super::hot::HotMap;
use super::model::{P, Theta};
use super::score::{FrameScore, Scored, score_frame};
use super::tone::Tone;
use crate::chain::rng::{random_bits, seed_words};
use crate::error::Result;
use crate::plane::Plane;

/// Resamples of the bootstrap.
pub(super) const RESAMPLES: usize = 1000;

/// Stream of the resamples ("BS").
const STREAM_BOOTSTRAP: u32 = 0x4253;

/// Scores on the held-out frames, one per frame in the order of [`Evidence::held_out`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scores(pub Vec<FrameScore>);

impl Scores {
    pub(super) fn mean(&self) -> f64 {
        self.0.iter().map(|s| s.score).sum::<f64>() / self.0.len().max(1) as f64
    }

    pub(super) fn floor(&self) -> f64 {
        self.0.iter().map(|s| s.expected).sum::<f64>() / self.0.len().max(1) as f64
    }
}

/// Scores parameters on held-out frames; keeps what it has scored.
pub(super) struct Judge<'a> {
    pub evidence: &'a Evidence,
    pub masks: Option<&'a [Plane<f32>]>,
    pub seed: u64,
    /// Pixels that are stuck, for models that have such.
    pub hot: HotMap,
    /// How well the frames to be judged are rendered.
    pub quality: Quality,
    known: HashMap<String, Scores>,
}

impl<'a> Judge<'a> {
    pub(super) fn new(
        evidence: &'a Evidence,
        masks: Option<&'a [Plane<f32>]>,
        seed: u64,
        hot: HotMap,
    ) -> Self {
        Self { evidence, masks, seed, hot, quality: Quality::Fit, known: HashMap::new() }
    }

    /// Keeps the stuck pixels that stand above these means of `frames` (places) too.
    pub(super) fn keep_stuck(&mut self, frames: &[usize], means: &[Plane<f32>]) {
        let count = self.hot.count();
        self.hot.keep_above(self.evidence, frames, means);
        if self.hot.count() < count {
            self.known.clear();
        }
    }

    /// Scores of `theta` on the held-out frames.
    pub(super) fn scores(&mut self, forward: &mut Forward, theta: &Theta) -> Result<Scores> {
        let key = format!("{:?} {theta:?}", self.quality);
        if let Some(known) = self.known.get(&key) {
            return Ok(known.clone());
        }
        let scores = self.scores_on(forward, theta, &self.evidence.held_out.clone())?;
        self.known.insert(key, scores.clone());
        Ok(scores)
    }

    /// Scores of `theta` on any frames (places).
    pub(super) fn scores_on(&self, forward: &mut Forward, theta: &Theta, frames: &[usize]) -> Result<Scores> {
        let mut means = forward.simulate(frames, theta, self.quality)?;
        if theta.get(P::Hot) > 0.0 {
            means.iter_mut().for_each(|m| self.hot.put(m));
        }
        let tone = Tone::new(theta);
        let flips = forward.flips(frames, theta, self.quality)?;
        let scored: Vec<_> = frames
            .iter()
            .zip(&means)
            .enumerate()
            .map(|(i, (&at, mean))| Scored {
                real: &self.evidence.frames[at].dn,
                mean,
                mask: self.masks.map(|m| &m[at]),
                dithered: self.evidence.dithered,
                flips: flips.get(i),
            })
            .collect();
        let scores = (0..frames.len())
            .into_par_iter()
            .map(|i| {
                let follows = i > 0
                    && self.evidence.frames[frames[i]].index == self.evidence.frames[frames[i - 1]].index + 1;
                score_frame(&scored[i], follows.then(|| &scored[i - 1]), &tone)
            })
            .collect();
        Ok(Scores(scores))
    }

    /// Indices into the held-out frames, resampled by blocks; the same for every call with one seed.
    fn resamples(&self) -> Vec<Vec<usize>> {
        let count = self.evidence.held_out.len();
        // Blocks as they were held out; single frames where there are too few blocks to resample.
        let size = if count >= 4 * BLOCK { BLOCK } else { 1 };
        let blocks = count.div_ceil(size);
        let seed = seed_words(self.seed);
        (0..RESAMPLES)
            .map(|r| {
                (0..blocks)
                    .flat_map(|b| {
                        let bits = random_bits([b as u32, r as u32], 0, STREAM_BOOTSTRAP, seed)[0];
                        let block = ((u64::from(bits) * blocks as u64) >> 32) as usize;
                        (block * size..((block + 1) * size).min(count)).collect::<Vec<_>>()
                    })
                    .collect()
            })
            .collect()
    }

    /// 95 % interval of the mean of a figure of each held-out frame.
    pub(super) fn interval(&self, f: impl Fn(usize) -> f64) -> [f64; 2] {
        let means = self.resamples().into_iter().map(|r| mean(&r, &f));
        quantiles(means.collect())
    }

    /// Sorted resamples of the closed fraction.
    pub(super) fn closed_fractions(&self, before: &Scores, after: &Scores) -> Vec<f64> {
        let one = |r: Vec<usize>| {
            let (b, a) = (mean(&r, |i| before.0[i].score), mean(&r, |i| after.0[i].score));
            closed_fraction(b, a, mean(&r, |i| after.0[i].expected))
        };
        let mut all: Vec<f64> = self.resamples().into_iter().map(one).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    /// Gain of one family of statistics, and its interval.
    pub(super) fn family_gain(&self, worse: &Scores, better: &Scores, family: usize) -> (f64, [f64; 2]) {
        let of = |s: &Scores, i: usize| s.0[i].families[family].map_or(0.0, |f| f[0]);
        let all: Vec<usize> = (0..worse.0.len()).collect();
        let gain = |i: usize| of(worse, i) - of(better, i);
        (mean(&all, gain), self.interval(gain))
    }

    /// Gain from `worse` to `better` and its interval.
    pub(super) fn gain(&self, worse: &Scores, better: &Scores) -> (f64, [f64; 2]) {
        let gain = |i: usize| worse.0[i].score - better.0[i].score;
        (worse.mean() - better.mean(), self.interval(gain))
    }
}

/// What is left of a gap, DN. A floor far above `after` is a model that expects more spread than there is: as wrong as one
/// that expects less. Within some per cent a floor is no better known than that: noise in the dark is no normal distribution.
pub(super) fn unexplained(after: f64, floor: f64) -> f64 {
    if after < floor { (floor - after - FLOOR_ERROR * floor).max(0.0) } else { after - floor }
}

/// How well a floor is known.
const FLOOR_ERROR: f64 = 0.15;

/// See [`super::Gap::closed_fraction`].
pub(super) fn closed_fraction(before: f64, after: f64, floor: f64) -> f64 {
    let rest = unexplained(after, floor);
    let whole = before - floor.min(after);
    if whole <= 1e-9 { 0.0 } else { (1.0 - rest / whole).clamp(0.0, 1.0) }
}

fn mean(indices: &[usize], f: impl Fn(usize) -> f64) -> f64 {
    indices.iter().map(|&i| f(i)).sum::<f64>() / indices.len().max(1) as f64
}

/// 2.5 and 97.5 per cent.
pub(super) fn quantiles(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
    [at(0.025), at(0.975)]
}
