//! Half widths of 95 % intervals: what chance, rounding, and the differences between correct renderers can do to a fit.
//!
//! Chance is the sandwich estimate: the spread of gradients between parts of the frames, each part one draw. Parts are
//! blocks of a frame, whole frames, and blocks over all frames (what renderers do differently at an edge or in a
//! texture they do in every frame), whichever spreads most. Rounding is no chance: all values of a colour are rounded
//! alike, and the fit removes most of what could be seen of it; its variance is known beforehand, 1/12 DN^2. What
//! renderers differ by is known in kind: a pixel's filter a little wider or narrower, edges a little off, and an offset
//! anywhere.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;

use super::cost::{Level, Target};
use super::normal::{Equations, assemble, linearise};
use crate::diagnose::evidence::blocks::pooled;
use crate::diagnose::evidence::spread_out;
use crate::diagnose::expect::discrepancy::{
    ALIKE_DN, ANYTHING_DN, COLOUR_DN, COMMON_DN, FILTER_PX2, PLACE_PX,
};
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::linear::{back, cholesky};
use crate::diagnose::expect::model::{P, Theta};
use crate::diagnose::expect::weighing::FrameValues;
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// Parts of a DN that values are told apart by where rounding is concerned.
const PARTS: f32 = 8.0;
/// Number of keys of values: parts of DN by channel.
const VALUES: usize = 3 * 256 * 8;
/// Side of the blocks of a picture whose gradients are taken for independent draws, px.
const CLUSTER_PX: usize = 32;

/// Steps that look for the place on a way between two pictures, and the step from which on it is found.
const STEPS: usize = 8;
/// See [`STEPS`].
const LEAST_STEP: f64 = 1e-3;

/// Half widths of 95 % intervals of `free` at `theta`.
pub(crate) fn intervals(
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
    let slopes = Slopes::at(forward, target, frames, theta, free, level)?;
    let all: Vec<usize> = (0..free.len()).collect();
    let half = slopes.half_widths(&all).unwrap_or_default();
    Ok(free.iter().zip(half).map(|(&p, h)| (p, h * p.spec().step)).collect())
}

/// What the simulated pictures show that decides how well anything is known from them.
pub(crate) struct Shown {
    /// By frame: eighths of a DN and channel of each value averaged over a block.
    keys: Vec<Vec<u16>>,
    /// Root mean square slope along rows, DN a px.
    gradient_dn: f64,
}

impl Shown {
    pub(crate) fn of(pictures: &[Arc<Plane<f32>>], block: usize) -> Self {
        let keys = |mean: &Arc<Plane<f32>>| {
            let values = pooled(&mean.data, mean.width, mean.height, block);
            let key = |v: f32| 3 * ((PARTS * v.clamp(0.0, 255.0)) as u16);
            values.iter().enumerate().map(|(i, v)| key(*v) + (i % 3) as u16).collect()
        };
        let first = &pictures[0].data;
        let steps = first.windows(6).step_by(3).map(|p| f64::from(p[3] - p[0]).powi(2));
        let gradient_dn = (steps.sum::<f64>() / (first.len() / 3).max(1) as f64).sqrt();
        Self { keys: pictures.par_iter().map(keys).collect(), gradient_dn }
    }
}

/// The normal equations of some parameters, and what is needed to say how well they are known.
pub(crate) struct Slopes {
    e: Equations,
    shown: Shown,
    theta: Theta,
    /// The parameters, and a blur that no fit has freed, to see what a wider filter would do.
    all: Vec<P>,
    columns_px: usize,
    /// Px a block over which values are averaged.
    block: usize,
}

impl Slopes {
    pub(crate) fn at(
        forward: &mut Forward,
        target: Target<'_>,
        frames: &[usize],
        theta: &Theta,
        parameters: &[P],
        level: &Level,
    ) -> Result<Self> {
        let some = spread_out(frames, level.frames);
        let mut all = parameters.to_vec();
        if !all.contains(&P::Defocus) {
            all.push(P::Defocus);
        }
        let e = linearise(forward, target, &some, theta, &all, level, None)?;
        let pictures = forward.pictures(&some, &theta.with(P::Quality, 0.0), level.quality)?;
        let shown = Shown::of(&pictures, level.block);
        let columns_px = forward.intrinsics.width as usize / level.block;
        Ok(Self { e, shown, theta: theta.clone(), all, columns_px, block: level.block })
    }

