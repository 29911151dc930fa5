//! Levenberg-Marquardt on the differences between real and simulated values, robust against what renderers do
//! differently at edges, from coarse pictures to fine ones.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::evidence::Evidence;
use super::flicker::retuned;
use super::forward::{Forward, Quality};
use super::linear::solve;
use super::model::{P, Theta};
use super::normal::{Equations, linearise};
use super::settings::lens;
use super::tone::Tone;
use super::weighing::Weighing;
use shutterbug::camera::Lens;
use shutterbug::effects::LensDistortion;
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// What a fit compares with.
#[derive(Clone, Copy)]
pub(super) struct Target<'a> {
    pub evidence: &'a Evidence,
    /// By place; 1 where compared.
    pub masks: Option<&'a [Plane<f32>]>,
}

/// One stage of a fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    /// Px a block over which values are averaged.
    pub block: usize,
    /// Most iterations.
    pub iterations: usize,
    pub quality: Quality,
    /// Most frames.
    pub frames: usize,
}

/// How a fit goes about it: stages one after another.
pub(super) type Schedule = &'static [Level];

const fn level(block: usize, iterations: usize, quality: Quality, frames: usize) -> Level {
    Level { block, iterations, quality, frames }
}

/// From far away, but not to the end.
pub(super) const COARSE: Schedule = &[level(8, 4, Quality::Coarse, 3), level(4, 3, Quality::Coarse, 4)];
/// Where no geometry is fitted: renders are kept, and values tell more at full size.
pub(super) const VALUES: Schedule = &[level(4, 5, Quality::Fit, 3), level(2, 4, Quality::Fit, 4)];
/// The same for what is smaller than a block.
pub(super) const DETAILS: Schedule = &[level(2, 4, Quality::Fit, 3), level(1, 4, Quality::Fit, 4)];
/// From nearby.
pub(super) const FINE: Schedule = &[level(2, 3, Quality::Fit, 6)];
/// To the end.
pub(super) const LAST: Schedule = &[level(2, 4, Quality::Fit, 6), level(1, 6, Quality::Fine, 6)];

/// The same through a lens.
pub(super) const LAST_OF_LENS: Schedule = &[level(2, 4, Quality::Fit, 6), level(1, 3, Quality::Fit, 6)];

/// Filters, once more, with geometry held.
pub(super) const FILTERS: Schedule = &[level(1, 4, Quality::Finest, 6)];

/// Most lengths of a step that are tried.
const MOST_STRETCH: f64 = 8.0;

/// A finished fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Fit {
    pub theta: Theta,
    /// Half widths of 95 % intervals; empty where they were not asked for.
    pub half: BTreeMap<P, f64>,
}

/// What one stage of a fit works on.
struct Stage<'a> {
    target: Target<'a>,
    /// Places.
    frames: &'a [usize],
    free: &'a [P],
    level: &'a Level,
}

/// A point of a fit under way.
struct State {
    theta: Theta,
    cost: f64,
    /// One per level: costs must compare.
    weighing: Option<Arc<Weighing>>,
    damping: f64,
}

/// Fits the `free` parameters on `frames` (places), starting from `start`; once, if there is a journal.
pub(super) fn fit(
    forward: &mut Forward,
    target: Target<'_>,
    frames: &[usize],
    start: &Theta,
    free: &[P],
    schedule: Schedule,
) -> Result<Fit> {
    let key = format!("{frames:?} {start:?} {free:?} {schedule:?}");
    Forward::tried(forward, |f| f, ("fit", &key), |f| fit_anew(f, target, frames, start, free, schedule))
}

