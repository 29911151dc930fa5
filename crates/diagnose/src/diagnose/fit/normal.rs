//! The normal equations of a fit. Derivatives by parameters of the geometry come from how the content moves, so that an
//! iteration costs one render: near the solution they need only point the right way, the residual is exact.

use std::sync::Arc;

use rayon::prelude::*;

use super::cost::{Level, Target, hide, residual};
use super::flicker::retuned;
use crate::diagnose::evidence::blocks::pooled;
use crate::diagnose::expect::description::PoseShare;
use crate::diagnose::expect::flow::{Flow, displaced};
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::linear::solve;
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::tone::Tone;
use crate::diagnose::expect::weighing::{FrameValues, Weighing};
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// Normal equations in units of the parameters' steps.
pub(crate) struct Equations {
    pub a: Vec<Vec<f64>>,
    pub b: Vec<f64>,
    /// What it was made of, by frame.
    pub values: Vec<FrameValues>,
    /// Sum of the weights of all values, per DN^2.
    pub weight: f64,
    /// How differences were weighed, and their mean cost.
    pub weighing: Arc<Weighing>,
    pub cost: f64,
    /// Number of values.
    pub count: f64,
    /// What poses do, by frame, where they are open.
    pub poses: Vec<PoseShare>,
}

/// What one frame contributes.
struct Share {
    a: Vec<Vec<f64>>,
    b: Vec<f64>,
    cost: f64,
    weight: f64,
}

/// The derivative by one parameter.
struct Column {
    p: P,
    step: f64,
    /// The camera behind the step, without compression.
    changed: Theta,
    way: Way,
    /// How the changed camera develops, where that is all that changes.
    tone: Option<Tone>,
}

/// How the derivative by a parameter is had.
enum Way {
    /// Renders at the stepped place.
    Render(Vec<std::sync::Arc<Plane<f32>>>),
    /// A displacement of the content, the same for all frames.
    Remap(Flow),
    /// A shift in time.
    Time,
    /// Values alone change.
    Value,
}

/// The normal equations at `theta`; differences are weighed as in `known`, or as they are at `theta`.
pub(crate) fn linearise(
    forward: &mut Forward,
    target: Target<'_>,
    frames: &[usize],
    theta: &Theta,
    free: &[P],
    level: &Level,
    known: Option<Arc<Weighing>>,
) -> Result<Equations> {
    let radiance = forward.radiance(frames, theta, level.quality)?;
    let columns = columns(forward, frames, theta, free, level)?;
    // A compressor's steps have no slope: derivatives are taken before it.
    let smooth = theta.with(P::Quality, 0.0);
    let bases = forward.pictures(frames, &smooth, level.quality)?;
    let delivered = forward.pictures(frames, theta, level.quality)?;
    let tone = Tone::new(theta);
    let around = Around { forward, theta, smooth: &smooth, tone: &tone };
    let timed = columns.iter().any(|c| matches!(c.way, Way::Time));
    let mut by_frame: Vec<FrameValues> = frames
        .par_iter()
        .enumerate()
        .map(|(i, &at)| {
            let r = residual(target, at, &delivered[i], level.block);
            let seen = Seen {
                i,
                at,
                radiance: &radiance[i],
                base: &bases[i],
                velocity: timed.then(|| around.forward.velocity(at, theta)),
            };
            let derivative = |column: &Column| around.derivative(target, &seen, column, level.block);
            (r, columns.par_iter().map(derivative).collect())
        })
        .collect();
    forward.budget.go_on()?;
    let weighing = match known {
        Some(known) => known,
        None => {
            let residuals: Vec<&[f32]> = by_frame.iter().map(|f| &f.0[..]).collect();
            Arc::new(super::cost::weighing_of(forward, frames, theta, level, 1.0)?.chosen(&residuals))
        }
    };
    let poses = forward.beside_description(frames, theta, &radiance, level.block, &weighing, &mut by_frame);
    Ok(Equations { poses, ..assemble(by_frame, free.len(), weighing) })
}

/// A derivative for each free parameter: how long its step is, and what it changes.
fn columns(
    forward: &mut Forward,
    frames: &[usize],
    theta: &Theta,
    free: &[P],
    level: &Level,
) -> Result<Vec<Column>> {
    // On coarse pictures steps are longer: a derivative should see what a block sees.
    let stretch = if level.block >= 4 { 3.0 } else { 1.0 };
    let mut columns = Vec::new();
    for &p in free {
        let step = step_of(forward, theta, p, stretch);
        let changed = match p {
            P::FlickerF => retuned(theta, theta.get(p) + step, forward.middle_s()),
            p => theta.with(p, theta.get(p) + step),
        };
        let changed = changed.with(P::Quality, 0.0);
        let way = match p {
            // What other factors could do in its place is taken out of the column anyway.
            P::Exposure => Way::Render(forward.lit_as(frames, &changed, theta, level.quality)?),
            P::Offset | P::Readout => Way::Time,
            p if p.is_remap() => Way::Remap(forward.flow_of_remap(theta, p, step)),
            _ => Way::Value,
        };
        columns.push(Column { p, step, changed, way, tone: None });
    }
    columns
        .par_iter_mut()
        .filter(|c| matches!(c.way, Way::Value))
        .for_each(|c| c.tone = Some(Tone::new(&c.changed)));
    Ok(columns)
}

/// What the derivatives of all frames are taken around.
struct Around<'a> {
    forward: &'a Forward,
    theta: &'a Theta,
    /// The same without compression.
    smooth: &'a Theta,
    tone: &'a Tone,
}

