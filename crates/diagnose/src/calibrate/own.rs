//! Whether a pattern is the pixels' own. A sensor's pattern has no more in common from pixel to pixel than demosaicking
//! and compression mix: its autocovariance beyond that neighbourhood is chance. A scene's has, at one distance or many:
//! lines of a text, periods of a wallpaper, the outlines of things.

use std::f64::consts::PI;

use nalgebra::Complex;
use rayon::prelude::*;

use shutterbug::plane::Plane;
use shutterbug::plane::stats::erf;

/// Side of the blocks of JPEG, and twice that of a colour pattern's: both repeat, and belong to no single sensor.
pub(super) const REPEAT_PX: usize = 8;
/// Half a side of the blocks of JPEG: of pixels that lie so far apart, half lie in two of them, which have nothing in
/// common; and no interpolation of colours reaches as far.
const APART_PX: usize = REPEAT_PX / 2;
/// Largest side of the tiles whose spectra are averaged, px.
const TILE_PX: usize = 256;
/// The 99 % point of the normal distribution: a pattern is taken for a scene, and chance for bands, once in a hundred.
pub(super) const Z99: f64 = 2.326;
/// Variance of a squared spectral value of a single tile over its squared mean (Laplace's distribution; of many tiles
/// it is 2).
const SPREAD_OF_SQUARE: f64 = 5.0;

/// What two halves of the pictures show that no pixel has of its own, if that is most of what they show: of the same
/// in both, of what differs.
pub(super) fn content([a, b]: &[Plane<f32>; 2]) -> Option<String> {
    let with = |sign: f32| Plane {
        data: a.data.iter().zip(&b.data).map(|(a, b)| a + sign * b).collect(),
        ..a.clone()
    };
    let (sum, difference) = (with(1.0), with(-1.0));
    // Products of sum and difference's squares: noise has no part in what is left of the same.
    let same = |k: usize| apart(&sum, k) - apart(&difference, k);
    let (own, noise) = (same(0), apart(&difference, 0));
    // How well such means are known if all pixels of a block are alike.
    let error = |square: f64| 1.96 * square * REPEAT_PX as f64 / (a.data.len() as f64).sqrt();
    let said = |share: f64, what: &str, far_px: usize| {
        format!(
            "a {what} that is no pixel's own: {:.0} % of it is shared by pixels that lie {far_px} px apart",
            100.0 * share.min(1.0)
        )
    };
    // Noise has nothing in common from block to block. A pattern has: dust, what the light is like.
    let moving = apart(&difference, REPEAT_PX);
    if moving > error(noise) {
        return Some(said(moving / noise, "difference of the pictures", REPEAT_PX));
    }
    let (far, chance) = (same(APART_PX), error(apart(&sum, 0)) + error(noise));
    if own <= chance {
        return None;
    }
    if far - 0.5 * own > chance {
        return Some(said(far / own, "pattern", APART_PX));
    }
    Covariance::of(a, b).far_over_near().map(|times| {
        format!(
            "a pattern that is no pixel's own: pixels more than {REPEAT_PX} px apart share {times:.1} times as much of \
             it as neighbours do"
        )
    })
}

/// Mean product of pixels that lie so far apart, along rows and along columns.
fn apart(p: &Plane<f32>, distance: usize) -> f64 {
    let (w, h) = (p.width, p.height);
    let mean = |step: usize, columns: usize, rows: usize| {
        let row = |y: usize| (0..columns).map(move |x| y * w + x);
        let all = (0..rows).flat_map(row);
        all.map(|i| f64::from(p.data[i] * p.data[i + step])).sum::<f64>() / (columns * rows).max(1) as f64
    };
    0.5 * (mean(distance, w - distance, h) + mean(distance * w, w, h - distance))
}

