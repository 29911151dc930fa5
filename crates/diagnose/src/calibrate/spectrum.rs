//! Waves along the lines of a picture: their spectrum, and which of its lines are a light's.

use std::f64::consts::{LN_2, TAU};

use super::own::Z99;
use super::slopes::{self, Slopes};
use super::wave;

/// Least depth of stripes, a share of the light: what floats round makes lines of a spectrum as well, far below what 8
/// bits and some hundred pixels a line can show.
const LEAST_DEPTH: f64 = 1e-5;
/// How often stripes may be seen where there are none.
pub(super) const ALPHA: f64 = 0.01;

/// What a line of the spectrum of so many lines must be over its surroundings: chance makes one so high in all of the
/// spectrum [`ALPHA`] of the time.
pub(super) fn threshold(lines: usize) -> f64 {
    (0.5 * lines as f64 / ALPHA).ln()
}

/// Fewest stripes in a picture: fewer cannot be told from a slope.
pub(super) const FEWEST: f64 = 3.0;
/// Spectrum values a natural step (one over the number of lines), so that no peak falls between.
const OVERSAMPLED: usize = 4;
/// Natural steps on each side of a place of the spectrum that are its surroundings, and those next to it that belong to
/// it.
const AROUND: usize = 24;
const OWN: usize = 3;
/// Least share of the strongest line's power that a lower harmonic has: below, it is what the window lets through.
const LEAST_SHARE: f64 = 1e-3;
/// How well the top of a line is known, natural steps: what its window and other lines bend it by.
const SAME_PLACE: f64 = 0.05;
/// Harmonics of the light of which the strongest line may be one.
pub(super) const MOST_HARMONICS: usize = 4;

/// A wave along the lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wave {
    /// Cycles a line.
    pub frequency: f64,
    /// Over the mean light.
    pub amplitude: f64,
}

/// The wave near a frequency (cycles a line), if it is a light's: it goes across the lines, and is the same in all
/// places.
pub(super) fn wave_at(parts: &[Vec<f64>], mean: &[f64], frequency: f64) -> Option<Wave> {
    wave_across(parts, mean, frequency).filter(|w| wave::is_one(parts, w.frequency, MOST_HARMONICS))
}

/// The wave near a frequency (cycles a line), if it is no slope and has one phase in all parts of the lines. `mean`:
/// that of the parts.
pub(super) fn wave_across(parts: &[Vec<f64>], mean: &[f64], frequency: f64) -> Option<Wave> {
    let frequency = refined(mean, frequency)?;
    let amplitude = amplitude(mean, frequency);
    let is_across =
        amplitude >= LEAST_DEPTH && !slopes::explain(mean, frequency) && in_phase(parts, frequency);
    is_across.then_some(Wave { frequency, amplitude })
}

pub(super) fn mean_of(parts: &[Vec<f64>]) -> Vec<f64> {
    (0..parts[0].len()).map(|i| parts.iter().map(|p| p[i]).sum::<f64>() / parts.len() as f64).collect()
}

/// Sums of the values times cosine and sine of a frequency, cycles a line.
fn transform(values: &[f64], frequency: f64) -> [f64; 2] {
    let step = TAU * frequency;
    let turn = |i: usize| (step * i as f64).sin_cos();
    values.iter().enumerate().fold([0.0; 2], |[c, s], (i, v)| {
        let (sin, cos) = turn(i);
        [c + v * cos, s + v * sin]
    })
}

/// Amplitude of a sine of that frequency.
fn amplitude(values: &[f64], frequency: f64) -> f64 {
    let [c, s] = transform(values, frequency);
    2.0 * c.hypot(s) / values.len() as f64
}

/// The frequency nearby at which a wave and its harmonics explain most; none where it explains more further off, as
/// beside a step, or where that leaves too few stripes.
fn refined(values: &[f64], frequency: f64) -> Option<f64> {
    let natural = 1.0 / values.len() as f64;
    let bounds = [frequency - 0.5 * natural, frequency + 0.5 * natural];
    let [mut low, mut high] = bounds;
    let slopes = Slopes::of(values);
    let explained = |frequency: f64| slopes.explained(frequency, MOST_HARMONICS);
    for _ in 0..40 {
        let (a, b) = (low + 0.382 * (high - low), low + 0.618 * (high - low));
        if explained(a) < explained(b) { low = a } else { high = b }
    }
    let top = 0.5 * (low + high);
    let inside = bounds.iter().all(|b| (top - b).abs() > 0.01 * natural);
    (inside && top > 0.99 * FEWEST * natural).then_some(top)
}

/// Whether the parts of the lines agree in phase beyond chance (Rayleigh's test): content does not.
pub(super) fn in_phase(parts: &[Vec<f64>], frequency: f64) -> bool {
    let units = parts.iter().map(|p| {
        let [c, s] = transform(p, frequency);
        let length = c.hypot(s).max(1e-300);
        [c / length, s / length]
    });
    let n = parts.len() as f64;
    let [c, s] = units.fold([0.0; 2], |a, u| [a[0] + u[0], a[1] + u[1]]);
    (-(c * c + s * s) / n).exp() < ALPHA
}

