//! Scores of parameters on frames that no fit has seen, and whether a gain is beyond chance.
//!
//! A search looks at the frames to choose by; the frames to report by are scored once, at the end. Standard errors come
//! from blocks of the picture (see [`score`]): each block, over all frames, counts as one sample.

pub(super) mod hot;
pub(super) mod noise;
pub(super) mod placed;
pub(super) mod residue;
pub(super) mod score;
pub(super) mod smear;

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::description::Kind;
use crate::diagnose::expect::developed::draws_edges;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::tone::Tone;
use hot::HotMap;
use score::{FAMILIES, FrameScore, KeptOf, Scored, score_frame, seen_in};
use shutterbug::chain::rng::{random_bits, seed_words};
use shutterbug::error::Result;
use shutterbug::plane::Plane;
use shutterbug::plane::stats::erf;

/// How often a diagnosis may take something for real that is none, for all that it tries together.
pub(crate) const ALPHA: f64 = 0.01;
/// Resamples of the bootstrap.
pub(crate) const RESAMPLES: usize = 1000;

/// Stream of the resamples ("BS").
const STREAM_BOOTSTRAP: u32 = 0x4253;

/// What a few frames come to: scores, the frames as simulated, and number and sight of the last.
type Part = (Vec<FrameScore>, Vec<Arc<Plane<f32>>>, Option<(usize, KeptOf)>);

/// Scores on some frames, one per frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scores(pub Vec<FrameScore>);

/// A mean over blocks with its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Estimate {
    pub value: f64,
    pub standard_error: f64,
}

impl Estimate {
    /// Of the sum over blocks, each of them one draw.
    pub(crate) fn of(blocks: &[f64]) -> Self {
        let n = blocks.len().max(2) as f64;
        let value: f64 = blocks.iter().sum();
        let variance = blocks.iter().map(|b| (b - value / n).powi(2)).sum::<f64>() * n / (n - 1.0);
        Self { value, standard_error: variance.sqrt() }
    }

    /// Whether it is above 0 beyond chance, where so many are looked at.
    pub(crate) fn is_above(&self, tests: usize) -> bool {
        self.value > quantile(tests) * self.standard_error && self.value > 0.0
    }

    /// 95 % interval.
    pub(crate) fn interval(&self) -> [f64; 2] {
        [-1.96, 1.96].map(|z| self.value + z * self.standard_error)
    }
}

/// Standard errors that one of `tests` normal variables exceeds by chance in [`ALPHA`] of all cases.
pub(crate) fn quantile(tests: usize) -> f64 {
    let most = ALPHA / tests.max(1) as f64;
    let above = |z: f64| 0.5 * (1.0 - erf(z * std::f64::consts::FRAC_1_SQRT_2));
    let (mut low, mut high) = (0.0, 6.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if above(middle) > most { low = middle } else { high = middle }
    }
    high
}

/// The same of the length of a vector of so many normal variables (Wilson and Hilferty 1931).
pub(crate) fn quantile_of_length(tests: usize, dimensions: usize) -> f64 {
    if dimensions <= 1 {
        // Either sign.
        return quantile(2 * tests);
    }
    let n = dimensions as f64;
    let part = 2.0 / (9.0 * n);
    // A length has one side only.
    (n * (1.0 - part + quantile(tests) * part.sqrt()).powi(3)).sqrt()
}

impl Scores {
    fn over(&self, f: impl Fn(&FrameScore) -> f64) -> f64 {
        self.0.iter().map(f).sum::<f64>() / self.0.len().max(1) as f64
    }

    pub(crate) fn mean(&self) -> f64 {
        self.over(|s| s.score)
    }

    pub(crate) fn floor(&self) -> f64 {
        self.over(|s| s.expected)
    }

    /// What the model would score on its own frames, were the discrepancy as large as it may be.
    pub(crate) fn bound(&self) -> f64 {
        self.over(|s| s.bound)
    }

