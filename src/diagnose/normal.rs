//! The normal equations of a fit. Derivatives by parameters of the geometry come from how the content moves, so that an
//! iteration costs one render: near the solution they need only point the right way, the residual is exact.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;

use super::fit::{Level, Target, bounded, hide, pooled, residual};
use super::flow::{Flow, displaced};
use super::forward::Forward;
use super::linear::{back, cholesky, solve};
use super::model::{P, Theta};
use super::tone::Tone;
use super::weighing::Weighing;
use crate::error::Result;
use crate::plane::Plane;

/// Mean difference of two correct renderers that a parameter may take up, DN: half a tenth of what they differ by
/// (measured against an independent path tracer: readouts, vignetting and gamma were off by 0.1 to 1 % so).
const SYSTEMATIC_DN: f64 = 0.025;
/// How far two correct renderers place an edge apart, px: what an exposure of a slow motion was off by.
const SYSTEMATIC_PX: f64 = 0.01;
/// Keys of values: whole DN by channel.
const VALUES: usize = 3 * 256;
/// Side of the blocks of a picture whose gradients are taken for independent draws, px.
const CLUSTER_PX: usize = 32;

/// Normal equations in units of the parameters' steps.
pub(super) struct Equations {
    pub a: Vec<Vec<f64>>,
    pub b: Vec<f64>,
    /// Gradients of blocks of the frames.
    clusters: Vec<Vec<f64>>,
    /// The same summed by frame.
    by_frame: Vec<Vec<f64>>,
    /// The same summed by simulated value and channel: rounding is the same wherever a colour is.
    by_value: Vec<Vec<f64>>,
    /// Sum of the weights of all values, per DN^2.
    weight: f64,
    /// Root mean square slope of the simulated pictures, DN a px.
    gradient_dn: f64,
    /// How differences were weighed, and their mean cost.
    pub weighing: Arc<Weighing>,
    pub cost: f64,
    /// Number of values.
    pub count: f64,
}

/// What one frame contributes.
struct Share {
    a: Vec<Vec<f64>>,
    clusters: Vec<Vec<f64>>,
    by_value: Vec<Vec<f64>>,
    cost: f64,
    weight: f64,
}

/// Residual, derivatives, and the key of the simulated value (see [`value_keys`]) of one frame.
type FrameValues = (Vec<f32>, Vec<Vec<f32>>, Vec<u16>);

/// How the derivative by a parameter is had.
enum Column {
    /// Renders at the stepped place.
    Render(Vec<std::sync::Arc<Plane<f32>>>),
    /// A displacement of the content, the same for all frames.
    Remap(Flow),
    /// A shift in time.
    Time,
    /// Values alone change.
    Value(Tone),
}