/// Power by frequency.
pub(super) struct Spectrum {
    /// Cycles a line of entry i: i times this.
    step: f64,
    power: Vec<f64>,
    lines: usize,
}

impl Spectrum {
    pub(super) fn of(values: &[f64]) -> Self {
        let lines = values.len();
        let step = 1.0 / (OVERSAMPLED * lines) as f64;
        // A window, so that what is left of slopes stays at the low end.
        let windowed: Vec<f64> = values
            .iter()
            .enumerate()
            .map(|(i, v)| v * (0.5 - 0.5 * (TAU * (i as f64 + 0.5) / lines as f64).cos()))
            .collect();
        let power = |i: usize| {
            let [c, s] = transform(&windowed, i as f64 * step);
            // Of white noise: its variance.
            (c * c + s * s) / (0.375 * lines as f64)
        };
        Self { step, power: (0..OVERSAMPLED * lines / 2).map(power).collect(), lines }
    }

    fn lowest(&self) -> usize {
        (FEWEST * OVERSAMPLED as f64) as usize
    }

    /// The place of the largest power over its surroundings, among the frequencies (cycles a line) that are asked for.
    pub(super) fn strongest(&self, asked: impl Fn(f64) -> bool) -> Option<usize> {
        let over = |i: &usize| self.over_surroundings(*i);
        let places = (self.lowest()..self.power.len()).filter(|i| asked(self.frequency(*i)));
        places.max_by(|a, b| over(a).total_cmp(&over(b)))
    }

    /// Cycles a line of a place.
    pub(super) fn frequency(&self, at: usize) -> f64 {
        at as f64 * self.step
    }

    /// Mean power around a place, without its own: of noise it is exponentially distributed, with its median at ln 2 of
    /// its mean.
    fn surroundings(&self, at: usize) -> f64 {
        let (near, far) = (OWN * OVERSAMPLED, AROUND * OVERSAMPLED);
        let below = at.saturating_sub(far).max(1)..at.saturating_sub(near);
        let above = (at + near)..(at + far).min(self.power.len());
        let mut all: Vec<f64> = below.chain(above).map(|i| self.power[i]).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::INFINITY) / LN_2
    }

    pub(super) fn over_surroundings(&self, at: usize) -> f64 {
        self.power[at] / self.surroundings(at).max(1e-300)
    }

    pub(super) fn noise_near(&self, frequency: f64) -> f64 {
        self.surroundings((frequency / self.step).round() as usize)
    }

    /// Where a line of the spectrum has its top, natural steps: that of a parabola through the logarithms of the power
    /// beside its place. None where it goes on rising.
    fn top(&self, at: usize) -> Option<f64> {
        let [a, b, c] =
            [at.checked_sub(1)?, at, at + 1].map(|i| self.power.get(i).map_or(f64::INFINITY, |p| p.ln()));
        let bend = a - 2.0 * b + c;
        (b >= a && b >= c && bend < 0.0).then(|| (at as f64 + 0.5 * (a - c) / bend) / OVERSAMPLED as f64)
    }

    /// Frequency of the light's first harmonic that stands out, cycles a line.
    pub(super) fn fundamental(&self, threshold: f64) -> Option<f64> {
        let stands_out = |at: usize| {
            let near = at.saturating_sub(OVERSAMPLED).max(self.lowest())
                ..(at + OVERSAMPLED + 1).min(self.power.len());
            let best = near.max_by(|a, b| self.power[*a].total_cmp(&self.power[*b]))?;
            (self.over_surroundings(best) > threshold).then_some(best)
        };
        let strong = |at: &usize, strongest: usize| self.power[*at] > LEAST_SHARE * self.power[strongest];
        // Another lamp's ripple, or what leaks from a slope, is no part of the light: it has a frequency of its own.
        let parts_of = |at: usize, strongest: usize, k: usize| {
            let [own, whole] = [at, strongest].map(|at| self.top(at));
            // Cramer and Rao's bound of the place, of a line so far above its noise.
            let chance = (6.0 / self.over_surroundings(at)).sqrt() / TAU;
            own.zip(whole)
                .is_some_and(|(own, whole)| (own - whole / k as f64).abs() < SAME_PLACE + Z99 * chance)
        };
        let over = (self.lowest()..self.power.len()).filter(|i| self.over_surroundings(*i) > threshold);
        let strongest = over.max_by(|a, b| self.power[*a].total_cmp(&self.power[*b]))?;
        let parts = (2..=MOST_HARMONICS).rev().filter_map(|k| {
            let at = (strongest as f64 / k as f64).round() as usize;
            let found = (at >= self.lowest()).then(|| stands_out(at)).flatten();
            found.filter(|at| strong(at, strongest) && parts_of(*at, strongest, k))
        });
        let lowest = parts.min().unwrap_or(strongest);
        debug_assert!(self.lines > 0);
        Some(self.frequency(lowest))
    }
}