    /// What each block adds to score, expectation and bound: of one family, or of all.
    fn blocks(&self, family: Option<usize>) -> Vec<[f64; 3]> {
        let families: Vec<usize> = family.map_or_else(|| (0..FAMILIES.len()).collect(), |f| vec![f]);
        let count = self.0.iter().flat_map(|s| &s.blocks).map(Vec::len).max().unwrap_or(0);
        let mut out = vec![[0.0; 3]; count];
        let share = 1.0 / self.0.len().max(1) as f64;
        for blocks in self.0.iter().flat_map(|s| families.iter().map(|&f| &s.blocks[f])) {
            for (to, from) in out.iter_mut().zip(blocks) {
                (0..3).for_each(|k| to[k] += share * f64::from(from[k]));
            }
        }
        out
    }

    /// How far a family lies above what the discrepancy may make of it.
    pub(crate) fn excess(&self, family: usize) -> Estimate {
        let blocks = self.blocks(Some(family));
        let seen = blocks.iter().enumerate().filter(|(_, b)| b[0] + b[2] > 0.0);
        self.over_places(seen.map(|(place, b)| (place, b[0] - b[2])).collect(), blocks.len())
    }

    fn rows_of(&self) -> Option<usize> {
        self.0.first().and_then(|s| s.rows_of)
    }

    /// Of the sum over places, see [`Scores::blocks`], of which there are `count` in all. What all blocks of a row have
    /// in common is one draw, where these are scores of a model with noise of rows.
    fn over_places(&self, values: Vec<(usize, f64)>, count: usize) -> Estimate {
        let all = Estimate::of(&values.iter().map(|v| v.1).collect::<Vec<_>>());
        let Some(across) = self.rows_of() else { return all };
        let mut rows: BTreeMap<usize, f64> = BTreeMap::new();
        for (place, value) in values {
            *rows.entry(row_of(place, across, count)).or_default() += value;
        }
        let rows = Estimate::of(&rows.into_values().collect::<Vec<_>>());
        Estimate { standard_error: all.standard_error.max(rows.standard_error), ..all }
    }

    /// Families of statistics that lie above what the model expects where the discrepancy goes as far as it may, beyond
    /// chance.
    pub(crate) fn beyond_bounds(&self) -> Vec<&'static str> {
        let beyond =
            |(f, (name, _)): (usize, &(&'static str, f64))| self.is_beyond_bounds(f).then_some(*name);
        FAMILIES.iter().enumerate().filter_map(beyond).collect()
    }

    /// Whether a family is one of them.
    fn is_beyond_bounds(&self, family: usize) -> bool {
        let excess = self.excess(family);
        let name = FAMILIES[family].0;
        tracing::debug!("{name}: {:+.4} +- {:.4} beyond its bound", excess.value, excess.standard_error);
        excess.is_above(FAMILIES.len())
    }

    /// Whether the whole lies above what the discrepancy may make of it, beyond chance.
    pub(crate) fn is_beyond_bound(&self) -> bool {
        let blocks = self.blocks(None);
        let excess: Vec<f64> = blocks.iter().map(|b| b[0] - b[2]).collect();
        Estimate::of(&excess).is_above(1)
    }

    /// The mean with its standard error.
    pub(crate) fn estimate(&self) -> Estimate {
        Estimate::of(&self.blocks(None).iter().map(|b| b[0]).collect::<Vec<_>>())
    }
}

/// The row of blocks that a place in the list of a score's blocks belongs to, see [`FrameScore::blocks`]; columns stand
/// for themselves.
fn row_of(place: usize, across: usize, count: usize) -> usize {
    let down = (count - across) / (across + 1);
    match place.checked_sub(across * down) {
        None => place / across,
        Some(line) => line,
    }
}

/// Gain from `worse` to `better`.
pub(crate) fn gain(worse: &Scores, better: &Scores) -> Estimate {
    difference(worse, better, None)
}

/// Gain in the places where `worse` lies above what the discrepancy may make of it, less what is lost anywhere. Chance
/// is what a block's gain does from frame to frame: what shows in few blocks is not taken for chance because others
/// show nothing.
pub(crate) fn gain_beyond_bounds(worse: &Scores, better: &Scores) -> Estimate {
    let frames = |scores: &Scores| scores.0.iter().map(FrameScore::over_families).collect::<Vec<_>>();
    let (a, b) = (frames(worse), frames(better));
    let count = a.iter().chain(&b).map(Vec::len).min().unwrap_or(0);
    let n = a.len() as f64;
    let (mut value, mut variance) = (0.0, 0.0);
    for block in 0..count {
        let gains: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a[block][0] - b[block][0]).collect();
        let mean = gains.iter().sum::<f64>() / n;
        let beyond = a.iter().map(|a| a[block][0] - a[block][2]).sum::<f64>() / n;
        value += mean.min(beyond.max(0.0));
        variance += gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n * (n - 1.0).max(1.0));
    }
    // One frame says nothing of chance.
    if a.len() < 2 { Estimate::default() } else { Estimate { value, standard_error: variance.sqrt() } }
}

