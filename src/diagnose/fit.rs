//! Levenberg-Marquardt on the differences between real and simulated values, robust against what renderers do
//! differently at edges, from coarse pictures to fine ones.

use std::collections::BTreeMap;

use glam::DVec2;
use rayon::prelude::*;

use super::evidence::Evidence;
use super::forward::Forward;
use super::model::{P, Theta};
use crate::error::Result;
use crate::plane::Plane;

/// Mean difference of two correct renderers that a parameter may take up, DN: half a tenth of what they differ by
/// (measured against an independent path tracer: readouts, vignetting and gamma were off by 0.1 to 1 % so).
const SYSTEMATIC_DN: f64 = 0.025;

/// What a fit compares with.
pub(super) struct Target<'a> {
    pub evidence: &'a Evidence,
    /// By place; 1 where compared.
    pub masks: Option<&'a [Plane<f32>]>,
}

/// How a fit goes about it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Schedule {
    /// Px a block over which values are averaged, and most iterations there; one after another.
    pub levels: &'static [(usize, usize)],
}

impl Schedule {
    /// From far away, but not to the end.
    pub(super) const COARSE: Self = Self { levels: &[(8, 3), (4, 2)] };
    /// To see whether anything is gained.
    pub(super) const GLANCE: Self = Self { levels: &[(8, 2), (2, 1)] };
    /// From nearby.
    pub(super) const FINE: Self = Self { levels: &[(2, 3), (1, 4)] };
}

/// A finished fit.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub theta: Theta,
    /// Mean robust cost at the last level.
    pub cost: f64,
    /// Half widths of 95 % intervals; empty where they could not be had.
    pub half: BTreeMap<P, f64>,
}

/// Normal equations, and the gradient of each frame.
struct Equations {
    a: Vec<Vec<f64>>,
    b: Vec<f64>,
    by_frame: Vec<Vec<f64>>,
    /// Mean size of each column, DN per step.
    reach: Vec<f64>,
}

/// Fits the `free` parameters on `frames` (places), starting from `start`.
pub(super) fn fit(
    forward: &mut Forward,
    target: &Target<'_>,
    frames: &[usize],
    start: &Theta,
    free: &[P],
    schedule: Schedule,
) -> Result<Fit> {
    let mut theta = bounded(forward, start.clone());
    let mut cost = f64::INFINITY;
    let mut last = None;
    for &(block, iterations) in schedule.levels {
        let mut delta = None;
        let mut damping = 1e-3;
        cost = f64::INFINITY;
        for _ in 0..iterations {
            let (equations, delta_now, cost_now) =
                linearise(forward, target, frames, &theta, free, block, delta)?;
            // One threshold per level: costs must compare.
            delta = Some(delta_now);
            cost = cost_now;
            let (step, accepted) = advance(
                forward,
                target,
                frames,
                (&mut theta, &mut cost),
                free,
                (block, delta_now),
                (&equations, &mut damping),
            )?;
            last = Some(equations);
            if !accepted || step < 2e-2 {
                break;
            }
        }
    }
    let half = last.map(|e| half_widths(&e, free)).unwrap_or_default();
    Ok(Fit { theta, cost, half })
}

/// Tries steps until one lowers the cost; returns its largest component in units of the parameters' steps.
fn advance(
    forward: &mut Forward,
    target: &Target<'_>,
    frames: &[usize],
    (theta, cost): (&mut Theta, &mut f64),
    free: &[P],
    (block, delta): (usize, f64),
    (equations, damping): (&Equations, &mut f64),
) -> Result<(f64, bool)> {
    for _ in 0..4 {
        let Some(step) = solve(&equations.a, &equations.b, *damping) else { return Ok((0.0, false)) };
        let mut trial = theta.clone();
        for (&p, s) in free.iter().zip(&step) {
            trial.set(p, theta.get(p) + s * p.spec().step);
        }
        let trial = bounded(forward, trial);
        let moved =
            free.iter().map(|&p| ((trial.get(p) - theta.get(p)) / p.spec().step).abs()).fold(0.0, f64::max);
        if moved < 1e-6 {
            return Ok((0.0, false));
        }
        let now = cost_of(forward, target, frames, &trial, block, delta)?;
        if now < *cost {
            (*theta, *cost) = (trial, now);
            *damping = (*damping * 0.2).max(1e-6);
            return Ok((moved, true));
        }
        *damping = (*damping * 10.0).max(1e-2);
    }
    Ok((0.0, false))
}