    pub(crate) fn equations(&self) -> &Equations {
        &self.e
    }

    /// The step that the parameters at these places would take together, as a way to go: how far it leads, 1, and how
    /// well that is known. Parameters that are not known one by one (a vignetting's two beside a veil) may well be
    /// known together.
    pub(crate) fn step(&self, of: &[usize]) -> Option<Way> {
        let e = &self.e;
        let a: Vec<Vec<f64>> = of.iter().map(|&i| of.iter().map(|&j| e.a[i][j]).collect()).collect();
        let b: Vec<f64> = of.iter().map(|&i| e.b[i]).collect();
        let step = back(&cholesky(&a, 1e-9)?, &b);
        let at = self.all.iter().position(|p| *p == P::Defocus)?;
        let wider = moved_by_a_filter(of.contains(&at), self.theta.get(P::Defocus)) as f32;
        let one = |(residual, columns): &FrameValues| -> FrameValues {
            let mut along = vec![0.0f32; residual.len()];
            for (&i, &s) in of.iter().zip(&step) {
                along.iter_mut().zip(&columns[i]).for_each(|(to, d)| *to += s as f32 * d);
            }
            (residual.clone(), vec![along, columns[at].iter().map(|d| wider * d).collect()])
        };
        let values = e.values.par_iter().map(one).collect();
        let moves = of.iter().any(|&i| self.all[i].is_time() || self.all[i].is_remap());
        let e = assemble(values, 2, e.weighing.clone());
        way(e, &self.shown, self.columns_px, self.block, moves)
    }

    /// Half widths of 95 % intervals of the parameters at these places, in units of their steps; nothing where they
    /// cannot be told apart.
    fn half_widths(&self, of: &[usize]) -> Option<Vec<f64>> {
        let (e, n) = (&self.e, of.len());
        let a: Vec<Vec<f64>> = of.iter().map(|&i| of.iter().map(|&j| e.a[i][j]).collect()).collect();
        let l = cholesky(&a, 1e-9)?;
        let chance = chance(e, of, &l, self.columns_px, CLUSTER_PX / self.block);
        let rounding = rounding(e, &self.shown, of, &l);
        let colours = colours(e, &self.shown, of, &l);
        let filter = filter(e, of, &l, &self.all, &self.theta);
        let half = (0..n).map(|i| {
            let p = self.all[of[i]];
            // What all frames share, were it to look like this parameter beside the others.
            let mut unit = vec![0.0; n];
            unit[i] = 1.0;
            let edges_dn = if p.is_time() || p.is_remap() { PLACE_PX * self.shown.gradient_dn } else { 0.0 };
            let systematic = ANYTHING_DN.hypot(edges_dn) * (e.weight * back(&l, &unit)[i]).max(0.0).sqrt();
            let random = 2.0 * (chance[i] + rounding[i] + colours[i]).sqrt();
            tracing::debug!(
                "{p:?}: chance {:.2e}, rounding {:.2e}, colours {:.2e}, renderers {systematic:.2e}, filter {:.2e} of \
                 {:.0e}",
                2.0 * chance[i].sqrt(),
                2.0 * rounding[i].sqrt(),
                2.0 * colours[i].sqrt(),
                filter[i],
                p.spec().step
            );
            random.hypot(systematic).hypot(filter[i])
        });
        Some(half.collect())
    }
}

/// How far a picture lies on the way from one model's to another's, 0 to 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    pub share: f64,
    /// Half width of its 95 % interval: chance, and the discrepancy, were it to look like the difference of the two.
    pub half: f64,
}