/// Whether `better` gains more than it leaves beyond the discrepancy: in all, or in most places. A thing that is not
/// described leaves much in a few.
pub(crate) fn gains_more_than_is_left(worse: &Scores, better: &Scores) -> bool {
    let (a, b) = (worse.blocks(None), better.blocks(None));
    let place = |(a, b): (&[f64; 3], &[f64; 3])| a[0] - b[0] > (b[0] - b[2]).max(0.0);
    let seen = a.iter().zip(&b).filter(|(a, _)| a[0] + a[2] > 0.0);
    let (most, of) = seen.fold((0, 0), |(most, of), pair| (most + usize::from(place(pair)), of + 1));
    2 * most > of || worse.mean() - better.mean() > (better.mean() - better.bound()).max(0.0)
}

/// Share of what lies beyond the discrepancy that `better` takes away: of the families of statistics that do. What all
/// families make together may lie within it, where compression may make much of some. Few frames show none of them
/// beyond chance where poses are free (tiles that place a frame do not judge it): of those that lie above it then.
pub(crate) fn share_beyond_bounds(worse: &Scores, better: &Scores) -> f64 {
    let beyond = |f: &usize| worse.is_beyond_bounds(*f);
    let above = |f: &usize| worse.excess(*f).value > 0.0;
    let mut families: Vec<usize> = (0..FAMILIES.len()).filter(beyond).collect();
    if families.is_empty() {
        families = (0..FAMILIES.len()).filter(above).collect();
    }
    let gain: f64 = families.iter().map(|&f| family_gain(worse, better, f).value).sum();
    let beyond: f64 = families.iter().map(|&f| worse.excess(f).value).sum();
    if beyond > 0.0 { gain / beyond } else { 0.0 }
}

/// Gain in one family of statistics.
pub(crate) fn family_gain(worse: &Scores, better: &Scores, family: usize) -> Estimate {
    difference(worse, better, Some(family))
}

fn difference(worse: &Scores, better: &Scores, family: Option<usize>) -> Estimate {
    let (a, b) = (worse.blocks(family), better.blocks(family));
    // Blocks without a statistic are no draws.
    let seen = a.iter().zip(&b).enumerate().filter(|(_, (a, b))| a[1] + b[1] > 0.0 || a[0] + b[0] > 0.0);
    let gains: Vec<(usize, f64)> = seen.map(|(place, (a, b))| (place, a[0] - b[0])).collect();
    let noisy = if better.rows_of().is_some() { better } else { worse };
    noisy.over_places(gains, a.len().min(b.len()))
}

/// Scores parameters on the frames to choose by; keeps what it has scored.
pub(crate) struct Judge<'a> {
    pub evidence: &'a Evidence,
    pub masks: Option<&'a [Plane<f32>]>,
    pub seed: u64,
    /// Pixels that are stuck, for models that have such.
    pub hot: HotMap,
    /// How well the frames to be judged are rendered.
    pub quality: Quality,
    /// What is left out at least, besides what a model itself needs.
    pub kind: Kind,
    known: HashMap<String, Scores>,
}

