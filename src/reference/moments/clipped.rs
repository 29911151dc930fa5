//! Normal values that are clipped to what can be delivered, 0 to 255 DN: colours that are saturated or sharpened lie
//! beyond, and the noise that they have does not show there.

use std::f64::consts::FRAC_1_SQRT_2;
use std::sync::LazyLock;

use crate::plane::stats::{FRAC_1_SQRT_TAU, erf};

/// Standard deviations between a mean and an end beyond which clipping changes nothing.
const FAR: f32 = 4.0;
/// Entries of the table in one standard deviation.
const STEPS: usize = 64;

/// Mean of a normal value that is clipped to 0 and 255.
pub(super) fn clipped_mean(mean: f32, sigma: f32) -> f32 {
    if sigma <= 0.05 || (mean > FAR * sigma && mean < 255.0 - FAR * sigma) {
        return mean;
    }
    // What lies below 0 on average, and what lies above 255.
    let beyond = |z: f32| {
        let density = (-0.5 * z * z).exp() * FRAC_1_SQRT_TAU as f32;
        let above = 0.5 * (1.0 - erf(f64::from(z) * FRAC_1_SQRT_2)) as f32;
        sigma * (density - z * above)
    };
    mean + beyond(mean / sigma) - beyond((255.0 - mean) / sigma)
}

/// Share of its variance that a normal value of that width keeps when it is clipped to 0 and 255; `mean`: of the
/// clipped value, DN.
pub(super) fn share_kept(mean: f32, sigma: f32) -> f32 {
    if sigma <= 0.05 {
        return 1.0;
    }
    kept_beside(mean / sigma) * kept_beside((255.0 - mean) / sigma)
}

/// The same with one end, by the clipped mean's distance from it in standard deviations.
fn kept_beside(distance: f32) -> f32 {
    if distance >= FAR {
        return 1.0;
    }
    let at = distance.max(0.0) * STEPS as f32;
    let i = at as usize;
    let f = at - i as f32;
    KEPT[i] * (1.0 - f) + KEPT[i + 1] * f
}

/// [`kept_beside`] at even distances.
static KEPT: LazyLock<Vec<f32>> = LazyLock::new(|| {
    // Mean and variance of what is left of a standard normal value about `z` when it is clipped at 0.
    let moments = |z: f64| {
        let (density, below) = ((-0.5 * z * z).exp() * FRAC_1_SQRT_TAU, 0.5 + 0.5 * erf(z * FRAC_1_SQRT_2));
        let mean = density + z * below;
        (mean, (z * z + 1.0) * below + z * density - mean * mean)
    };
    let of = |i: usize| {
        let wanted = i as f64 / STEPS as f64;
        // The mean grows with `z`.
        let (mut low, mut high) = (-8.0, f64::from(FAR) + 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if moments(middle).0 < wanted { low = middle } else { high = middle }
        }
        moments(low).1.clamp(0.0, 1.0) as f32
    };
    let last = FAR as usize * STEPS + 1;
    (0..=last).map(|i| if i == 0 { 0.0 } else { of(i) }).collect()
});