/// The normal equations at `theta`; differences are weighed as in `known`, or as they are at `theta`.
pub(super) fn linearise(
    forward: &mut Forward,
    target: Target<'_>,
    frames: &[usize],
    theta: &Theta,
    free: &[P],
    level: &Level,
    known: Option<Arc<Weighing>>,
) -> Result<Equations> {
    let radiance = forward.radiance(frames, theta, level.quality)?;
    // On coarse pictures steps are longer: a derivative should see what a block sees.
    let stretch = if level.block >= 4 { 3.0 } else { 1.0 };
    let mut columns = Vec::new();
    for &p in free {
        let step = step_of(forward, theta, p, stretch);
        let changed = theta.with(p, theta.get(p) + step).with(P::Quality, 0.0);
        let column = match p {
            P::Exposure => Column::Render(forward.radiance(frames, &changed, level.quality)?),
            P::Offset | P::Readout => Column::Time,
            p if p.is_remap() => Column::Remap(forward.flow_of_remap(theta, p, step)),
            _ => Column::Value(Tone::new(&changed)),
        };
        columns.push((p, step, changed, column));
    }
    let shared = &*forward;
    let tone = Tone::new(theta);
    // A compressor's steps have no slope: derivatives are taken before it.
    let smooth = theta.with(P::Quality, 0.0);
    let packed = theta.is_on(P::Quality);
    let timed = columns.iter().any(|c| matches!(c.3, Column::Time));
    let by_frame: Vec<FrameValues> = frames
        .par_iter()
        .enumerate()
        .map(|(i, &at)| {
            let base = shared.develop(at, &radiance[i], &smooth, &tone);
            let delivered = packed.then(|| shared.develop(at, &radiance[i], theta, &tone));
            let r = residual(target, at, delivered.as_ref().unwrap_or(&base), level.block);
            let keys = value_keys(&base, level.block);
            let velocity = timed.then(|| shared.velocity(at, theta));
            let derivative = |(p, step, changed, column): &(P, f64, Theta, Column)| {
                let moved;
                let other = match column {
                    Column::Render(renders) => shared.develop(at, &renders[i], changed, &tone),
                    Column::Remap(flow) => {
                        moved = displaced(&radiance[i], flow);
                        shared.develop(at, &moved, &smooth, &tone)
                    }
                    Column::Time => {
                        let velocity = velocity.as_ref().expect("made where it is needed");
                        moved = displaced(&radiance[i], &shared.flow_of_time(theta, velocity, *p, *step));
                        shared.develop(at, &moved, changed, &tone)
                    }
                    Column::Value(tone) => shared.develop(at, &radiance[i], changed, tone),
                };
                let unit = (p.spec().step / step) as f32;
                let mut d: Vec<f32> =
                    other.data.iter().zip(&base.data).map(|(o, b)| (o - b) * unit).collect();
                hide(target, at, &mut d);
                pooled(&d, base.width, base.height, level.block)
            };
            (r, columns.par_iter().map(derivative).collect(), keys)
        })
        .collect();
    let columns_px = forward.intrinsics.width as usize / level.block;
    let weighing = match known {
        Some(known) => known,
        None => {
            let residuals: Vec<&[f32]> = by_frame.iter().map(|f| &f.0[..]).collect();
            Arc::new(super::fit::weighing_of(forward, frames, theta, level, 1.0)?.chosen(&residuals))
        }
    };
    let mut e = assemble(&by_frame, free.len(), columns_px, CLUSTER_PX / level.block, weighing);
    e.gradient_dn = gradient_dn(&forward.simulate(&frames[..1], theta, level.quality)?[0]);
    Ok(e)
}

/// Root mean square slope along rows, DN a px.
fn gradient_dn(mean: &Plane<f32>) -> f64 {
    let steps = mean.data.windows(6).step_by(3).map(|p| f64::from(p[3] - p[0]).powi(2));
    (steps.sum::<f64>() / (mean.data.len() / 3).max(1) as f64).sqrt()
}

/// Whole DN and channel of each value of a picture averaged over blocks.
fn value_keys(mean: &Plane<f32>, block: usize) -> Vec<u16> {
    let values = pooled(&mean.data, mean.width, mean.height, block);
    values.iter().enumerate().map(|(i, v)| 3 * v.clamp(0.0, 255.0) as u16 + (i % 3) as u16).collect()
}

/// Step of a numeric derivative, away from the end of the range.
fn step_of(forward: &Forward, theta: &Theta, p: P, stretch: f64) -> f64 {
    let mut step = p.spec().step * if p.is_time() || p.is_remap() { stretch } else { 1.0 };
    if p == P::Defocus && theta.get(p) < 0.3 {
        // A blur's slope at none is none.
        step = 0.4;
    }
    let changed = bounded(forward, theta.with(p, theta.get(p) + step));
    if (changed.get(p) - theta.get(p)).abs() < 0.5 * step { -step } else { step }
}