/// Where the real picture lies between two models' pictures. The columns of `e` are what one adds to the other, what a
/// wider filter adds, and draws of what else two correct simulations may differ by; `moves` tells whether edges are put
/// elsewhere.
pub(crate) fn way(
    mut e: Equations,
    shown: &Shown,
    columns_px: usize,
    block: usize,
    moves: bool,
) -> Option<Way> {
    let mut share = 0.0;
    // What counts little before the way is gone counts fully where it has led to: edges that lay far off have come to
    // lie right.
    for _ in 0..STEPS {
        if e.a[0][0] <= 0.0 {
            return None;
        }
        let step = e.b[0] / e.a[0][0];
        share += step;
        e = moved_along(e, step as f32);
        if step.abs() < LEAST_STEP {
            break;
        }
    }
    // Chance is what is left at that place: an effect that is strong in some frames and weak in others is no noise.
    let (e, of) = (&e, [0]);
    let l = cholesky(&[vec![e.a[0][0]]], 0.0)?;
    let random = chance(e, &of, &l, columns_px, CLUSTER_PX / block)[0]
        + rounding(e, shown, &of, &l)[0]
        + colours(e, shown, &of, &l)[0];
    let edges_dn = if moves { PLACE_PX * shown.gradient_dn } else { 0.0 };
    let systematic = ANYTHING_DN.hypot(edges_dn) * (e.weight / e.a[0][0]).sqrt();
    let along = |column: usize| e.a[0][column] / e.a[0][0];
    let draws = e.a.len() - 2;
    let drawn = (0..draws).map(|k| along(k + 2).powi(2)).sum::<f64>() / draws.max(1) as f64;
    let half = (2.0 * (random + drawn).sqrt()).hypot(systematic).hypot(along(1));
    Some(Way { share, half })
}

/// The equations where the picture has been moved along the first column by so many of its lengths.
fn moved_along(e: Equations, step: f32) -> Equations {
    let Equations { mut values, weighing, a, .. } = e;
    for (residual, columns) in &mut values {
        residual.iter_mut().zip(&columns[0]).for_each(|(r, d)| *r -= step * d);
    }
    assemble(values, a.len(), weighing)
}

/// The largest of the variances that three ways to draw parts give, in units of the steps.
fn chance(e: &Equations, of: &[usize], l: &[Vec<f64>], columns_px: usize, cluster: usize) -> Vec<f64> {
    let n = of.len();
    let mut chance = vec![0.0f64; n];
    for draws in draws(e, of, columns_px, cluster) {
        let spread = variance(l, &draws, n);
        (0..n).for_each(|i| chance[i] = chance[i].max(spread[i]));
    }
    chance
}

