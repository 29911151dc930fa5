//! Levenberg-Marquardt on the differences between real and simulated values, robust against what renderers do
//! differently at edges, from coarse pictures to fine ones.

pub(super) mod cost;
pub(super) mod flicker;
pub(super) mod intervals;
pub(super) mod normal;
pub(super) mod starts;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::evidence::spread_out;
use crate::diagnose::expect::fitted::Fit;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::linear::solve;
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::settings::lens;
use crate::diagnose::expect::tone::{Tone, shows_coarse_steps};
use crate::diagnose::expect::weighing::Weighing;
use cost::{Level, Target, cost_of, weighing_of};
use flicker::retuned;
use normal::{Equations, linearise};
use shutterbug::camera::Lens;
use shutterbug::effects::LensDistortion;
use shutterbug::error::Result;

/// How a fit goes about it: stages one after another.
pub(crate) type Schedule = &'static [Level];

const fn level(block: usize, iterations: usize, quality: Quality, frames: usize) -> Level {
    Level { block, iterations, quality, frames }
}

/// From far away, but not to the end.
pub(crate) const COARSE: Schedule = &[level(8, 4, Quality::Coarse, 3), level(4, 3, Quality::Coarse, 4)];
/// Where no geometry is fitted: renders are kept, and values tell more at full size.
pub(crate) const VALUES: Schedule = &[level(4, 5, Quality::Fit, 3), level(2, 4, Quality::Fit, 4)];
/// The same for what is smaller than a block.
pub(crate) const DETAILS: Schedule = &[level(2, 4, Quality::Fit, 3), level(1, 4, Quality::Fit, 4)];
/// From nearby.
pub(crate) const FINE: Schedule = &[level(2, 3, Quality::Fit, 6)];
/// To the end.
pub(crate) const LAST: Schedule = &[level(2, 4, Quality::Fit, 6), level(1, 6, Quality::Fine, 6)];

/// The same through a lens.
pub(crate) const LAST_OF_LENS: Schedule = &[level(2, 4, Quality::Fit, 6), level(1, 3, Quality::Fit, 6)];

/// Filters, once more, with geometry held.
pub(crate) const FILTERS: Schedule = &[level(1, 4, Quality::Finest, 6)];

/// Beyond which difference costs at two points compare lengths instead of squares, DN.
pub(crate) const COMPARED_DN: f64 = 1.5;

/// Most lengths of a step that are tried.
const MOST_STRETCH: f64 = 8.0;

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
pub(crate) fn fit(
    forward: &mut Forward,
    target: Target<'_>,
    frames: &[usize],
    start: &Theta,
    free: &[P],
    schedule: Schedule,
) -> Result<Fit> {
    let key = format!("{frames:?} {start:?} {free:?} {schedule:?}");
    Forward::tried(
        forward,
        |f| f,
        ("fit", &key),
        |f| fit_anew(f, start, Task { target, frames, free, schedule }),
    )
}

/// What a whole fit works on.
#[derive(Clone, Copy)]
struct Task<'a> {
    target: Target<'a>,
    /// Places.
    frames: &'a [usize],
    free: &'a [P],
    schedule: Schedule,
}

fn fit_anew(forward: &mut Forward, start: &Theta, task: Task<'_>) -> Result<Fit> {
    let start = forward.bounded(start.clone());
    let start = ahead_of_converter(forward, start, task)?;
    Ok(Fit { theta: through(forward, start, task)?, half: BTreeMap::new() })
}

/// Where a fit begins whose values are rounded coarsely. Of walls of one colour no small step of a value changes
/// anything then, or all at once: there are no slopes that lead from afar. Those of the values ahead of the converter
/// do, and rounding takes as much from them here as it gives there. Its end, if that is nearer than the start.
fn ahead_of_converter(forward: &mut Forward, start: Theta, task: Task<'_>) -> Result<Theta> {
    let values = task.free.iter().any(|p| !p.is_time() && !p.is_remap());
    let [first, ..] = task.schedule else { return Ok(start) };
    if !values || Tone::new(&start).is_noisy() || !shows_coarse_steps(&start) {
        return Ok(start);
    }
    let open = through(forward, start.with(P::Bits, 0.0), task)?;
    let end = open.with(P::Bits, start.get(P::Bits));
    let some = spread_out(task.frames, first.frames);
    let weighing = weighing_of(forward, &some, &start, first, COMPARED_DN)?;
    let cost = |forward: &mut Forward, theta| cost_of(forward, task.target, &some, theta, first, &weighing);
    let costs = [cost(forward, &start)?, cost(forward, &end)?];
    tracing::debug!("by way of values ahead of the converter: cost {:.5} to {:.5}", costs[0], costs[1]);
    Ok(if costs[1] < costs[0] { end } else { start })
}

/// How many frames a stage looks at. Where all lines are exposed at once a frame says one number of a flicker: a few
/// know neither its frequency beside its depth and its phase, nor the level about which it goes.
fn frames_for(theta: &Theta, free: &[P], level: &Level) -> usize {
    let beats = |p: &P| *p == P::FlickerF || p.spec().effect == flicker::LEVEL;
    let beats = free.iter().any(beats) && !theta.is_on(P::Readout);
    if beats { usize::MAX } else { level.frames }
}

/// All stages of a fit.
fn through(forward: &mut Forward, start: Theta, task: Task<'_>) -> Result<Theta> {
    let Task { target, frames, free, schedule } = task;
    let mut theta = start;
    for level in schedule {
        let some = spread_out(frames, frames_for(&theta, free, level));
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
    Ok(theta)
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
    forward.bounded(trial)
}

/// [`cost_of`]; infinite for a lens that folds inside the picture.
fn cost_unless_folded(forward: &mut Forward, stage: &Stage<'_>, theta: &Theta, e: &Equations) -> Result<f64> {
    if Lens::new(forward.intrinsics, LensDistortion::distortion(&lens(theta))).is_err() {
        return Ok(f64::INFINITY);
    }
    cost_of(forward, stage.target, stage.frames, theta, stage.level, &e.weighing)
}
