//! Rounding: what a sensor delivers of a value is a whole number of DN, and a simulator's pictures were rounded before.

use std::sync::LazyLock;

use super::discrepancy::COLOUR_DN;
use shutterbug::plane::stats::erf;
use shutterbug::plane::three;

/// Mean and variance of a delivered value, a whole number of DN.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Rounded {
    pub mean: f32,
    /// New in every value, DN^2.
    pub free: f32,
    /// Common to all values of the colour, DN^2.
    pub common: f32,
}

/// Places within a DN, and widths of the noise, at which [`Rounded`] is tabled.
const TABLE: [usize; 2] = [65, 21];
/// Width of the noise from which on rounding adds 1/12 and nothing else, DN.
const WIDE_DN: f32 = 1.0;

static ROUNDED: LazyLock<Vec<[f32; 3]>> = LazyLock::new(|| {
    let at = |i: usize| {
        let (place, width) = (i % TABLE[0], i / TABLE[0]);
        let place = place as f64 / (TABLE[0] - 1) as f64;
        let width = width as f64 / (TABLE[1] - 1) as f64 * f64::from(WIDE_DN);
        integers(place, width).map(|v| v as f32)
    };
    (0..TABLE[0] * TABLE[1]).map(at).collect()
});

/// Mean (above `place`) and variances, free and common, of `place` plus colour error plus noise of `width`, rounded.
fn integers(place: f64, width: f64) -> [f64; 3] {
    let below = |x: f64, sigma: f64| 0.5 * (1.0 + erf(x / (sigma.max(1e-4) * std::f64::consts::SQRT_2)));
    let mean_of = |place: f64| -> [f64; 2] {
        (-5..=6).fold([0.0; 2], |[mean, square], k| {
            let k = f64::from(k);
            let p = below(k + 0.5 - place, width) - below(k - 0.5 - place, width);
            [mean + p * k, square + p * k * k]
        })
    };
    // Over the colour's error: mean, mean of the squared mean, mean of the variance.
    let (mut all, mut weights) = ([0.0; 3], 0.0);
    for i in -30..=30 {
        let z = f64::from(i) / 10.0;
        let weight = (-0.5 * z * z).exp();
        let [mean, square] = mean_of(place + z * COLOUR_DN);
        let parts = [mean, mean * mean, square - mean * mean];
        (0..3).for_each(|k| all[k] += weight * parts[k]);
        weights += weight;
    }
    let [mean, square, free] = all.map(|v| v / weights);
    [mean - place, free, (square - mean * mean).max(0.0)]
}

/// What a sensor delivers of `mean` DN under noise of variance `free`, DN^2.
pub(crate) fn rounded(mean: f32, free: f32) -> Rounded {
    let width = free.max(0.0).sqrt();
    if width >= WIDE_DN {
        let common = (COLOUR_DN * COLOUR_DN) as f32;
        return Rounded { mean, free: free + 1.0 / 12.0, common };
    }
    let whole = mean.floor();
    let x = (mean - whole) * (TABLE[0] - 1) as f32;
    let y = width / WIDE_DN * (TABLE[1] - 1) as f32;
    let (i, j) = ((x as usize).min(TABLE[0] - 2), (y as usize).min(TABLE[1] - 2));
    let (fx, fy) = (x - i as f32, y - j as f32);
    let at = |i: usize, j: usize| ROUNDED[j * TABLE[0] + i];
    let [moved, free, common] = three(|k| {
        let row = |j: usize| at(i, j)[k] * (1.0 - fx) + at(i + 1, j)[k] * fx;
        row(j) * (1.0 - fy) + row(j + 1) * fy
    });
    Rounded { mean: mean + moved, free, common }
}

/// Places within a DN, widths of the noise and steps of a rounding before at which [`rounded_twice`] is tabled.
const TWICE: [usize; 3] = [17, 11, 9];
/// Largest step in the table, DN.
const WIDEST_STEP_DN: f32 = 2.0;
/// Values of which one that was rounded before is taken for the mean.
const WITHIN: usize = 32;

static ROUNDED_TWICE: LazyLock<Vec<[f32; 3]>> = LazyLock::new(|| {
    let part = |i: usize, k: usize| i as f32 / (TWICE[k] - 1) as f32;
    let at = |i: usize| {
        let (place, width) = (part(i % TWICE[0], 0), part(i / TWICE[0] % TWICE[1], 1) * WIDE_DN);
        let step = part(i / TWICE[0] / TWICE[1], 2) * WIDEST_STEP_DN;
        let mut sums = [0.0f32; 3];
        for k in 0..WITHIN {
            let before = ((k as f32 + 0.5) / WITHIN as f32 - 0.5) * step;
            let seen = rounded(place + before, width * width);
            let moved = seen.mean - place;
            let parts = [moved, seen.free, moved * moved + seen.common];
            (0..3).for_each(|k| sums[k] += parts[k] / WITHIN as f32);
        }
        [sums[0], sums[1], sums[2] - sums[0] * sums[0]]
    };
    (0..TWICE.iter().product()).map(at).collect()
});