/// Gradients of the parts that are taken for independent draws, in three ways.
fn draws(e: &Equations, of: &[usize], columns_px: usize, cluster: usize) -> [Vec<Vec<f64>>; 3] {
    let n = of.len();
    let across = columns_px.div_ceil(cluster);
    let blocks = |(f, (r, columns)): (usize, &FrameValues)| -> Vec<Vec<f64>> {
        let weights = e.weighing.weights(f, r);
        let rows = r.len() / 3 / columns_px.max(1);
        let mut sums = vec![vec![0.0; n]; across * rows.div_ceil(cluster)];
        for (i, column) in of.iter().map(|&j| &columns[j]).enumerate() {
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
fn rounding(e: &Equations, shown: &Shown, of: &[usize], l: &[Vec<f64>]) -> Vec<f64> {
    let n = of.len();
    // By simulated value: sums of weighted derivatives, shaken.
    let mut slopes = vec![vec![0.0f64; n]; VALUES];
    for (f, ((r, columns), keys)) in e.values.iter().zip(&shown.keys).enumerate() {
        let weights = e.weighing.weights(f, r);
        for (at, (&key, w)) in keys.iter().zip(weights).enumerate() {
            let noise2 = f64::from(e.weighing.noise_at(f, at));
            let weight = f64::from(w) * (-2.0 * std::f64::consts::PI.powi(2) * noise2).exp();
            if weight > 1e-6 {
                let sums = &mut slopes[usize::from(key)];
                (0..n).for_each(|i| sums[i] += weight * f64::from(columns[of[i]][at]));
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
fn colours(e: &Equations, shown: &Shown, of: &[usize], l: &[Vec<f64>]) -> Vec<f64> {
    let n = of.len();
    let per = VALUES / 256 * ALIKE_DN;
    let mut slopes = vec![vec![0.0f64; n]; VALUES.div_ceil(per) * 3];
    for (f, ((r, columns), keys)) in e.values.iter().zip(&shown.keys).enumerate() {
        for (at, (&key, w)) in keys.iter().zip(e.weighing.weights(f, r)).enumerate() {
            let sums = &mut slopes[usize::from(key) / per * 3 + usize::from(key) % 3];
            (0..n).for_each(|i| sums[i] += f64::from(w * columns[of[i]][at]));
        }
    }
    let mut sum = vec![0.0; n];
    for part in &slopes {
        let x = back(l, part);
        (0..n).for_each(|i| sum[i] += (COLOUR_DN * x[i]).powi(2));
    }
    let all: Vec<f64> = (0..n).map(|i| slopes.iter().map(|s| s[i]).sum()).collect();
    let x = back(l, &all);
    (0..n).for_each(|i| sum[i] += (COMMON_DN * x[i]).powi(2));
    sum
}

/// How far a filter of another width is from this one, in steps of a blur of `sigma` px, which is freed or not.
fn moved_by_a_filter(is_free: bool, sigma: f64) -> f64 {
    if is_free && sigma > 0.0 {
        // The blur itself is what a filter looks like; what it trades against moves along.
        ((sigma.powi(2) + FILTER_PX2).sqrt() - sigma) / P::Defocus.spec().step
    } else {
        // Derivatives by a blur from none are differences over 0.4 px, that is over 0.16 px^2, in units of 0.1 px.
        FILTER_PX2 * 0.4 / P::Defocus.spec().step / 0.16
    }
}

/// What a filter of another width would move the parameters by, in units of their steps.
fn filter(e: &Equations, of: &[usize], l: &[Vec<f64>], all: &[P], theta: &Theta) -> Vec<f64> {
    let at = all.iter().position(|p| *p == P::Defocus).expect("among them");
    let moved = moved_by_a_filter(of.contains(&at), theta.get(P::Defocus));
    let column: Vec<f64> = of.iter().map(|&i| e.a[i][at] * moved).collect();
    back(l, &column).into_iter().map(f64::abs).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::model::Theta;
    use crate::diagnose::expect::tone::Tone;
    use crate::diagnose::expect::weighing::Weighing;

    /// The way of a picture of 32 by 32 px whose second model moves three edges by 30 DN, where `seen` of that is real.
    fn way_of(seen: impl Fn(usize) -> f32) -> Way {
        let mean = Arc::new(Plane::from_fn(32, 32, |_, _| [100.0f32; 3]));
        let moved = |i: usize| if (i / 3).is_multiple_of(11) { 30.0f32 } else { 0.0 };
        let count = mean.data.len();
        let little = |i: usize| [0.3f32, -0.3, 0.1][i % 3];
        let one = |_| -> FrameValues {
            let residual = (0..count).map(|i| moved(i) * seen(i) + little(i)).collect();
            (residual, vec![(0..count).map(moved).collect(), vec![0.0; count]])
        };
        let values: Vec<FrameValues> = (0..3).map(one).collect();
        let residuals: Vec<&[f32]> = values.iter().map(|v| &v.0[..]).collect();
        let pictures = vec![mean; 3];
        let weighing = Weighing::new(&pictures, &Tone::new(&Theta::neutral()), 1, 1.0).chosen(&residuals);
        let e = assemble(values, 2, Arc::new(weighing));
        way(e, &Shown::of(&pictures, 1), 32, 1, false).expect("the models differ")
    }

    #[test]
    fn edges_that_come_to_lie_right_count_fully() {
        let right = way_of(|_| 1.0);
        assert!((right.share - 1.0).abs() < 0.02 && right.half < 0.05, "{right:?}");
        // Controls: nothing of it is real, and half of the places go the other way.
        let none = way_of(|_| 0.0);
        assert!(none.share.abs() < 0.02, "{none:?}");
        let half = way_of(|i| if i % 2 == 0 { 1.0 } else { -1.0 });
        assert!(half.share.abs() < 0.02, "{half:?}");
    }
}