/// Keeps times inside what the trajectory covers.
fn bounded(forward: &Forward, mut theta: Theta) -> Theta {
    let [from_s, to_s] = forward.offsets_s();
    theta.set(P::Offset, theta.get(P::Offset).clamp(from_s, to_s));
    let longest_s = forward.longest_s();
    for p in [P::Readout, P::Exposure] {
        theta.set(p, theta.get(p).min(longest_s));
    }
    theta
}

/// Robust cost of `theta` on pictures averaged over blocks. `delta`: where absolute errors begin, DN.
pub(super) fn cost_of(
    forward: &mut Forward,
    target: &Target<'_>,
    frames: &[usize],
    theta: &Theta,
    block: usize,
    delta: f64,
) -> Result<f64> {
    let simulated = forward.simulate(frames, theta)?;
    let costs: Vec<(f64, f64)> = frames
        .par_iter()
        .zip(&simulated)
        .map(|(&at, s)| {
            let r = residual(target, at, s, block);
            let sum: f64 = r.iter().map(|&e| huber(f64::from(e), delta)).sum();
            (sum, r.len() as f64)
        })
        .collect();
    let (sum, count) = costs.into_iter().fold((0.0, 0.0), |a, c| (a.0 + c.0, a.1 + c.1));
    Ok(sum / f64::max(count, 1.0))
}

fn huber(e: f64, delta: f64) -> f64 {
    let e = e.abs();
    if e <= delta { 0.5 * e * e / delta } else { e - 0.5 * delta }
}

/// Real minus simulated, averaged over blocks; masked values are 0.
fn residual(target: &Target<'_>, at: usize, simulated: &Plane<f32>, block: usize) -> Vec<f32> {
    let real = &target.evidence.frames[at].dn;
    let mut data: Vec<f32> = real.data.iter().zip(&simulated.data).map(|(r, s)| r - s).collect();
    hide(target, at, &mut data);
    pooled(&data, simulated.width, simulated.height, block)
}

fn hide(target: &Target<'_>, at: usize, data: &mut [f32]) {
    if let Some(masks) = target.masks {
        for (values, m) in data.chunks_exact_mut(3).zip(&masks[at].data) {
            if *m <= 0.5 {
                values.fill(0.0);
            }
        }
    }
}

