//! Numbers of many values: brightness, the error function, variances that outliers have no say in.

/// Weights of brightness: ITU-T T.871, as in JPEG and ITU-R BT.601.
pub const LUMA: [f32; 3] = [0.299, 0.587, 0.114];

/// Brightness of a colour.
pub fn luma(p: &[f32]) -> f32 {
    LUMA[0] * p[0] + LUMA[1] * p[1] + LUMA[2] * p[2]
}

/// What the density of a standard normal distribution is at 0.
pub const FRAC_1_SQRT_TAU: f64 = 0.398_942_280_401_432_7;

/// The error function: Abramowitz and Stegun 7.1.26, to 1.5e-7.
pub fn erf(x: f64) -> f64 {
    erf_beside(x, (-x * x).exp())
}

/// [`erf`] where the exponential of -x^2 is known.
pub fn erf_beside(x: f64, bell: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let poly = t
        * (0.254_829_592
            + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    x.signum() * (1.0 - poly * bell)
}

/// Variance from the middle of the values, half a standard deviation to each side: edges of renderers and stuck pixels
/// have no say.
///
/// # Panics
/// Without values.
pub fn robust_variance(values: &mut [f32]) -> f64 {
    let n = values.len();
    let mut at = |share: f64| {
        let i = ((n as f64 * share) as usize).min(n - 1);
        *values.select_nth_unstable_by(i, f32::total_cmp).1
    };
    let (low, high) = (at(0.308_538), at(0.691_462));
    f64::from(high - low).powi(2)
}

/// The middle value, of an even number the upper of the two; 0 of none.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_function_has_its_known_values() {
        for (x, want) in [(0.0, 0.0), (0.5, 0.520_499_878), (1.0, 0.842_700_793), (-2.0, -0.995_322_265)] {
            assert!((erf(x) - want).abs() < 2e-7, "{x}: {}", erf(x));
        }
        assert!((erf(1.0) - 0.84).abs() > 1e-3, "control");
    }

    #[test]
    fn the_median_is_the_middle_value() {
        assert_eq!([median([3.0, 1.0, 2.0]), median([4.0, 1.0, 3.0, 2.0]), median([])], [2.0, 3.0, 0.0]);
        assert!(median([1.0, 2.0, 900.0]) < 3.0, "control: no mean");
    }

    #[test]
    fn outliers_have_no_say_in_a_robust_variance() {
        // Quantiles of a normal distribution of standard deviation 3 are 3 times those of one of 1; the uniform one of
        // width 1 has its middle 38 per cent 0.383 apart.
        let mut values: Vec<f32> = (0..10_001).map(|i| i as f32 / 10_000.0).collect();
        let plain = robust_variance(&mut values);
        assert!((plain.sqrt() - 0.382_924).abs() < 1e-3, "{plain}");
        values.iter_mut().step_by(100).for_each(|v| *v = 1e6);
        let spoilt = robust_variance(&mut values);
        assert!((spoilt / plain - 1.0).abs() < 0.05, "{spoilt}");
        let mean: f32 = values.iter().sum::<f32>() / values.len() as f32;
        assert!(mean > 1000.0, "control: the mean has moved to {mean}");
    }
}