/// What a sensor delivers of a value that is known as a picture has it: `mean` DN, rounded before to steps that are
/// `step` DN wide behind the camera, under noise of variance `free`, DN^2. Values that the picture rounded alike are
/// off by the same: that is `common` to them.
pub(crate) fn rounded_twice(mean: f32, free: f32, step: f32) -> Rounded {
    let width = free.max(0.0).sqrt();
    // Beyond the table the wider step adds its own variance.
    let beyond = (step * step - WIDEST_STEP_DN * WIDEST_STEP_DN).max(0.0) / 12.0;
    if width >= WIDE_DN {
        let whole = rounded(mean, free);
        return Rounded { common: whole.common + step * step / 12.0, ..whole };
    }
    let whole = mean.floor();
    let axes = [mean - whole, width / WIDE_DN, (step / WIDEST_STEP_DN).clamp(0.0, 1.0)];
    let mut out = [0.0f32; 3];
    let corner = |k: usize, up: usize| {
        let at = axes[k] * (TWICE[k] - 1) as f32;
        let low = (at as usize).min(TWICE[k] - 2);
        let f = at - low as f32;
        (low + up, if up == 1 { f } else { 1.0 - f })
    };
    for c in 0..8 {
        let [(i, a), (j, b), (k, c)] = [corner(0, c & 1), corner(1, c >> 1 & 1), corner(2, c >> 2)];
        let entry = &ROUNDED_TWICE[(k * TWICE[1] + j) * TWICE[0] + i];
        out.iter_mut().zip(entry).for_each(|(o, e)| *o += a * b * c * e);
    }
    Rounded { mean: mean + out[0], free: out[1], common: out[2] + beyond }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_without_noise_rounds_to_its_neighbour_and_one_half_way_to_either() {
        let near = rounded(128.1, 0.0);
        assert!((near.mean - 128.0).abs() < 0.03 && near.free < 1e-3, "{near:?}");
        let between = rounded(128.5, 0.0);
        assert!((between.mean - 128.5).abs() < 0.01, "{between:?}");
        // All values of the colour go the same way: what one has, their mean has.
        assert!(between.common > 0.23 && between.free < 0.01, "{between:?}");
    }

    #[test]
    fn noise_shakes_rounding_into_a_twelfth() {
        for place in [0.0, 0.25, 0.5, 0.9] {
            for width in [0.7f32, 0.95, 1.05, 3.0] {
                let seen = rounded(60.0 + place, width * width);
                assert!((seen.mean - 60.0 - place).abs() < 0.01, "{place} {width}: {seen:?}");
                assert!((seen.free - width * width - 1.0 / 12.0).abs() < 0.02, "{place} {width}: {seen:?}");
                assert!((seen.common.sqrt() - COLOUR_DN as f32).abs() < 0.02, "{place} {width}: {seen:?}");
            }
        }
    }

    /// Mean and variance of what two roundings in a row leave: of values anywhere, and of those that are alike.
    fn drawn(step: f32, width: f32) -> [f64; 2] {
        let normal = |i: u32| shutterbug::chain::rng::random_normal([i, 0], 0, 1, [2, 3]);
        let (mut squares, mut shared) = (0.0, 0.0);
        const ALIKE: u32 = 64;
        for colour in 0..2000u32 {
            let truth = 40.0 + 0.097 * colour as f32;
            let given = (truth / step).round() * step;
            let off = COLOUR_DN as f32 * normal(colour)[0];
            let errors: Vec<f64> = (0..ALIKE)
                .map(|i| truth + off + width * normal(1_000_000 + colour * ALIKE + i)[1])
                .map(|v| f64::from(v.round() - given))
                .collect();
            squares += errors.iter().map(|e| e * e).sum::<f64>() / f64::from(ALIKE);
            shared += (errors.iter().sum::<f64>() / f64::from(ALIKE)).powi(2);
        }
        [squares / 2000.0, shared / 2000.0]
    }

    #[test]
    fn what_was_rounded_before_is_off_by_the_same_where_it_is_alike() {
        for (step, width) in [(1.0, 0.0), (1.0, 0.4), (1.0, 2.0), (0.5, 0.0), (2.0, 0.3)] {
            let [whole, shared] = drawn(step, width);
            // Given values are multiples of the step.
            let places = (0..(1.0 / step).max(1.0) as usize).map(|k| 40.0 + k as f32 * step);
            let all: Vec<Rounded> = places.map(|p| rounded_twice(p, width * width, step)).collect();
            let mean = |of: fn(&Rounded) -> f32| {
                all.iter().map(|r| f64::from(of(r))).sum::<f64>() / all.len() as f64
            };
            let (free, common) = (mean(|r| r.free), mean(|r| r.common));
            assert!(
                (free + common - whole).abs() < 0.02 + 0.03 * whole,
                "{step} {width}: {free} {common} {whole}"
            );
            let within = free / 64.0;
            assert!(
                (common + within - shared).abs() < 0.015 + 0.1 * shared,
                "{step} {width}: {free} {common} {shared}"
            );
        }
        let once = rounded(40.0, 0.0);
        assert!(once.common < 1e-3, "control: a value that is known to be whole stays: {once:?}");
    }
}