impl<'a> Judge<'a> {
    pub(crate) fn new(
        evidence: &'a Evidence,
        masks: Option<&'a [Plane<f32>]>,
        seed: u64,
        hot: HotMap,
    ) -> Self {
        Self {
            evidence,
            masks,
            seed,
            hot,
            quality: Quality::Fit,
            kind: Kind::default(),
            known: HashMap::new(),
        }
    }

    /// Keeps the stuck pixels that stand above these means of `frames` (places) too; see [`HotMap::find`].
    pub(crate) fn keep_stuck(&mut self, frames: &[usize], means: &[Plane<f32>], file: Option<u8>) {
        let before = self.hot.clone();
        self.hot.keep_above(self.evidence, frames, means, file);
        if self.hot != before {
            self.known.clear();
        }
    }

    /// Scores of `theta` on the frames to choose by.
    pub(crate) fn scores(&mut self, forward: &mut Forward, theta: &Theta) -> Result<Scores> {
        self.scores_about(forward, theta, theta)
    }

    /// What the spread of `theta` scores on the frames to choose by, about the pictures of `shown`.
    pub(crate) fn scores_about(
        &mut self,
        forward: &mut Forward,
        theta: &Theta,
        shown: &Theta,
    ) -> Result<Scores> {
        let about = if theta == shown { String::new() } else { format!(" about {shown:?}") };
        let key = format!("{:?} {:?} {theta:?}{about}", self.quality, self.kind);
        if let Some(known) = self.known.get(&key) {
            return Ok(known.clone());
        }
        let scores = self.seen_about(forward, [theta, shown], &self.evidence.choose.clone())?.0;
        self.known.insert(key, scores.clone());
        Ok(scores)
    }

    /// Scores of `theta` on any frames (places).
    pub(crate) fn scores_on(&self, forward: &mut Forward, theta: &Theta, frames: &[usize]) -> Result<Scores> {
        Ok(self.seen_on(forward, theta, frames)?.0)
    }

    /// The same, and the frames as they are simulated, stuck pixels included.
    pub(crate) fn seen_on(
        &self,
        forward: &mut Forward,
        theta: &Theta,
        frames: &[usize],
    ) -> Result<(Scores, Vec<Arc<Plane<f32>>>)> {
        self.seen_about(forward, [theta; 2], frames)
    }

    /// The same about the pictures of another model, the second.
    fn seen_about(
        &self,
        forward: &mut Forward,
        models: [&Theta; 2],
        frames: &[usize],
    ) -> Result<(Scores, Vec<Arc<Plane<f32>>>)> {
        let clock = Instant::now();
        let (mut scores, mut pictures, mut last) = (Vec::new(), Vec::new(), None);
        for some in frames.chunks(self.evidence.at_a_time()) {
            let (more, means, end) = self.scored(forward, models, some, last)?;
            scores.extend(more);
            pictures.extend(means);
            last = end;
        }
        forward.budget.has_scored(frames.len(), self.quality, clock.elapsed());
        Ok((Scores(scores), pictures))
    }

