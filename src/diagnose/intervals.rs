//! Half widths of 95 % intervals: what chance, rounding, and the differences between correct renderers can do to a fit.
//!
//! Chance is the sandwich estimate: the spread of gradients between parts of the frames, each part one draw. Parts are
//! blocks of a frame, whole frames, and blocks over all frames (what renderers do differently at an edge or in a texture
//! they do in every frame), whichever spreads most. Rounding is no chance: all values of a colour are rounded alike, and
//! the fit removes most of what could be seen of it; its variance is known beforehand, 1/12 DN^2. What renderers differ by
//! is known in kind: a pixel's filter a little wider or narrower, edges a little off, and an offset anywhere.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::fit::{Level, Target, spread_out};
use super::forward::Forward;
use super::linear::{back, cholesky};
use super::model::{P, Theta};
use super::normal::{Equations, FrameValues, VALUES, linearise};
use crate::error::Result;

/// Mean difference of two correct renderers that a parameter may take up, DN: half a tenth of what they differ by
/// (measured against an independent path tracer: readouts, vignetting and gamma were off by 0.1 to 1 % so).
const SYSTEMATIC_DN: f64 = 0.025;
/// How far two correct renderers place an edge apart, px: what an exposure of a slow motion was off by.
const SYSTEMATIC_PX: f64 = 0.01;
/// What two correct renderers make differently of a colour, DN: software devices decode textures to within so much (measured
/// against the CPU reference: real frames stood 0.09 DN above simulated ones, none below).
const SYSTEMATIC_COLOUR_DN: f64 = 0.1;
/// The same of all colours alike, DN: blind, gains and gammas were off by 0.05 to 0.06 DN beyond what single colours explain.
const COMMON_DN: f64 = 0.03;
/// Whole DN that count as one colour.
const COLOUR_DN: usize = 4;
/// By how much the variances of two correct renderers' pixels differ, px^2: a third of a pixel's own 1/12.
const SYSTEMATIC_PX2: f64 = 0.03;

/// Side of the blocks of a picture whose gradients are taken for independent draws, px.
const CLUSTER_PX: usize = 32;

/// Half widths of 95 % intervals of `free` at `theta`.
pub(super) fn intervals(
    forward: &mut Forward,
    target: Target<'_>,
    frames: &[usize],
    theta: &Theta,
    free: &[P],
    level: &Level,
) -> Result<BTreeMap<P, f64>> {
    if free.is_empty() {
        return Ok(BTreeMap::new());
    }
    let some = spread_out(frames, level.frames);
    // A blur that no fit has freed, to see what a wider filter would do.
    let mut all = free.to_vec();
    if !all.contains(&P::Defocus) {
        all.push(P::Defocus);
    }
    let e = linearise(forward, target, &some, theta, &all, level, None)?;
    let n = free.len();
    let a: Vec<Vec<f64>> = e.a[..n].iter().map(|row| row[..n].to_vec()).collect();
    let Some(l) = cholesky(&a, 1e-9) else { return Ok(BTreeMap::new()) };
    let columns_px = forward.intrinsics.width as usize / level.block;
    let mut chance = vec![0.0f64; n];
    for draws in draws(&e, n, columns_px, CLUSTER_PX / level.block) {
        let spread = variance(&l, &draws, n);
        (0..n).for_each(|i| chance[i] = chance[i].max(spread[i]));
    }
    let rounding = rounding(&e, &l, n);
    let colours = colours(&e, &l, n);
    let filter = filter(&e, &l, &all, theta, n);
    let half = |(i, &p): (usize, &P)| {
        // What all frames share, were it to look like this parameter beside the others.
        let mut unit = vec![0.0; n];
        unit[i] = 1.0;
        let edges_dn = if p.is_time() || p.is_remap() { SYSTEMATIC_PX * e.gradient_dn } else { 0.0 };
        let systematic = SYSTEMATIC_DN.hypot(edges_dn) * (e.weight * back(&l, &unit)[i]).max(0.0).sqrt();
        let random = 2.0 * (chance[i] + rounding[i] + colours[i]).sqrt();
        tracing::debug!(
            "{p:?}: chance {:.2e}, rounding {:.2e}, colours {:.2e}, renderers {systematic:.2e}, filter {:.2e} of {:.0e}",
            2.0 * chance[i].sqrt(),
            2.0 * rounding[i].sqrt(),
            2.0 * colours[i].sqrt(),
            filter[i],
            p.spec().step
        );
        (p, random.hypot(systematic).hypot(filter[i]) * p.spec().step)
    };
    Ok(free.iter().enumerate().map(half).collect())
}

