//! Whether a wave along the lines is a light's: then every part of every line sees the same one, from the first line to
//! the last. Print and things show another in each place.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

/// The 99 % point of the normal distribution: how often waves that are one are said to differ is one in a hundred.
const Z99: f64 = 2.326;
/// Fewest periods by which a block of lines tells a wave, and most blocks along the lines.
const LEAST_PERIODS: f64 = 3.0;
const MOST_BLOCKS: usize = 4;

/// Sums of least squares of the blocks' values by one wave for all, and by one for each.
struct Fits {
    /// Squares of all values, and what one wave and each block's own leave of them.
    whole: f64,
    common: f64,
    own: f64,
    /// Degrees of freedom: of the one wave, by which both differ, and of what the blocks' own leave.
    waves: f64,
    between: f64,
    within: f64,
}

/// Whether all `parts` of the lines (values by line) show one wave of `frequency` (cycles a line) and its harmonics up
/// to that number: it is most of what they show, or beyond chance in all of them together, and they differ from it by
/// chance alone.
pub(super) fn is_one(parts: &[Vec<f64>], frequency: f64, harmonics: usize) -> bool {
    let Some(fits) = fits(parts, frequency, harmonics) else { return false };
    let most = fits.common < 0.5 * fits.whole;
    let ratio = |explained: f64, freedom: f64| {
        explained / freedom / (fits.own / fits.within).max(1e-300) / most_by_chance(freedom)
    };
    let there = ratio(fits.whole - fits.common, fits.waves) > 1.0;
    most || (there && ratio(fits.common - fits.own, fits.between) < 1.0)
}

/// What a ratio of variances exceeds once in a hundred times, if its denominator is well known (Wilson and Hilferty,
/// PNAS 17, 1931).
fn most_by_chance(freedom: f64) -> f64 {
    let part = 2.0 / (9.0 * freedom);
    (1.0 - part + Z99 * part.sqrt()).powi(3)
}

fn fits(parts: &[Vec<f64>], frequency: f64, harmonics: usize) -> Option<Fits> {
    let lines = parts.first()?.len();
    let blocks = ((lines as f64 * frequency / LEAST_PERIODS) as usize).clamp(1, MOST_BLOCKS);
    // Below half a cycle a line.
    let harmonics = ((0.45 / frequency) as usize).clamp(1, harmonics);
    let wave = |line: usize, k: usize| {
        let turn = TAU * frequency * (k / 2 + 1) as f64 * line as f64;
        if k.is_multiple_of(2) { turn.cos() } else { turn.sin() }
    };
    let count = 2 * harmonics;
    let (mut a, mut b) = (DMatrix::zeros(count, count), DVector::zeros(count));
    let mut sums = Fits { whole: 0.0, common: 0.0, own: 0.0, waves: count as f64, between: 0.0, within: 0.0 };
    let places = |block: usize| block * lines / blocks..(block + 1) * lines / blocks;
    for (part, block) in parts.iter().flat_map(|p| (0..blocks).map(move |b| (p, b))) {
        let place = places(block);
        let waves = DMatrix::from_fn(place.len(), count, |i, k| wave(place.start + i, k));
        let (waves, values) = (level(waves), level(DMatrix::from_column_slice(place.len(), 1, &part[place])));
        let (own_a, own_b) = (waves.tr_mul(&waves), waves.tr_mul(&values).column(0).into_owned());
        let whole = values.norm_squared();
        sums.whole += whole;
        sums.own += (whole - own_b.dot(&own_a.clone().cholesky()?.solve(&own_b))).max(0.0);
        sums.within += values.len() as f64 - 2.0 - count as f64;
        a += own_a;
        b += own_b;
    }
    sums.common = (sums.whole - b.dot(&a.cholesky()?.solve(&b))).max(0.0);
    sums.between = (count * (parts.len() * blocks - 1)) as f64;
    (sums.within > 0.0).then_some(sums)
}

/// Columns without the straight lines that are nearest to them.
fn level(mut columns: DMatrix<f64>) -> DMatrix<f64> {
    let n = columns.nrows() as f64;
    let along = |i: usize| i as f64 - 0.5 * (n - 1.0);
    let square: f64 = (0..columns.nrows()).map(|i| along(i).powi(2)).sum();
    for mut column in columns.column_iter_mut() {
        let mean = column.mean();
        let slope = column.iter().enumerate().map(|(i, v)| along(i) * v).sum::<f64>() / square.max(1e-300);
        column.iter_mut().enumerate().for_each(|(i, v)| *v -= mean + slope * along(i));
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wave_in_all_places_is_told_from_one_in_some() {
        let mut dice = 5u64;
        let mut noise = || {
            dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (dice >> 40) as f64 / f64::from(1 << 24) - 0.5
        };
        let mut parts = |wave: &dyn Fn(usize, f64) -> f64, size: f64| -> Vec<Vec<f64>> {
            (0..8).map(|p| (0..480).map(|i| wave(p, i as f64) + size * noise()).collect()).collect()
        };
        let turn = |i: f64| (TAU * 0.025 * i).sin();
        let light = |_: usize, i: f64| 0.3 * turn(i);
        assert!(is_one(&parts(&light, 0.01), 0.025, 4));
        assert!(is_one(&parts(&|_, i| 0.02 * turn(i), 0.3), 0.025, 4), "faint, in white noise");
        // Not in all parts of the lines, not as deep in all, or not on all lines.
        assert!(!is_one(&parts(&|p, i| if p < 2 { turn(i) } else { 0.0 }, 0.1), 0.025, 4));
        assert!(!is_one(&parts(&|p, i| if p % 2 == 0 { turn(i) } else { -0.4 * turn(i) }, 0.1), 0.025, 4));
        assert!(!is_one(&parts(&|_, i| if i < 160.0 { turn(i) } else { 0.0 }, 0.1), 0.025, 4));
        assert!(!is_one(&parts(&|_, _| 0.0, 0.1), 0.025, 4), "noise alone");
        // Light that some of the surface gets less of is the light's all the same.
        assert!(is_one(&parts(&|p, i| (1.0 - 0.04 * p as f64) * turn(i), 0.01), 0.025, 4));
    }
}