fn assemble(
    frames: &[FrameValues],
    n: usize,
    columns_px: usize,
    cluster: usize,
    weighing: Arc<Weighing>,
) -> Equations {
    let count = frames.iter().map(|f| f.0.len()).sum::<usize>().max(1) as f64;
    let one = |f: usize| {
        let r = &frames[f].0;
        share(&frames[f], weighing.weights(f, r), weighing.cost(f, r), columns_px, cluster.max(1))
    };
    let shares: Vec<Share> = (0..frames.len()).into_par_iter().map(one).collect();
    let mut e = Equations {
        a: vec![vec![0.0; n]; n],
        b: vec![0.0; n],
        clusters: Vec::new(),
        by_frame: Vec::new(),
        by_value: vec![vec![0.0; n]; VALUES],
        weight: shares.iter().map(|s| s.weight).sum(),
        gradient_dn: 0.0,
        weighing,
        cost: shares.iter().map(|s| s.cost).sum::<f64>() / count,
        count,
    };
    for s in shares {
        let mut frame = vec![0.0; n];
        for g in &s.clusters {
            (0..n).for_each(|i| frame[i] += g[i]);
        }
        for i in 0..n {
            (0..n).for_each(|j| e.a[i][j] += s.a[i][j]);
            e.b[i] += frame[i];
        }
        e.by_frame.push(frame);
        for (sum, g) in e.by_value.iter_mut().zip(&s.by_value) {
            (0..n).for_each(|i| sum[i] += g[i]);
        }
        e.clusters.extend(s.clusters);
    }
    e
}

/// One frame's share, with the weights of its differences.
fn share(
    (r, columns, keys): &FrameValues,
    weights: Vec<f32>,
    cost: f64,
    columns_px: usize,
    cluster: usize,
) -> Share {
    let n = columns.len();
    let mut a = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in i..n {
            // Sums over runs in f32 would lose digits.
            let mut sum = 0.0f64;
            for ((&w, &d), &o) in weights.iter().zip(&columns[i]).zip(&columns[j]) {
                sum += f64::from(w * d * o);
            }
            a[i][j] = sum;
            a[j][i] = sum;
        }
    }
    let across = columns_px.div_ceil(cluster);
    let rows = r.len() / 3 / columns_px.max(1);
    let mut clusters = vec![vec![0.0; n]; across * rows.div_ceil(cluster)];
    let mut by_value = vec![vec![0.0; n]; VALUES];
    for (i, column) in columns.iter().enumerate() {
        for (at, ((&w, &e), &d)) in weights.iter().zip(r).zip(column).enumerate() {
            let (x, y) = ((at / 3) % columns_px, at / 3 / columns_px);
            let g = f64::from(w * e * d);
            clusters[(y / cluster) * across + x / cluster][i] += g;
            by_value[usize::from(keys[at])][i] += g;
        }
    }
    let weight = weights.iter().map(|w| f64::from(*w)).sum();
    Share { a, clusters, by_value, cost, weight }
}

/// What share of the cost each group of parameters would take off beside `held`, by the linearised model: a ranking, not a
/// fit.
pub(super) fn screened(e: &Equations, all: &[P], held: &[P], groups: &[Vec<P>]) -> Vec<f64> {
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

/// Half widths of 95 % intervals from the spread of gradients between blocks of the frames (each is one draw: the
/// sandwich estimate), or between frames where that is wider, and from what renderers differ by.
pub(super) fn half_widths(e: &Equations, free: &[P]) -> BTreeMap<P, f64> {
    let n = free.len();
    let Some(l) = cholesky(&e.a, 1e-9) else { return BTreeMap::new() };
    let variance = |draws: &[Vec<f64>]| -> Vec<f64> {
        let m = draws.len() as f64;
        let mut sum = vec![0.0; n];
        for g in draws {
            let centred: Vec<f64> = g.iter().zip(&e.b).map(|(g, b)| g - b / m).collect();
            let x = back(&l, &centred);
            (0..n).for_each(|i| sum[i] += x[i] * x[i]);
        }
        sum.iter().map(|s| s * m / (m - 1.0).max(1.0)).collect()
    };
    let draws = [variance(&e.clusters), variance(&e.by_frame), variance(&e.by_value)];
    free.iter()
        .enumerate()
        .map(|(i, &p)| {
            let chance = 2.0 * draws.iter().map(|v| v[i]).fold(0.0, f64::max).sqrt();
            // What all frames share, were it to look like this parameter beside the others.
            let mut unit = vec![0.0; n];
            unit[i] = 1.0;
            let edges_dn = if p.is_time() || p.is_remap() { SYSTEMATIC_PX * e.gradient_dn } else { 0.0 };
            let systematic = SYSTEMATIC_DN.hypot(edges_dn) * (e.weight * back(&l, &unit)[i]).max(0.0).sqrt();
            (p, chance.hypot(systematic) * p.spec().step)
        })
        .collect()
}