/// Means over blocks; what does not fill a block at the right and lower border is left out.
fn pooled(data: &[f32], w: usize, h: usize, block: usize) -> Vec<f32> {
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

/// Displacement of the picture's points per unit step of a parameter, px, per channel.
struct Flow(Vec<Vec<[f32; 2]>>);

fn flow_of(forward: &Forward, theta: &Theta, p: P, step: f64) -> Flow {
    let k = &forward.intrinsics;
    let (w, h) = (k.width as usize, k.height as usize);
    let moved = theta.with(p, theta.get(p) + step);
    let channels: &[usize] = if matches!(p, P::ScaleR | P::ScaleB) { &[0, 1, 2] } else { &[1] };
    let of = |channel: usize| -> Vec<[f32; 2]> {
        (0..w * h)
            .into_par_iter()
            .map(|i| {
                let px = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
                let (now, then) = (forward.source(px, theta, channel), forward.source(px, &moved, channel));
                (then - now).as_vec2().to_array()
            })
            .collect()
    };
    Flow(channels.iter().map(|&c| of(c)).collect())
}

/// The picture with its content displaced, to first order.
fn displaced(radiance: &Plane<f32>, flow: &Flow) -> Plane<f32> {
    let (w, h) = (radiance.width, radiance.height);
    Plane::from_fn(w, h, |x, y| {
        let (left, right) = (radiance.pixel(x.saturating_sub(1), y), radiance.pixel((x + 1).min(w - 1), y));
        let (above, below) = (radiance.pixel(x, y.saturating_sub(1)), radiance.pixel(x, (y + 1).min(h - 1)));
        let here = radiance.pixel(x, y);
        [0, 1, 2].map(|c| {
            let [dx, dy] = flow.0[c.min(flow.0.len() - 1)][y * w + x];
            here[c] + 0.5 * ((right[c] - left[c]) * dx + (below[c] - above[c]) * dy)
        })
    })
}

/// The normal equations at `theta`, in units of the parameters' steps; the robust threshold and the cost.
fn linearise(
    forward: &mut Forward,
    target: &Target<'_>,
    frames: &[usize],
    theta: &Theta,
    free: &[P],
    block: usize,
    delta: Option<f64>,
) -> Result<(Equations, f64, f64)> {
    let radiance = forward.radiance(frames, theta)?;
    // On coarse pictures steps are longer: a derivative should see what a block sees.
    let stretch = if block >= 4 { 3.0 } else { 1.0 };
    let mut steps = Vec::new();
    let mut moved = BTreeMap::new();
    let mut flows = BTreeMap::new();
    for &p in free {
        let spec = p.spec();
        let mut step = spec.step * if p.is_time() || p.is_remap() { stretch } else { 1.0 };
        if p == P::Defocus && theta.get(p) < 0.3 {
            // A blur's slope at none is none.
            step = 0.4;
        }
        let changed = bounded(forward, theta.with(p, theta.get(p) + step));
        if (changed.get(p) - theta.get(p)).abs() < 0.5 * step {
            step = -step;
        }
        steps.push(step);
        if p.is_time() {
            moved.insert(p, forward.radiance(frames, &theta.with(p, theta.get(p) + step))?);
        } else if p.is_remap() {
            flows.insert(p, flow_of(forward, theta, p, step));
        }
    }
    let shared = &*forward;
    let by_frame: Vec<_> = frames
        .par_iter()
        .enumerate()
        .map(|(i, &at)| {
            let base = shared.develop(at, &radiance[i], theta);
            let r = residual(target, at, &base, block);
            let columns: Vec<Vec<f32>> = free
                .par_iter()
                .zip(&steps)
                .map(|(&p, &step)| {
                    let changed = theta.with(p, theta.get(p) + step);
                    let other = if let Some(moved) = moved.get(&p) {
                        shared.develop(at, &moved[i], &changed)
                    } else if let Some(flow) = flows.get(&p) {
                        shared.develop(at, &displaced(&radiance[i], flow), theta)
                    } else {
                        shared.develop(at, &radiance[i], &changed)
                    };
                    let unit = (p.spec().step / step) as f32;
                    let mut d: Vec<f32> =
                        other.data.iter().zip(&base.data).map(|(o, b)| (o - b) * unit).collect();
                    hide(target, at, &mut d);
                    pooled(&d, base.width, base.height, block)
                })
                .collect();
            (r, columns)
        })
        .collect();
    let count: usize = by_frame.iter().map(|(r, _)| r.len()).sum();
    let absolute: f64 = by_frame.iter().map(|(r, _)| r.iter().map(|e| f64::from(e.abs())).sum::<f64>()).sum();
    let delta = delta.unwrap_or_else(|| (1.5 * absolute / count.max(1) as f64).max(0.7));
    let parts: Vec<_> = by_frame.par_iter().map(|(r, columns)| normal(r, columns, delta)).collect();
    let n = free.len();
    let mut sum =
        Equations { a: vec![vec![0.0; n]; n], b: vec![0.0; n], by_frame: Vec::new(), reach: Vec::new() };
    let mut cost = 0.0;
    for (a, b, c) in parts {
        for i in 0..n {
            (0..n).for_each(|j| sum.a[i][j] += a[i][j]);
            sum.b[i] += b[i];
        }
        cost += c;
        sum.by_frame.push(b);
    }
    sum.reach = (0..n)
        .map(|i| {
            let total: f64 =
                by_frame.iter().map(|(_, c)| c[i].iter().map(|d| f64::from(d.abs())).sum::<f64>()).sum();
            total / count.max(1) as f64
        })
        .collect();
    Ok((sum, delta, cost / count.max(1) as f64))
}

/// How much each group of parameters would lower the cost beside `held`, by the linearised model: a ranking, not a fit.
pub(super) fn screen(
    forward: &mut Forward,
    target: &Target<'_>,
    frames: &[usize],
    theta: &Theta,
    held: &[P],
    groups: &[Vec<P>],
) -> Result<Vec<f64>> {
    let mut all: Vec<P> = held.iter().chain(groups.iter().flatten()).copied().collect();
    all.sort();
    all.dedup();
    let (e, ..) = linearise(forward, target, frames, theta, &all, 2, None)?;
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
        gain(&members) - alone
    });
    Ok(beside.collect())
}

