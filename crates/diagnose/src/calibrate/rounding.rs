//! What rounding does to means of values whose noise is too small to hide it.

use std::f64::consts::PI;

use shutterbug::plane::Plane;

/// Pictures of one scene at rest, added one after another.
#[derive(Clone, Debug, Default)]
pub(super) struct Rounding {
    /// The largest distance of two neighbouring values.
    step: f64,
    last: Option<Plane<f32>>,
    /// Sum of the squares of differences between pictures, and their number.
    squares: f64,
    count: f64,
}

impl Rounding {
    /// Adds a picture of encoded values, and the distance of two neighbouring ones.
    pub(super) fn add(&mut self, encoded: &Plane<f32>, step: f32) {
        self.step = self.step.max(f64::from(step));
        if let Some(last) = self.last.replace(encoded.clone()) {
            let n = encoded.data.len() as f64;
            let differences = || encoded.data.iter().zip(&last.data).map(|(a, b)| f64::from(a - b));
            let mean = differences().sum::<f64>() / n;
            self.squares += differences().map(|d| (d - mean).powi(2)).sum::<f64>();
            self.count += n;
        }
    }

    /// The most that a mean is off by, encoded.
    pub(super) fn most(&self) -> f64 {
        if self.count == 0.0 { 0.0 } else { most(0.5 * self.squares / self.count, self.step) }
    }
}

/// The most that the mean of rounded values is off by: the first term of its series in the value's place between two
/// steps (Widrow and Kollar, Quantization Noise, 2008). `variance`: of the rounded values.
fn most(variance: f64, step: f64) -> f64 {
    if step <= 0.0 {
        return 0.0;
    }
    step / PI * (-2.0 * (PI * noise_in_steps(variance, step)).powi(2)).exp()
}

/// Deviation of the noise before rounding, in steps. Noise that is small beside a step makes it now and then; large
/// noise has that of rounding besides.
fn noise_in_steps(variance: f64, step: f64) -> f64 {
    let seen = variance / (step * step);
    if seen < 1.0 / 6.0 { PI.sqrt() * seen } else { (seen - 1.0 / 12.0).sqrt() }
}

/// The most that the variance of rounded values, less a twelfth of a step squared, is short by: the first terms of the
/// same series. `variance`: of the rounded values.
pub(super) fn most_of_variance(variance: f64, step: f64) -> f64 {
    if step <= 0.0 {
        return 0.0;
    }
    let square = noise_in_steps(variance, step).powi(2);
    let wave = (-2.0 * PI * PI * square).exp();
    step * step * ((4.0 * square + 1.0 / (PI * PI)) * wave + wave * wave / (PI * PI))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and variance of a normal distribution after rounding to whole numbers.
    fn rounded(mean: f64, sigma: f64) -> [f64; 2] {
        let places = (-6000..=6000).map(|i| f64::from(i) / 1000.0);
        let (mut weight, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for z in places {
            let (p, v) = ((-0.5 * z * z).exp(), (mean + sigma * z).round());
            (weight, sum, squares) = (weight + p, sum + p * v, squares + p * v * v);
        }
        [sum / weight, squares / weight - (sum / weight).powi(2)]
    }

    #[test]
    fn means_are_off_by_as_much_as_is_said() {
        for sigma in [0.02, 0.1, 0.2, 0.3, 0.4, 0.5] {
            let all: Vec<(f64, [f64; 2])> =
                (0..100).map(|i| f64::from(i) / 100.0).map(|m| (m, rounded(m, sigma))).collect();
            let variance = all.iter().map(|(_, r)| r[1]).sum::<f64>() / 100.0;
            let off = all.iter().map(|(m, r)| (r[0] - m).abs()).fold(0.0, f64::max);
            let said = most(variance, 1.0);
            // Without noise the series has more terms than the first.
            let least = if sigma < 0.2 { 0.6 } else { 0.8 };
            assert!((least..1.25).contains(&(said / off)), "{sigma}: {said} for {off}");
            assert!((said / 3.0 - most(variance / 9.0, 1.0 / 3.0)).abs() < 1e-9, "in steps of a third");
            let short = all.iter().map(|(_, r)| sigma * sigma + 1.0 / 12.0 - r[1]).fold(0.0, f64::max);
            // That variance is a mean over all places, where noise hides no step.
            let said = most_of_variance(variance, 1.0);
            assert!(
                short < 1.01 * said.max(1.0 / 12.0) && (sigma < 0.3 || said < 1.5 * short),
                "{sigma}: {said} {short}"
            );
        }
        assert_eq!(most(1.0, 0.0), 0.0);
    }
}