/// A frame as it is without a step.
struct Seen<'a> {
    /// Its place among the frames of the fit, and among all.
    i: usize,
    at: usize,
    radiance: &'a Plane<f32>,
    /// As delivered without compression.
    base: &'a Plane<f32>,
    /// Where a column asks for it.
    velocity: Option<Plane<f32>>,
}

impl Around<'_> {
    /// What one step of the parameter's own size changes, averaged over blocks; nothing once there is no more time.
    fn derivative(&self, target: Target<'_>, seen: &Seen<'_>, column: &Column, block: usize) -> Vec<f32> {
        let forward = self.forward;
        if forward.budget.is_over() {
            return Vec::new();
        }
        let (p, step, changed, at) = (column.p, column.step, &column.changed, seen.at);
        let moved;
        let other = match &column.way {
            Way::Render(renders) => forward.develop(at, &renders[seen.i], changed, self.tone),
            Way::Remap(flow) => {
                moved = displaced(seen.radiance, flow);
                forward.develop(at, &moved, self.smooth, self.tone)
            }
            Way::Time => {
                let velocity = seen.velocity.as_ref().expect("made where it is needed");
                moved = displaced(seen.radiance, &forward.flow_of_time(self.theta, velocity, p, step));
                forward.develop(at, &moved, changed, self.tone)
            }
            Way::Value => {
                forward.develop(at, seen.radiance, changed, column.tone.as_ref().unwrap_or(self.tone))
            }
        };
        let unit = (p.spec().step / step) as f32;
        let mut d: Vec<f32> = other.data.iter().zip(&seen.base.data).map(|(o, b)| (o - b) * unit).collect();
        hide(target, at, &mut d);
        pooled(&d, seen.base.width, seen.base.height, block)
    }
}

/// Step of a numeric derivative, away from the end of the range.
fn step_of(forward: &Forward, theta: &Theta, p: P, stretch: f64) -> f64 {
    let mut step = p.spec().step * if p.is_time() || p.is_remap() { stretch } else { 1.0 };
    if p.spec().unit == "px" && p.spec().neutral == 0.0 && theta.get(p) < 0.3 {
        // A blur's slope at none is none.
        step = 0.4;
    }
    let changed = forward.bounded(theta.with(p, theta.get(p) + step));
    if (changed.get(p) - theta.get(p)).abs() < 0.5 * step { -step } else { step }
}

pub(crate) fn assemble(frames: Vec<FrameValues>, n: usize, weighing: Arc<Weighing>) -> Equations {
    let count = frames.iter().map(|f| f.0.len()).sum::<usize>().max(1) as f64;
    let shares: Vec<Share> =
        (0..frames.len()).into_par_iter().map(|f| share(&frames[f], f, &weighing)).collect();
    let mut e = Equations {
        a: vec![vec![0.0; n]; n],
        b: vec![0.0; n],
        weight: shares.iter().map(|s| s.weight).sum(),
        weighing,
        cost: shares.iter().map(|s| s.cost).sum::<f64>() / count,
        count,
        values: frames,
        poses: Vec::new(),
    };
    for s in shares {
        for i in 0..n {
            (0..n).for_each(|j| e.a[i][j] += s.a[i][j]);
            e.b[i] += s.b[i];
        }
    }
    e
}

/// One frame's share, with the weights of its differences.
fn share((r, columns): &FrameValues, frame: usize, weighing: &Weighing) -> Share {
    let n = columns.len();
    let weights = weighing.weights(frame, r);
    let mut a = vec![vec![0.0; n]; n];
    // Sums over runs in f32 would lose digits.
    let product = |w: &[f32], d: &[f32], o: &[f32]| -> f64 {
        w.iter().zip(d).zip(o).map(|((&w, &d), &o)| f64::from(w * d * o)).sum()
    };
    for i in 0..n {
        for j in i..n {
            a[i][j] = product(&weights, &columns[i], &columns[j]);
            a[j][i] = a[i][j];
        }
    }
    let b = columns.iter().map(|d| product(&weights, r, d)).collect();
    let weight = weights.iter().map(|w| f64::from(*w)).sum();
    Share { a, b, cost: weighing.cost(frame, r), weight }
}

/// What share of the cost each group of parameters would take off beside `held`, by the linearised model: a ranking,
/// not a fit.
pub(crate) fn screened(e: &Equations, all: &[P], held: &[P], groups: &[Vec<P>]) -> Vec<f64> {
    let gain = |members: &[P]| -> f64 {
        let mut at: Vec<usize> = members.iter().filter_map(|p| all.iter().position(|a| a == p)).collect();
        at.sort_unstable();
        at.dedup();
        at.retain(|&i| e.a[i][i] > 0.0);
        let a: Vec<Vec<f64>> = at.iter().map(|&i| at.iter().map(|&j| e.a[i][j]).collect()).collect();
        let b: Vec<f64> = at.iter().map(|&i| e.b[i]).collect();
        solve(&a, &b, 1e-6).map_or(0.0, |x| 0.5 * x.iter().zip(&b).map(|(x, b)| x * b).sum::<f64>())
    };
    let alone = gain(held);
    let beside = groups.iter().map(|g| {
        let members: Vec<P> = held.iter().chain(g).copied().collect();
        (gain(&members) - alone) / (e.cost * e.count).max(1e-9)
    });
    beside.collect()
}