/// Mean products of pixels of two pictures, and of each with itself, at all distances within a tile.
struct Covariance {
    side: usize,
    /// Pixels that were looked at.
    pixels: f64,
    both: Vec<f64>,
    first: Vec<f64>,
    second: Vec<f64>,
    /// Mean of the fourth power of the spectra over the square of that of their squares: 1 where all are alike.
    uneven: f64,
}

impl Covariance {
    fn of(a: &Plane<f32>, b: &Plane<f32>) -> Self {
        let side = tile_side(a);
        let (across, down) = (a.width / side, a.height / side);
        let count = side * side;
        let zero = || vec![[0.0f64; 3]; count];
        let sums = (0..across * down)
            .into_par_iter()
            .fold(zero, |mut sums, k| {
                let at = [k % across * side, k / across * side];
                let (p, q) = (spectrum(a, at, side), spectrum(b, at, side));
                for (sum, (p, q)) in sums.iter_mut().zip(p.iter().zip(&q)) {
                    let add = [(p * q.conj()).re, p.norm_sqr(), q.norm_sqr()];
                    sum.iter_mut().zip(add).for_each(|(s, v)| *s += v);
                }
                sums
            })
            .reduce(zero, |mut all, part| {
                all.iter_mut().flatten().zip(part.iter().flatten()).for_each(|(a, p)| *a += p);
                all
            });
        let pixels = (across * down * count) as f64;
        let back = |k: usize| -> Vec<f64> {
            let mut values: Vec<Complex<f64>> =
                sums.iter().map(|s| Complex::new(s[k] / pixels, 0.0)).collect();
            transform(&mut values, side);
            values.iter().map(|v| v.re / count as f64).collect()
        };
        let products = || sums.iter().map(|s| s[1] * s[2]);
        let mean = products().sum::<f64>() / count as f64;
        let uneven = products().map(|p| p * p).sum::<f64>() / count as f64 / (mean * mean).max(1e-300);
        Self { side, pixels, both: back(0), first: back(1), second: back(2), uneven }
    }

    /// Squares of what pixels share beyond the neighbourhood over those within, where that is more than 1 and more than
    /// chance: what chance makes of a pattern whose neighbourhood is as it was found, and which is white beyond.
    fn far_over_near(&self) -> Option<f64> {
        let distance = |i: usize| i.min(self.side - i);
        let is_near = |i: &usize| distance(i % self.side).max(distance(i / self.side)) <= REPEAT_PX;
        let all = self.side * self.side;
        let near: Vec<usize> = (0..all).filter(is_near).collect();
        // Distances to both sides are the same product.
        let chance = near.iter().map(|i| self.first[*i] * self.second[*i]).sum::<f64>() / (2.0 * self.pixels);
        let whole: f64 = self.both.iter().map(|v| v * v).sum();
        let within = near.iter().map(|i| self.both[*i].powi(2)).sum::<f64>();
        let beyond = whole - within - (all - near.len()) as f64 * chance;
        let within = within - near.len() as f64 * chance;
        let spread = chance * all as f64 * (SPREAD_OF_SQUARE * self.uneven / (0.5 * all as f64)).sqrt();
        (beyond - within > Z99 * spread).then(|| beyond / within.max(1e-300))
    }
}

/// Standard deviations that a normal value exceeds with that probability.
pub(super) fn beyond(probability: f64) -> f64 {
    let (mut low, mut high) = (0.0, 8.0);
    for _ in 0..60 {
        let middle: f64 = 0.5 * (low + high);
        let above = 0.5 * (1.0 - erf(middle / 2f64.sqrt()));
        if above > probability { low = middle } else { high = middle }
    }
    high
}