fn fit_anew(
    forward: &mut Forward,
    target: Target<'_>,
    frames: &[usize],
    start: &Theta,
    free: &[P],
    schedule: Schedule,
) -> Result<Fit> {
    let mut theta = bounded(forward, start.clone());
    for level in schedule {
        let some = spread_out(frames, level.frames);
        let stage = Stage { target, frames: &some, free, level };
        let mut state = State { theta: theta.clone(), cost: f64::INFINITY, weighing: None, damping: 1e-4 };
        for _ in 0..level.iterations {
            if forward.budget.is_over() {
                break;
            }
            let known = state.weighing.take();
            let e = linearise(forward, target, &some, &state.theta, free, level, known)?;
            (state.weighing, state.cost) = (Some(e.weighing.clone()), e.cost);
            let moved = advance(forward, &stage, &mut state, &e)?;
            tracing::debug!(
                "block {}: cost {:.5} to {:.5}, moved {moved:.4}, damping {:.1e}",
                level.block,
                e.cost,
                state.cost,
                state.damping
            );
            if moved < 5e-3 {
                break;
            }
        }
        theta = state.theta;
    }
    Ok(Fit { theta, half: BTreeMap::new() })
}

/// At most `most` of the frames, from all over them.
pub(super) fn spread_out(frames: &[usize], most: usize) -> Vec<usize> {
    let n = frames.len().min(most);
    (0..n).map(|i| frames[i * frames.len() / n]).collect()
}

/// Tries steps until one lowers the cost; returns its largest component in units of the parameters' steps.
fn advance(forward: &mut Forward, stage: &Stage<'_>, state: &mut State, e: &Equations) -> Result<f64> {
    for _ in 0..3 {
        let Some(step) = solve(&e.a, &e.b, state.damping) else { return Ok(0.0) };
        let mut trial = stepped(forward, &state.theta, stage.free, &step, 1.0);
        e.poses.iter().for_each(|p| p.follow(&mut trial, &step, 1.0, true));
        let moved = stage
            .free
            .iter()
            .map(|&p| ((trial.get(p) - state.theta.get(p)) / p.spec().step).abs())
            .fold(0.0, f64::max);
        if moved < 1e-4 {
            return Ok(0.0);
        }
        let now = cost_unless_folded(forward, stage, &trial, e)?;
        if now < state.cost {
            let fallen = (state.cost - now) * e.count;
            (state.theta, state.cost) = (trial, now);
            state.damping = (state.damping * 0.1).max(1e-6);
            let longer = stretch(e, &step, fallen);
            if longer > 1.4 && moved > 2e-2 {
                return Ok(moved * go_on(forward, stage, state, e, &step, longer)?);
            }
            return Ok(moved);
        }
        state.damping = (state.damping * 30.0).max(3e-2);
    }
    Ok(0.0)
}

/// How many of its lengths a step should have had, if the cost is a parabola along it: at hard edges slopes are spread
/// over more pixels than differences, and steps come out many times too short.
fn stretch(e: &Equations, step: &[f64], fallen: f64) -> f64 {
    let slope: f64 = e.b.iter().zip(step).map(|(b, s)| b * s).sum();
    let bend = 2.0 * (slope - fallen);
    if slope <= 0.0 { 1.0 } else { (slope / bend.max(slope / MOST_STRETCH)).min(MOST_STRETCH) }
}

/// Tries the rest of a step that was too short; returns how much longer the step has become.
fn go_on(
    forward: &mut Forward,
    stage: &Stage<'_>,
    state: &mut State,
    e: &Equations,
    step: &[f64],
    longer: f64,
) -> Result<f64> {
    let mut trial = stepped(forward, &state.theta, stage.free, step, longer - 1.0);
    e.poses.iter().for_each(|p| p.follow(&mut trial, step, longer - 1.0, false));
    let now = cost_unless_folded(forward, stage, &trial, e)?;
    if now >= state.cost {
        return Ok(1.0);
    }
    (state.theta, state.cost) = (trial, now);
    Ok(longer)
}

/// `theta` moved by `lengths` of a step.
fn stepped(forward: &Forward, theta: &Theta, free: &[P], step: &[f64], lengths: f64) -> Theta {
    let mut trial = theta.clone();
    for (&p, s) in free.iter().zip(step) {
        trial.set(p, theta.get(p) + lengths * s * p.spec().step);
    }
    if free.contains(&P::FlickerF) {
        let frequency_hz = trial.get(P::FlickerF);
        trial.set(P::FlickerF, theta.get(P::FlickerF));
        trial = retuned(&trial, frequency_hz, forward.middle_s());
    }
    bounded(forward, trial)
}

