//! What a fit compares with, and what a difference costs it.

use rayon::prelude::*;

use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::blocks::pooled;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::Theta;
use crate::diagnose::expect::tone::Tone;
use crate::diagnose::expect::weighing::Weighing;
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// What a fit compares with.
#[derive(Clone, Copy)]
pub(crate) struct Target<'a> {
    pub evidence: &'a Evidence,
    /// By place; 1 where compared.
    pub masks: Option<&'a [Plane<f32>]>,
}

/// One stage of a fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Level {
    /// Px a block over which values are averaged.
    pub block: usize,
    /// Most iterations.
    pub iterations: usize,
    pub quality: Quality,
    /// Most frames.
    pub frames: usize,
}

/// Robust cost of `theta` on pictures averaged over blocks, per value.
pub(crate) fn cost_of(
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
pub(crate) fn weighing_of(
    forward: &mut Forward,
    frames: &[usize],
    theta: &Theta,
    level: &Level,
    delta: f64,
) -> Result<Weighing> {
    let tone = Tone::new(theta);
    let means = if tone.is_noisy() { forward.pictures(frames, theta, level.quality)? } else { Vec::new() };
    Ok(Weighing::new(&means, &tone, level.block, delta).of_means(forward.pooled))
}

/// Real minus simulated, averaged over blocks; masked values are 0.
pub(crate) fn residual(target: Target<'_>, at: usize, simulated: &Plane<f32>, block: usize) -> Vec<f32> {
    let real = &target.evidence.frames[at].dn;
    let mut data: Vec<f32> = real.data.iter().zip(&simulated.data).map(|(r, s)| r - s).collect();
    hide(target, at, &mut data);
    pooled(&data, simulated.width, simulated.height, block)
}

/// Sets what is not compared to 0.
pub(crate) fn hide(target: Target<'_>, at: usize, data: &mut [f32]) {
    if let Some(masks) = target.masks {
        for (values, m) in data.chunks_exact_mut(3).zip(&masks[at].data) {
            if *m <= 0.5 {
                values.fill(0.0);
            }
        }
    }
}