/// The spectrum of one picture times the conjugate of another's, over tiles with soft borders, and their side: borders
/// lie at the same place in both.
pub(super) fn common_spectrum(a: &Plane<f32>, b: &Plane<f32>) -> (Vec<Complex<f64>>, usize) {
    let side = tile_side(a);
    let window = |i: usize| (PI * (i as f64 + 0.5) / side as f64).sin().powi(2);
    let soft = |plane: &Plane<f32>| {
        let data = plane.data.iter().enumerate();
        let weight = |i: usize| window(i % plane.width % side) * window(i / plane.width % side);
        Plane { data: data.map(|(i, v)| (f64::from(*v) * weight(i)) as f32).collect(), ..plane.clone() }
    };
    let (a, b) = (soft(a), soft(b));
    let (across, down) = (a.width / side, a.height / side);
    let zero = || vec![Complex::new(0.0, 0.0); side * side];
    let sums = (0..across * down)
        .into_par_iter()
        .fold(zero, |mut sums, k| {
            let at = [k % across * side, k / across * side];
            let (p, q) = (spectrum(&a, at, side), spectrum(&b, at, side));
            sums.iter_mut().zip(p.iter().zip(&q)).for_each(|(s, (p, q))| *s += p * q.conj());
            sums
        })
        .reduce(zero, |mut all, part| {
            all.iter_mut().zip(&part).for_each(|(a, p)| *a += p);
            all
        });
    (sums, side)
}

/// Side of the tiles of a picture: a power of two.
fn tile_side(plane: &Plane<f32>) -> usize {
    let least = plane.width.min(plane.height).min(TILE_PX);
    if least.is_power_of_two() { least } else { least.next_power_of_two() / 2 }
}

/// The spectrum of a tile.
fn spectrum(plane: &Plane<f32>, [left, top]: [usize; 2], side: usize) -> Vec<Complex<f64>> {
    let row = |y: usize| &plane.data[(top + y) * plane.width + left..][..side];
    let mut values: Vec<Complex<f64>> =
        (0..side).flat_map(row).map(|v| Complex::new(f64::from(*v), 0.0)).collect();
    transform(&mut values, side);
    values
}

/// Fourier's transform of a square with a side of a power of two.
pub(super) fn transform(values: &mut [Complex<f64>], side: usize) {
    let turns: Vec<Complex<f64>> =
        (0..side / 2).map(|k| Complex::from_polar(1.0, -2.0 * PI * k as f64 / side as f64)).collect();
    for _ in 0..2 {
        values.chunks_exact_mut(side).for_each(|row| transform_row(row, &turns));
        // The other way round, and back the second time.
        for y in 0..side {
            (0..y).for_each(|x| values.swap(y * side + x, x * side + y));
        }
    }
}

/// Cooley and Tukey's algorithm (Mathematics of Computation 19, 1965).
fn transform_row(row: &mut [Complex<f64>], turns: &[Complex<f64>]) {
    let n = row.len();
    if n < 2 {
        return;
    }
    let bits = n.trailing_zeros();
    for i in 0..n {
        let j = i.reverse_bits() >> (usize::BITS - bits);
        if i < j {
            row.swap(i, j);
        }
    }
    let mut half = 1;
    while half < n {
        for start in (0..n).step_by(2 * half) {
            for k in 0..half {
                let (even, odd) = (row[start + k], row[start + k + half] * turns[k * (n / (2 * half))]);
                (row[start + k], row[start + k + half]) = (even + odd, even - odd);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_agrees_with_the_sum_it_stands_for() {
        let side = 8;
        let value = |i: usize| Complex::new(((i * i * 7 + 3 * i) % 11) as f64, 0.0);
        let mut fast: Vec<_> = (0..side * side).map(value).collect();
        transform(&mut fast, side);
        for (u, v) in [(0, 0), (1, 0), (0, 3), (5, 7)] {
            let turn = |i: usize| {
                let cycles = (i % side * u + i / side * v) as f64 / side as f64;
                value(i) * Complex::from_polar(1.0, -2.0 * PI * cycles)
            };
            let slow: Complex<f64> = (0..side * side).map(turn).sum();
            assert!((fast[v * side + u] - slow).norm() < 1e-9, "{u} {v}");
        }
    }
}