/// [`cost_of`]; infinite for a lens that folds inside the picture.
fn cost_unless_folded(forward: &mut Forward, stage: &Stage<'_>, theta: &Theta, e: &Equations) -> Result<f64> {
    if Lens::new(forward.intrinsics, LensDistortion::distortion(&lens(theta))).is_err() {
        return Ok(f64::INFINITY);
    }
    cost_of(forward, stage.target, stage.frames, theta, stage.level, &e.weighing)
}

/// Keeps times inside what the trajectory covers.
pub(super) fn bounded(forward: &Forward, mut theta: Theta) -> Theta {
    let [from_s, to_s] = forward.offsets_s();
    theta.set(P::Offset, theta.get(P::Offset).clamp(from_s, to_s));
    let longest_s = forward.longest_s();
    for p in [P::Readout, P::Exposure] {
        theta.set(p, theta.get(p).min(longest_s));
    }
    theta
}

/// Robust cost of `theta` on pictures averaged over blocks, per value.
pub(super) fn cost_of(
    forward: &mut Forward,
    target: Target<'_>,
    frames: &[usize],
    theta: &Theta,
    level: &Level,
    weighing: &Weighing,
) -> Result<f64> {
    let simulated = forward.pictures(frames, theta, level.quality)?;
    let costs: Vec<(f64, f64)> = (0..frames.len())
        .into_par_iter()
        .map(|f| {
            let r = residual(target, frames[f], &simulated[f], level.block);
            (weighing.cost(f, &r), r.len() as f64)
        })
        .collect();
    let (sum, count) = costs.into_iter().fold((0.0, 0.0), |a, c| (a.0 + c.0, a.1 + c.1));
    Ok(sum / f64::max(count, 1.0))
}

/// The weights of `theta`'s noise with a given threshold, DN.
pub(super) fn weighing_of(
    forward: &mut Forward,
    frames: &[usize],
    theta: &Theta,
    level: &Level,
    delta: f64,
) -> Result<Weighing> {
    let tone = Tone::new(theta);
    let means = if tone.is_noisy() { forward.pictures(frames, theta, level.quality)? } else { Vec::new() };
    Ok(Weighing::new(&means, &tone, level.block, delta))
}

/// Real minus simulated, averaged over blocks; masked values are 0.
pub(super) fn residual(target: Target<'_>, at: usize, simulated: &Plane<f32>, block: usize) -> Vec<f32> {
    let real = &target.evidence.frames[at].dn;
    let mut data: Vec<f32> = real.data.iter().zip(&simulated.data).map(|(r, s)| r - s).collect();
    hide(target, at, &mut data);
    pooled(&data, simulated.width, simulated.height, block)
}

pub(super) fn hide(target: Target<'_>, at: usize, data: &mut [f32]) {
    if let Some(masks) = target.masks {
        for (values, m) in data.chunks_exact_mut(3).zip(&masks[at].data) {
            if *m <= 0.5 {
                values.fill(0.0);
            }
        }
    }
}

/// Means over blocks; what does not fill a block at the right and lower border is left out.
pub(super) fn pooled(data: &[f32], w: usize, h: usize, block: usize) -> Vec<f32> {
    if block == 1 {
        return data.to_vec();
    }
    let (cw, ch) = (w / block, h / block);
    let mut out = vec![0.0f32; cw * ch * 3];
    for y in 0..ch * block {
        for x in 0..cw * block {
            let to = ((y / block) * cw + x / block) * 3;
            let from = (y * w + x) * 3;
            (0..3).for_each(|c| out[to + c] += data[from + c]);
        }
    }
    let scale = 1.0 / (block * block) as f32;
    out.iter_mut().for_each(|v| *v *= scale);
    out
}