/// One frame's share, weighted by how Huber's cost weighs each difference.
fn normal(r: &[f32], columns: &[Vec<f32>], delta: f64) -> (Vec<Vec<f64>>, Vec<f64>, f64) {
    let n = columns.len();
    let (mut a, mut b, mut cost) = (vec![vec![0.0; n]; n], vec![0.0; n], 0.0);
    let weights: Vec<f32> = r.iter().map(|&e| (1.0 / f64::from(e.abs()).max(delta)) as f32).collect();
    for &e in r {
        cost += huber(f64::from(e), delta);
    }
    for i in 0..n {
        let dot = |other: &[f32]| {
            // Sums over runs in f32 would lose digits.
            let mut sum = 0.0f64;
            for ((&w, &d), &o) in weights.iter().zip(&columns[i]).zip(other) {
                sum += f64::from(w * d * o);
            }
            sum
        };
        b[i] = dot(r);
        for j in i..n {
            a[i][j] = dot(&columns[j]);
            a[j][i] = a[i][j];
        }
    }
    (a, b, cost)
}

/// `(A + damping diag A) x = b` by Cholesky.
fn solve(a: &[Vec<f64>], b: &[f64], damping: f64) -> Option<Vec<f64>> {
    let l = cholesky(a, damping)?;
    Some(back(&l, b))
}

fn cholesky(a: &[Vec<f64>], damping: f64) -> Option<Vec<Vec<f64>>> {
    let n = a.len();
    let tiny = 1e-12 * (0..n).map(|i| a[i][i]).fold(0.0, f64::max);
    let mut l = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let mut sum = a[i][j];
            if i == j {
                sum += damping * a[i][i] + tiny;
            }
            for k in 0..j {
                sum -= l[i][k] * l[j][k];
            }
            if i == j {
                if !(sum > 0.0) {
                    return None;
                }
                l[i][i] = sum.sqrt();
            } else {
                l[i][j] = sum / l[j][j];
            }
        }
    }
    Some(l)
}

fn back(l: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    let n = b.len();
    let mut x = b.to_vec();
    for i in 0..n {
        for k in 0..i {
            x[i] -= l[i][k] * x[k];
        }
        x[i] /= l[i][i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            x[i] -= l[k][i] * x[k];
        }
        x[i] /= l[i][i];
    }
    x
}

/// Half widths from the spread of the frames' gradients (each frame is one draw): the sandwich estimate.
fn half_widths(e: &Equations, free: &[P]) -> BTreeMap<P, f64> {
    let (n, frames) = (free.len(), e.by_frame.len());
    let Some(l) = cholesky(&e.a, 1e-9) else { return BTreeMap::new() };
    if frames < 2 {
        return BTreeMap::new();
    }
    let mean: Vec<f64> = (0..n).map(|i| e.b[i] / frames as f64).collect();
    let mut variance = vec![0.0; n];
    for g in &e.by_frame {
        let centred: Vec<f64> = g.iter().zip(&mean).map(|(g, m)| g - m).collect();
        let x = back(&l, &centred);
        (0..n).for_each(|i| variance[i] += x[i] * x[i]);
    }
    let spread = frames as f64 / (frames as f64 - 1.0);
    // Student's t, 97.5 %, for as many frames less one.
    let t = [12.7, 12.7, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31][frames.min(8)];
    free.iter()
        .enumerate()
        .map(|(i, &p)| {
            let chance = t * (variance[i] * spread).sqrt();
            // What all frames share: renderers that place edges a little differently.
            let systematic = SYSTEMATIC_DN / e.reach[i].max(1e-9);
            (p, chance.hypot(systematic) * p.spec().step)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cholesky_solves_and_refuses_what_is_singular() {
        let a = vec![vec![4.0, 2.0, 0.0], vec![2.0, 5.0, 1.0], vec![0.0, 1.0, 3.0]];
        let x = solve(&a, &[2.0, -1.0, 4.0], 0.0).expect("positive definite");
        for (row, b) in a.iter().zip([2.0, -1.0, 4.0]) {
            let got: f64 = row.iter().zip(&x).map(|(a, x)| a * x).sum();
            assert!((got - b).abs() < 1e-9);
        }
        assert!(solve(&[vec![1.0, 2.0], vec![2.0, 1.0]], &[1.0, 1.0], 0.0).is_none());
    }
}
