//! How much a difference counts in a fit: by the inverse of the variance that noise and renderers give it, and beyond a
//! threshold no more than its size. Noise behind an encoding is skewed: a threshold within it would shift what is
//! fitted.

use std::borrow::Borrow;

use rayon::prelude::*;

use crate::diagnose::evidence::blocks::pooled;
use crate::diagnose::expect::tone::Tone;
use shutterbug::plane::Plane;

/// Standard deviations of noise within which a difference is not clipped.
const WITHIN: f32 = 3.0;
/// Mean excess of the absolute value of a normal variable over its own mean absolute value, times the standard
/// deviation.
const MEAN_ABSOLUTE: f32 = 0.8;
/// Least threshold, DN: rounding alone makes half a DN.
const LEAST_DN: f64 = 0.7;

/// Residual and derivatives of one frame.
pub(crate) type FrameValues = (Vec<f32>, Vec<Vec<f32>>);

/// Weights for the differences of some frames, held while costs are to compare.
#[derive(Clone, Debug)]
pub(crate) struct Weighing {
    /// Where absolute errors begin, noise left aside, DN.
    pub(crate) delta: f64,
    /// By frame: variance of each value from noise, DN^2; empty without noise.
    noise2: Vec<Vec<f32>>,
}

impl Weighing {
    /// For simulated values `means` (those of the frames to be compared) averaged over blocks, with a given threshold.
    pub(crate) fn new(
        means: &[impl Borrow<Plane<f32>> + Sync],
        tone: &Tone,
        block: usize,
        delta: f64,
    ) -> Self {
        let noise2 = if tone.is_noisy() {
            means.par_iter().map(|m| noise_of(m.borrow(), tone, block)).collect()
        } else {
            Vec::new()
        };
        Self { delta, noise2 }
    }

    /// Where each pixel is the mean of a square of the camera's, whose noise is that of one of them.
    pub(crate) fn of_means(mut self, side: usize) -> Self {
        let share = 1.0 / (side * side) as f32;
        self.noise2.iter_mut().flatten().for_each(|v| *v *= share);
        self
    }

    /// With more variance of each value, DN^2: by frame; none for any frame adds none.
    pub(crate) fn widened(mut self, more: Vec<Vec<f32>>) -> Self {
        if self.noise2.is_empty() {
            self.noise2 = more;
        } else {
            for (to, from) in self.noise2.iter_mut().zip(&more) {
                to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
            }
        }
        self
    }

    /// The threshold chosen from the differences themselves.
    pub(crate) fn chosen(mut self, residuals: &[&[f32]]) -> Self {
        let excess = |(f, r): (usize, &&[f32])| -> f64 {
            let beyond = |i: usize| (r[i].abs() - MEAN_ABSOLUTE * self.noise_at(f, i).sqrt()).max(0.0);
            (0..r.len()).map(|i| f64::from(beyond(i))).sum()
        };
        let total: f64 = residuals.par_iter().enumerate().map(excess).collect::<Vec<_>>().iter().sum();
        let count: usize = residuals.iter().map(|r| r.len()).sum();
        self.delta = (1.5 * total / count.max(1) as f64).max(LEAST_DN);
        self
    }

    /// Variance that noise gives a value, DN^2.
    pub(crate) fn noise_at(&self, frame: usize, i: usize) -> f32 {
        self.noise2.get(frame).and_then(|v| v.get(i)).copied().unwrap_or(0.0)
    }

    /// What a difference of size 1 DN counts within the threshold, and the threshold, DN.
    fn terms(&self, frame: usize, i: usize) -> (f32, f32) {
        let (noise2, delta) = (self.noise_at(frame, i), self.delta as f32);
        let square = delta * delta;
        (delta / (square + noise2), (square + WITHIN * WITHIN * noise2).sqrt())
    }

    /// Sum of the costs of a frame's differences; without noise that is Huber's cost in DN.
    pub(crate) fn cost(&self, frame: usize, residual: &[f32]) -> f64 {
        let one = |(i, e): (usize, &f32)| {
            let (weight, threshold) = self.terms(frame, i);
            let e = e.abs();
            let size = if e <= threshold { 0.5 * e * e } else { threshold * (e - 0.5 * threshold) };
            f64::from(weight * size)
        };
        residual.iter().enumerate().map(one).sum()
    }

    /// Weights that make a least-squares step one of that cost.
    pub(crate) fn weights(&self, frame: usize, residual: &[f32]) -> Vec<f32> {
        let one = |(i, e): (usize, &f32)| {
            let (weight, threshold) = self.terms(frame, i);
            weight * (threshold / e.abs().max(threshold))
        };
        residual.iter().enumerate().map(one).collect()
    }
}

/// Variance that noise gives a mean over a block, DN^2.
fn noise_of(mean: &Plane<f32>, tone: &Tone, block: usize) -> Vec<f32> {
    let n = block as f32;
    let variance = (0..mean.data.len()).map(|i| {
        let colour = &mean.data[i - i % 3..i - i % 3 + 3];
        let (v, left) = (tone.spread_of(colour, i % 3), tone.left(colour, i % 3));
        let share = match block {
            1 => left.pixel,
            2 => left.bands[0],
            4 => left.bands[1],
            _ => left.bands[2],
        };
        share * (v.free + v.fixed) / (n * n) + v.row / n
    });
    pooled(&variance.collect::<Vec<_>>(), mean.width, mean.height, block)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::expect::model::{P, Theta};

    #[test]
    fn without_noise_it_is_huber_and_noise_takes_weight_and_widens_the_threshold() {
        let mean = Plane::from_fn(4, 2, |_, _| [120.0f32; 3]);
        let plain = Weighing::new(std::slice::from_ref(&mean), &Tone::new(&Theta::neutral()), 1, 2.0);
        // Huber: e^2 / (2 delta) within, |e| - delta / 2 beyond.
        assert!((plain.cost(0, &[1.0, -5.0]) - (0.25 + 4.0)).abs() < 1e-6);
        assert!((plain.weights(0, &[1.0, -5.0])[1] - 1.0 / 5.0).abs() < 1e-6);
        let tone = Tone::new(&Theta::neutral().with(P::Read, 0.03));
        let sigma = tone.spread(120.0, 1).free.sqrt();
        assert!(sigma > 5.0, "{sigma}");
        let noisy = Weighing::new(std::slice::from_ref(&mean), &tone, 1, 2.0);
        let [within, beyond] = [1.0, 10.0].map(|k| noisy.weights(0, &[0.0, k * sigma])[1]);
        assert!(within < 0.2 * plain.weights(0, &[0.0])[0] && beyond < 0.4 * within, "{within} {beyond}");
        // Averaged over four pixels the same noise is a quarter of the variance.
        let pooled = Weighing::new(std::slice::from_ref(&mean), &tone, 2, 2.0);
        assert!(pooled.weights(0, &[0.0])[0] > 2.0 * noisy.weights(0, &[0.0])[0]);
    }
}