    /// Scores, frames as simulated, and what the last of them showed; `last`: what the one before the first did.
    fn scored(
        &self,
        forward: &mut Forward,
        [theta, shown]: [&Theta; 2],
        frames: &[usize],
        last: Option<(usize, KeptOf)>,
    ) -> Result<Part> {
        let mut means = forward.pictures(frames, shown, self.quality)?;
        let drawn = forward.drawn(frames, theta, self.quality, &means)?;
        if theta.get(P::Hot) > 0.0 {
            means.iter_mut().for_each(|m| self.hot.put(Arc::make_mut(m)));
        }
        let tone = Tone::new(theta);
        let masks = forward.masked(self.masks, self.kind.and(theta.room.kind()));
        let flips = forward.flips(frames, theta, self.quality)?;
        let paths = forward.paths(frames, theta);
        let given = forward.given(frames, theta, &tone, &means);
        let scored: Vec<_> = frames
            .iter()
            .zip(&means)
            .enumerate()
            .map(|(i, (&at, mean))| Scored {
                real: &self.evidence.frames[at].dn,
                mean,
                path: paths.get(i),
                mask: masks.as_ref().map(|m| &m[at]),
                flips: flips.get(i),
                drawn: &drawn[i],
                edges_drawn: draws_edges(theta),
                given: given.as_ref().map(|g| g[i].as_slice()),
            })
            .collect();
        let index = |i: usize| self.evidence.frames[frames[i]].index;
        let ahead = last.as_ref().map(|(index, _)| *index);
        let before = |i: usize| if i > 0 { Some(index(i - 1)) } else { ahead };
        let follows = |i: usize| before(i).is_some_and(|before| index(i) == before + 1);
        let mut scores = Vec::new();
        let mut last = last.map(|(_, kept)| kept);
        let few = self.evidence.judged_at_a_time();
        for (chunk, frames) in scored.chunks(few).enumerate() {
            forward.budget.go_on()?;
            let seen: Vec<_> = frames.par_iter().map(|frame| seen_in(frame, &tone)).collect();
            let kept: Vec<_> = seen.iter().map(|frame| frame.kept()).collect();
            let before = |i: usize| if i > 0 { kept.get(i - 1) } else { last.as_ref() };
            let score = |i: usize| {
                let before = before(i).filter(|_| follows(chunk * few + i));
                score_frame(&seen[i], before)
            };
            scores.par_extend((0..seen.len()).into_par_iter().map(score));
            last = kept.into_iter().next_back();
        }
        let end = last.map(|kept| (index(frames.len() - 1), kept));
        drop(scored);
        Ok((scores, means, end))
    }

    /// Sorted resamples, by blocks, of the closed fraction; the same for every call with one seed.
    pub(crate) fn closed_fractions(&self, before: &Scores, after: &Scores) -> Vec<f64> {
        let (b, a) = (before.blocks(None), after.blocks(None));
        let seed = seed_words(self.seed);
        let one = |r: usize| {
            let mut sums = [0.0; 3];
            for k in 0..b.len() {
                let bits = random_bits([k as u32, r as u32], 0, STREAM_BOOTSTRAP, seed)[0];
                let i = ((u64::from(bits) * b.len() as u64) >> 32) as usize;
                let add = [b[i][0], a[i][0], a[i][1]];
                (0..3).for_each(|j| sums[j] += add[j]);
            }
            closed_fraction(sums[0], sums[1], sums[2])
        };
        let mut all: Vec<f64> = (0..RESAMPLES).map(one).collect();
        all.sort_by(f64::total_cmp);
        all
    }
}