/// Gradients of the parts that are taken for independent draws, in three ways.
fn draws(e: &Equations, n: usize, columns_px: usize, cluster: usize) -> [Vec<Vec<f64>>; 3] {
    let across = columns_px.div_ceil(cluster);
    let blocks = |(f, (r, columns, _)): (usize, &FrameValues)| -> Vec<Vec<f64>> {
        let weights = e.weighing.weights(f, r);
        let rows = r.len() / 3 / columns_px.max(1);
        let mut sums = vec![vec![0.0; n]; across * rows.div_ceil(cluster)];
        for (i, column) in columns[..n].iter().enumerate() {
            for (at, ((&w, &e), &d)) in weights.iter().zip(r).zip(column).enumerate() {
                let (x, y) = ((at / 3) % columns_px, at / 3 / columns_px);
                sums[(y / cluster) * across + x / cluster][i] += f64::from(w * e * d);
            }
        }
        sums
    };
    let frames: Vec<Vec<Vec<f64>>> = e.values.par_iter().enumerate().map(blocks).collect();
    let sum = |parts: &mut dyn Iterator<Item = &Vec<f64>>| {
        parts.fold(vec![0.0; n], |sum, g| (0..n).map(|i| sum[i] + g[i]).collect())
    };
    let by_frame = frames.iter().map(|f| sum(&mut f.iter())).collect();
    let places = frames.first().map_or(0, Vec::len);
    let by_place = (0..places).map(|k| sum(&mut frames.iter().map(|f| &f[k]))).collect();
    [frames.into_iter().flatten().collect(), by_frame, by_place]
}

/// The sandwich estimate, in units of the steps.
fn variance(l: &[Vec<f64>], draws: &[Vec<f64>], n: usize) -> Vec<f64> {
    let m = draws.len() as f64;
    let mean: Vec<f64> = (0..n).map(|i| draws.iter().map(|g| g[i]).sum::<f64>() / m.max(1.0)).collect();
    let mut sum = vec![0.0; n];
    for g in draws {
        let centred: Vec<f64> = g[..n].iter().zip(&mean).map(|(g, m)| g - m).collect();
        let x = back(l, &centred);
        (0..n).for_each(|i| sum[i] += x[i] * x[i]);
    }
    sum.iter().map(|s| s * m / (m - 1.0).max(1.0)).collect()
}

/// Variance from rounding. Noise of some tenths of a DN shakes it: what is left of the mean's error falls with
/// exp(-2 pi^2 variance), the first term of the sawtooth's series.
fn rounding(e: &Equations, l: &[Vec<f64>], n: usize) -> Vec<f64> {
    // By simulated value: sums of weighted derivatives, shaken.
    let mut slopes = vec![vec![0.0f64; n]; VALUES];
    for (f, (r, columns, keys)) in e.values.iter().enumerate() {
        let weights = e.weighing.weights(f, r);
        for (at, (&key, w)) in keys.iter().zip(weights).enumerate() {
            let noise2 = f64::from(e.weighing.noise_at(f, at));
            let weight = f64::from(w) * (-2.0 * std::f64::consts::PI.powi(2) * noise2).exp();
            if weight > 1e-6 {
                let sums = &mut slopes[usize::from(key)];
                (0..n).for_each(|i| sums[i] += weight * f64::from(columns[i][at]));
            }
        }
    }
    let mut sum = vec![0.0; n];
    for part in slopes.iter().filter(|s| s.iter().any(|v| *v != 0.0)) {
        let x = back(l, part);
        (0..n).for_each(|i| sum[i] += x[i] * x[i] / 12.0);
    }
    sum
}

/// Variance from colours that renderers make differently, each colour and channel for itself and all of them alike.
fn colours(e: &Equations, l: &[Vec<f64>], n: usize) -> Vec<f64> {
    let per = VALUES / 256 * COLOUR_DN;
    let mut slopes = vec![vec![0.0f64; n]; VALUES.div_ceil(per) * 3];
    for (f, (r, columns, keys)) in e.values.iter().enumerate() {
        for (at, (&key, w)) in keys.iter().zip(e.weighing.weights(f, r)).enumerate() {
            let sums = &mut slopes[usize::from(key) / per * 3 + usize::from(key) % 3];
            (0..n).for_each(|i| sums[i] += f64::from(w * columns[i][at]));
        }
    }
    let mut sum = vec![0.0; n];
    for part in &slopes {
        let x = back(l, part);
        (0..n).for_each(|i| sum[i] += (SYSTEMATIC_COLOUR_DN * x[i]).powi(2));
    }
    let all: Vec<f64> = (0..n).map(|i| slopes.iter().map(|s| s[i]).sum()).collect();
    let x = back(l, &all);
    (0..n).for_each(|i| sum[i] += (COMMON_DN * x[i]).powi(2));
    sum
}

/// What a filter of another width would move the parameters by, in units of their steps.
fn filter(e: &Equations, l: &[Vec<f64>], all: &[P], theta: &Theta, n: usize) -> Vec<f64> {
    let at = all.iter().position(|p| *p == P::Defocus).expect("among them");
    let sigma = theta.get(P::Defocus);
    if at < n {
        // The blur itself is what a filter looks like; what it trades against moves along.
        let moved = (sigma.powi(2) + SYSTEMATIC_PX2).sqrt() - sigma;
        let column: Vec<f64> = (0..n).map(|i| e.a[i][at] * moved / P::Defocus.spec().step).collect();
        return back(l, &column).into_iter().map(f64::abs).collect();
    }
    // Derivatives by a blur from none are differences over 0.4 px, that is over 0.16 px^2, in units of 0.1 px.
    let per_px2 = 0.4 / P::Defocus.spec().step / 0.16;
    let column: Vec<f64> = (0..n).map(|i| e.a[i][at] * SYSTEMATIC_PX2 * per_px2).collect();
    back(l, &column).into_iter().map(f64::abs).collect()
}