/// See [`crate::diagnose::Gap::closed_fraction`].
pub(crate) fn closed_fraction(before: f64, after: f64, floor: f64) -> f64 {
    let (rest, whole) = ((after - floor).max(0.0), before - floor.min(after));
    if whole <= 1e-9 { 0.0 } else { (1.0 - rest / whole).clamp(0.0, 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_beyond_chance_depends_on_how_much_is_tried() {
        assert!((quantile(1) - 2.326).abs() < 1e-2, "{}", quantile(1));
        assert!((quantile(24) - 3.34).abs() < 1e-2, "{}", quantile(24));
        // One variable of either sign: twice as often beyond. Nine: chi-squared of 29.7 at 0.01 / 20.
        assert!((quantile_of_length(24, 1) - 3.53).abs() < 0.03, "{}", quantile_of_length(24, 1));
        assert!(
            (quantile_of_length(20, 9).powi(2) - 29.7).abs() < 0.3,
            "{}",
            quantile_of_length(20, 9).powi(2)
        );
        let even: Vec<f64> = (0..100).map(|i| [0.9, 1.1][i % 2]).collect();
        assert!(Estimate::of(&even).is_above(1000));
        let chance: Vec<f64> = (0..100).map(|i| [3.0, -2.9][i % 2]).collect();
        assert!(!Estimate::of(&chance).is_above(1), "control: {:?}", Estimate::of(&chance));
    }

    /// Scores of frames of so many blocks, all of one family: what each got, and what the discrepancy may make of it.
    fn scores(frames: &[Vec<f32>], bound: f32) -> Scores {
        let frame = |blocks: &Vec<f32>| {
            let mut score = FrameScore::default();
            score.blocks[0] = blocks.iter().map(|b| [*b, 0.5 * bound, bound]).collect();
            score
        };
        Scores(frames.iter().map(frame).collect())
    }

    #[test]
    fn what_shows_in_one_place_in_every_frame_is_no_chance() {
        // One block of a hundred shows it, in five frames alike but for little.
        let frames = |seen: &dyn Fn(usize) -> f32| -> Vec<Vec<f32>> {
            (0..5).map(|f| (0..100).map(|b| if b == 7 { seen(f) } else { 0.01 }).collect()).collect()
        };
        let worse = scores(&frames(&|f| [3.0, 3.2, 2.9, 3.1, 3.0][f]), 0.2);
        let better = scores(&frames(&|_| 0.1), 0.2);
        assert!(!gain(&worse, &better).is_above(26), "to blocks it is chance");
        assert!(gain_beyond_bounds(&worse, &better).is_above(26));
        // Controls: within what correct simulations may differ by; in one frame of the five; and from a single frame.
        let within = scores(&frames(&|f| [3.0, 3.2, 2.9, 3.1, 3.0][f]), 4.0);
        assert!(!gain_beyond_bounds(&within, &better).is_above(26));
        let once = scores(&frames(&|f| [15.0, 0.1, 0.1, 0.1, 0.1][f]), 0.2);
        assert!(!gain_beyond_bounds(&once, &better).is_above(26));
        let single = |s: &Scores| Scores(s.0[..1].to_vec());
        assert!(!gain_beyond_bounds(&single(&worse), &single(&better)).is_above(1));
    }

    #[test]
    fn a_share_is_of_what_lies_beyond_whatever_else_lies_within() {
        // Single pixels lie far within what a coarse file may make of them, a band lies beyond what it may.
        let both = |band: f32| {
            let mut both = scores(&vec![vec![1.0; 40]; 4], 5.0);
            both.0.iter_mut().for_each(|s| s.blocks[1] = vec![[band, 0.1, 0.2]; 40]);
            both
        };
        let (worse, half, all) = (both(1.2), both(0.7), both(0.2));
        assert!(!worse.is_beyond_bound(), "as a whole it lies within");
        assert!((share_beyond_bounds(&worse, &half) - 0.5).abs() < 1e-5);
        assert!((share_beyond_bounds(&worse, &all) - 1.0).abs() < 1e-5);
        assert_eq!(share_beyond_bounds(&all, &half), 0.0, "control: nothing is beyond");
    }

    /// What a model gains where a row happens to have much noise, and loses where it has little, is one draw a row.
    #[test]
    fn gains_of_a_row_of_blocks_are_one_draw() {
        let (across, down) = (10, 8);
        let scores = |of: &dyn Fn(usize) -> f32, rows_of| {
            let mut frame = FrameScore { rows_of, ..FrameScore::default() };
            let lines = down + across;
            frame.blocks[0] = (0..across * down).map(|i| [of(i / across), 0.1, 0.1]).collect();
            frame.blocks[0].extend(std::iter::repeat_n([0.0; 3], lines));
            Scores(vec![frame])
        };
        let worse = |_| 1.0;
        let better = |row: usize| 1.0 - [0.3, -0.2, 0.25, -0.1, 0.3, -0.2, 0.2, 0.1][row];
        let told = |rows_of| gain(&scores(&worse, None), &scores(&better, rows_of)).is_above(1);
        assert!(!told(Some(across)));
        assert!(told(None), "control: blocks as draws");
        let everywhere = gain(&scores(&worse, None), &scores(&|row| 0.9 - 0.01 * row as f32, Some(across)));
        assert!(everywhere.is_above(1), "{everywhere:?}");
    }

    #[test]
    fn blocks_of_a_row_belong_together_with_its_line() {
        // Three blocks across, two down, two groups of rows, three of columns.
        let rows: Vec<usize> = (0..11).map(|i| row_of(i, 3, 11)).collect();
        assert_eq!(rows, [0, 0, 0, 1, 1, 1, 0, 1, 2, 3, 4]);
    }
}
