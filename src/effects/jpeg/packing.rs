//! Compression of noisy pictures: what JPEG makes of a picture on average over the noise in it, and what it leaves of
//! the noise. Noise wider than a step carries the mean through the rounding (dither); noise narrower than half a step
//! is removed, coefficient by coefficient, so that what remains is coarser than a pixel.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex};

use rayon::prelude::*;

use super::dct::{AREA, Dct, SIDE, TO_YCC, steps};
use super::grain::Grain;
use crate::chain::rng::{random_bits, random_uniform};
use crate::chain::{BANDS, Left};
use crate::plane::Plane;
use crate::plane::stats::{erf, robust_variance};

/// Variance that rounding adds before a coefficient is rounded, DN^2: of the three colours, and of brightness and
/// colours.
pub(crate) const ROUNDED2: f32 = 0.12;

/// Mean over the noise of a picture behind compression, DN. `variance`: of the noise before it, by value, DN^2; `rows`:
/// of noise that a row shares, in all colours alike, which lies in the coefficients of rows alone.
pub(crate) fn packed_mean(
    dn: &Plane<f32>,
    variance: &[f32],
    rows: &[f32],
    quality: u8,
    grain: &Grain,
) -> Plane<f32> {
    let dct = Dct::new();
    let tables = [steps(quality, false), steps(quality, true)];
    let (w, h) = (dn.width, dn.height);
    let mut out = Plane::new(w, h, 3);
    let shared = |at: usize| rows.get(at).map_or(0.0, |v| v.sqrt());
    let strip = |(band, strip): (usize, &mut [f32])| {
        for x0 in (0..w).step_by(SIDE) {
            let place = |i: usize| {
                let (x, y) = ((x0 + i % SIDE).min(w - 1), (band * SIDE + i / SIDE).min(h - 1));
                3 * (y * w + x)
            };
            let block = block(&dct, &tables, grain, |i| {
                let at = place(i);
                [0, 1, 2].map(|c| [dn.data[at + c].clamp(0.0, 255.0), variance[at + c], shared(at + c)])
            });
            for i in (0..AREA).filter(|i| x0 + i % SIDE < w && band * SIDE + i / SIDE < h) {
                let to = 3 * ((i / SIDE) * w + x0 + i % SIDE);
                let [y, b, r] = [0, 1, 2].map(|k| block[k][i]);
                let rgb = [y + 1.402 * r, y - 0.344_136 * b - 0.714_136 * r, y + 1.772 * b];
                strip[to..to + 3].copy_from_slice(&rgb.map(|v| (v + 128.0).clamp(0.0, 255.0)));
            }
        }
    };
    out.data.par_chunks_mut(3 * w * SIDE).enumerate().for_each(strip);
    out
}

/// Brightness less 128 and colours of one block. `value`: by colour the mean, the variance that is its own, and the
/// size of the noise that its row shares.
fn block(
    dct: &Dct,
    tables: &[[f32; AREA]; 2],
    grain: &Grain,
    value: impl Fn(usize) -> [[f32; 3]; 3],
) -> [[f32; AREA]; 3] {
    let values: [[[f32; 3]; 3]; AREA] = std::array::from_fn(value);
    std::array::from_fn(|k| {
        let weights = TO_YCC[k];
        let plane = std::array::from_fn(|i| {
            let sum: f32 = (0..3).map(|c| weights[c] * values[i][c][0]).sum();
            if k == 0 { sum - 128.0 } else { sum }
        });
        let variance = (0..AREA)
            .map(|i| (0..3).map(|c| weights[c] * weights[c] * values[i][c][1]).sum::<f32>())
            .sum::<f32>()
            / AREA as f32;
        let shared = (0..AREA).map(|i| (0..3).map(|c| weights[c] * values[i][c][2]).sum::<f32>().powi(2));
        // The noise of a row is the same along it: eight values that add up in one coefficient.
        let rows = shared.sum::<f32>() / SIDE as f32;
        let table = &tables[usize::from(k > 0)];
        let mut coefficients = dct.forward(&plane);
        for (i, (c, step)) in coefficients.iter_mut().zip(table).enumerate() {
            let rows = if i % SIDE == 0 { rows * grain.rows(k, i) } else { 0.0 };
            *c = rounded_mean(*c, (variance * grain.own(k, i) + rows + ROUNDED2).sqrt(), *step);
        }
        dct.inverse(&coefficients)
    })
}

/// Mean of a normal value after it has been rounded to multiples of a step.
pub(crate) fn rounded_mean(mean: f32, sigma: f32, step: f32) -> f32 {
    let (at, wide) = (mean / step, sigma / step);
    if wide > 0.7 {
        return mean;
    }
    if wide > 0.2 {
        // The error of rounding as a series of waves, each damped by the noise.
        let (s, c) = (std::f32::consts::TAU * at).sin_cos();
        let damped = (-0.5 * (std::f32::consts::TAU * wide).powi(2)).exp();
        // Sines of twice and three times the angle; damping goes with the square of that.
        let waves = [s, 2.0 * s * c, s * (3.0 - 4.0 * s * s)];
        let dampings = [damped, damped.powi(4), damped.powi(9)];
        let [one, two, three] =
            [0, 1, 2].map(|k| waves[k] * dampings[k] / (std::f32::consts::PI * (k + 1) as f32));
        return step * (at - one + two - three);
    }
    // Only the nearest threshold is within reach.
    let below = at.floor();
    let z = (at - below - 0.5) / wide.max(1e-6);
    step * (below + 0.5 * (1.0 + erf(f64::from(z) * std::f64::consts::FRAC_1_SQRT_2) as f32))
}

/// Standard deviations of the noise at which [`Left`] is known, DN: equal ratios.
const LEVELS: usize = 15;
/// The least of them, and their ratio.
const LEVEL: [f32; 2] = [0.5, std::f32::consts::SQRT_2];

/// What a quality leaves of noise, by how much there was: of white noise, and of noise that a row shares, in a pixel
/// and in the mean of its row.
#[derive(Debug)]
pub struct Packing([Left; LEVELS], [[f32; 2]; LEVELS]);

static KNOWN: LazyLock<Mutex<HashMap<u8, Arc<Packing>>>> = LazyLock::new(Mutex::default);

impl Packing {
    /// Of a quality; worked out once, from noise drawn with a fixed seed.
    pub fn of(quality: u8) -> Arc<Self> {
        let mut known = KNOWN.lock().expect("nobody panics while it is held");
        known.entry(quality).or_insert_with(|| Arc::new(Self::drawn(quality))).clone()
    }

    fn drawn(quality: u8) -> Self {
        let sigma = |i: usize| LEVEL[0] * LEVEL[1].powi(i as i32);
        let all: Vec<(Left, [f32; 2])> = (0..LEVELS)
            .into_par_iter()
            .map(|i| (drawn_at(quality, sigma(i)), rows_at(quality, sigma(i))))
            .collect();
        Self(std::array::from_fn(|i| all[i].0), std::array::from_fn(|i| all[i].1))
    }

    /// For noise of that variance before the compression, DN^2.
    pub fn left(&self, variance: f32) -> Left {
        let (i, f) = level(variance);
        self.0[i].mix(&self.0[i + 1], f)
    }

    /// What noise of that variance, DN^2, that a row shares keeps in a pixel, and in the mean of its row.
    pub fn rows_left(&self, variance: f32) -> [f32; 2] {
        let (i, f) = level(variance);
        [0, 1].map(|k| self.1[i][k] * (1.0 - f) + self.1[i + 1][k] * f)
    }

    /// The variance before the compression over that measured behind it, by differences of a kind (see
    /// [`Left::high_pass`]); at most a limit, since of what is removed altogether nothing is known.
    pub fn restored(&self, measured: f32, kind: usize) -> f32 {
        const MOST: f32 = 30.0;
        // The share that is left times this ratio rises with the ratio: halve the interval.
        let (mut low, mut high) = (0.25f32, MOST);
        for _ in 0..24 {
            let middle = (low * high).sqrt();
            if middle * self.left(measured * middle).high_pass[kind] < 1.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}

/// Between which two levels a variance lies, and how far.
fn level(variance: f32) -> (usize, f32) {
    let at = (0.5 * (variance.max(1e-6) / (LEVEL[0] * LEVEL[0])).ln() / LEVEL[1].ln())
        .clamp(0.0, (LEVELS - 1) as f32);
    let i = (at as usize).min(LEVELS - 2);
    (i, at - i as f32)
}

/// Size of the picture of noise, px.
const DRAWN: [usize; 2] = [256, 192];

/// Flat blocks and their noise, the same for all qualities and levels. Means of blocks lie anywhere between two steps.
static FLAT: LazyLock<[Plane<f32>; 2]> = LazyLock::new(|| {
    let grey = |x: usize, y: usize| {
        96.0 + 64.0 * random_uniform([(x / SIDE) as u32, (y / SIDE) as u32], 1, 0x4a, [1, 2])[0]
    };
    [Plane::from_fn(DRAWN[0], DRAWN[1], |x, y| [grey(x, y); 3]), normal_noise(DRAWN)]
});

/// White noise of variance 1 in each of three channels.
pub(crate) fn normal_noise([w, h]: [usize; 2]) -> Plane<f32> {
    let normal = |x: usize, y: usize, c: u32| {
        let bits = random_bits([x as u32, y as u32], c, 0x4b, [1, 2]);
        let unit = |b: u32| (b as f32 + 0.5) / 4_294_967_296.0;
        (-2.0 * unit(bits[0]).ln()).sqrt() * (std::f32::consts::TAU * unit(bits[1])).cos()
    };
    Plane::from_fn(w, h, |x, y| [0, 1, 2].map(|c| normal(x, y, c)))
}

fn drawn_at(quality: u8, sigma: f32) -> Left {
    let [mean, noise] = &*FLAT;
    let noisy = Plane {
        data: mean.data.iter().zip(&noise.data).map(|(m, n)| (m + sigma * n).round()).collect(),
        ..mean.clone()
    };
    let expected = packed_mean(mean, &vec![sigma * sigma; mean.data.len()], &[], quality, Grain::white());
    let errors = errors(&noisy, &expected, quality);
    let pixel = square(errors.data.iter().copied()) / (sigma * sigma);
    Left {
        pixel,
        steady: pixel.min(1.0),
        high_pass: [2, 4].map(|apart| high_pass(&errors, apart) / (sigma * sigma)),
        bands: BANDS.map(|n| band(&errors, n) / (0.75 * sigma * sigma / (n * n) as f32)),
        lines: [true, false].map(|rows| lines(&errors, rows) / (sigma * sigma)),
    }
    .at_most(4.0)
}

/// What one noisy picture behind compression is beside the mean over many.
fn errors(noisy: &Plane<f32>, expected: &Plane<f32>, quality: u8) -> Plane<f32> {
    // No noise is left to be averaged over.
    let seen = packed_mean(noisy, &vec![0.0; noisy.data.len()], &[], quality, Grain::white());
    Plane { data: seen.data.iter().zip(&expected.data).map(|(s, e)| s.round() - e).collect(), ..seen }
}

/// See [`Packing::rows_left`].
fn rows_at(quality: u8, sigma: f32) -> [f32; 2] {
    let [mean, noise] = &*FLAT;
    let silent = vec![0.0; mean.data.len()];
    let value = |x: usize, y: usize, c: usize| mean.pixel(x, y)[c] + sigma * noise.pixel(0, y)[0];
    let noisy = Plane::from_fn(DRAWN[0], DRAWN[1], |x, y| [0, 1, 2].map(|c| value(x, y, c).round()));
    let expected = packed_mean(mean, &silent, &vec![sigma * sigma; mean.data.len()], quality, Grain::white());
    let errors = errors(&noisy, &expected, quality);
    // As many rows as there are do not have the variance that they were drawn with.
    let drawn = square((0..DRAWN[1]).map(|y| sigma * noise.pixel(0, y)[0]));
    [square(errors.data.iter().copied()), lines(&errors, true) / DRAWN[0] as f32]
        .map(|v| (v / drawn).min(4.0))
}

pub(crate) fn square(values: impl Iterator<Item = f32>) -> f32 {
    let (sum, count) = values.fold((0.0f64, 0.0), |(s, n), v| (s + f64::from(v * v), n + 1.0));
    (sum / f64::max(count, 1.0)) as f32
}

/// Variance as noise is measured: from the middle of the differences to the mean of two others.
fn high_pass(e: &Plane<f32>, apart: usize) -> f32 {
    let mut all = Vec::new();
    for y in 0..e.height {
        let row = e.row(y);
        all.extend(
            (3 * apart..row.len() - 3 * apart)
                .map(|i| row[i] - 0.5 * (row[i - 3 * apart] + row[i + 3 * apart])),
        );
    }
    (robust_variance(&mut all) / 1.5) as f32
}

/// Mean square difference between means over blocks of `n` px and over blocks of twice that side.
pub(crate) fn band(e: &Plane<f32>, n: usize) -> f32 {
    let mean = |x0: usize, y0: usize, n: usize, c: usize| {
        let sum: f32 = (0..n * n).map(|i| e.pixel(x0 + i % n, y0 + i / n)[c]).sum();
        sum / (n * n) as f32
    };
    let mut all = Vec::new();
    for y in (0..e.height / (2 * n) * 2 * n).step_by(n) {
        for x in (0..e.width / (2 * n) * 2 * n).step_by(n) {
            let outer = (x / (2 * n) * 2 * n, y / (2 * n) * 2 * n);
            all.extend((0..3).map(|c| mean(x, y, n, c) - mean(outer.0, outer.1, 2 * n, c)));
        }
    }
    square(all.into_iter())
}

/// Variance of the means of rows or columns, times their length.
pub(crate) fn lines(e: &Plane<f32>, rows: bool) -> f32 {
    let (count, length) = if rows { (e.height, e.width) } else { (e.width, e.height) };
    let at = |line: usize, i: usize| if rows { e.pixel(i, line) } else { e.pixel(line, i) };
    let means = (0..count * 3).map(|k| {
        let sum: f32 = (0..length).map(|i| at(k / 3, i)[k % 3]).sum();
        sum / length as f32
    });
    square(means) * length as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_noise_it_is_the_encoder_and_with_noise_the_mean_over_many() {
        let plain = Plane::from_fn(48, 32, |x, y| {
            [0, 1, 2].map(|c| (40.0 + 20.0 * ((x / 5 + y / 6 + c) % 7) as f32 + (x * y % 11) as f32).round())
        });
        let none = vec![0.0; plain.data.len()];
        let encoded = super::super::compressed(&plain, 60);
        let off = |a: &Plane<f32>, b: &Plane<f32>| {
            a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.data.len() as f32
        };
        // Coefficients near a threshold go either way: libjpeg is as far from an exact transform here (1.5 DN).
        let hard = packed_mean(&plain, &none, &[], 60, Grain::white());
        assert!(off(&hard, &encoded) < 0.3 * off(&plain, &encoded), "{}", off(&hard, &encoded));
        let sigma = 6.0;
        let mut mean = Plane::<f32>::new(48, 32, 3);
        for seed in 0..40 {
            let noisy = Plane {
                data: plain
                    .data
                    .iter()
                    .enumerate()
                    .map(|(i, v)| {
                        let uniform = random_uniform([i as u32, seed], 0, 5, [1, 1]);
                        let noise: f32 = uniform.iter().map(|u| u - 0.5).sum();
                        (v + sigma * 1.732 * noise).round()
                    })
                    .collect(),
                ..plain.clone()
            };
            let one = super::super::compressed(&noisy, 60);
            mean.data.iter_mut().zip(&one.data).for_each(|(m, v)| *m += v / 40.0);
        }
        let expected = packed_mean(&plain, &vec![sigma * sigma; plain.data.len()], &[], 60, Grain::white());
        // The mean of 40 has 1 DN of noise itself, 0.8 in size.
        assert!(off(&mean, &expected) < 0.9, "{}", off(&mean, &expected));
        assert!(off(&mean, &hard) > 1.3 * off(&mean, &expected), "control: {}", off(&mean, &hard));
    }

    #[test]
    fn noise_of_rows_dithers_the_coefficients_of_rows_alone() {
        let plain = Plane::from_fn(64, 64, |x, y| {
            [0, 1, 2].map(|c| (60.0 + 8.0 * ((x / 3 + y / 5 + c) % 5) as f32 + (x * y % 7) as f32).round())
        });
        let (sigma, count) = (6.0f32, 200);
        let normal = |y: usize, seed: u32| {
            let uniform = random_uniform([y as u32, seed], 0, 6, [1, 1]);
            sigma * 1.732 * uniform.iter().map(|u| u - 0.5).sum::<f32>()
        };
        let mut mean = Plane::<f32>::new(64, 64, 3);
        for seed in 0..count {
            let noisy = Plane::from_fn(64, 64, |x, y| {
                let pixel = plain.pixel(x, y);
                [0, 1, 2].map(|c| (pixel[c] + normal(y, seed)).round())
            });
            let one = super::super::compressed(&noisy, 50);
            mean.data.iter_mut().zip(&one.data).for_each(|(m, v)| *m += v / count as f32);
        }
        let off = |a: &Plane<f32>| {
            let sum = mean.data.iter().zip(&a.data).map(|(m, v)| (m - v).powi(2)).sum::<f32>();
            (sum / mean.data.len() as f32).sqrt()
        };
        let (silent, noise) = (vec![0.0; plain.data.len()], vec![sigma * sigma; plain.data.len()]);
        let [rows, white] = [
            packed_mean(&plain, &silent, &noise, 50, Grain::white()),
            packed_mean(&plain, &noise, &[], 50, Grain::white()),
        ]
        .map(|p| off(&p));
        // The mean of the draws has 0.4 DN of noise itself.
        assert!(rows < 0.75 * white, "{rows} DN, control: as white noise {white}");
    }

    #[test]
    fn strong_noise_of_rows_is_left_and_weak_noise_of_flat_blocks_is_not() {
        let [weak, strong] = [1.0, 900.0].map(|v| Packing::of(30).rows_left(v));
        assert!(weak.iter().all(|v| *v < 0.7), "{weak:?}");
        assert!(strong.iter().all(|v| (v - 1.0).abs() < 0.1), "{strong:?}");
        let fine = Packing::of(100).rows_left(4.0);
        assert!(
            fine.iter().all(|v| (v - 1.0).abs() < 0.1),
            "control: the finest quality leaves it: {fine:?}"
        );
    }

    #[test]
    fn compression_leaves_coarse_noise_and_little_of_fine_noise_and_all_of_strong_noise() {
        let packing = Packing::of(60);
        let [weak, strong] = [4.0, 900.0].map(|v| packing.left(v));
        assert!(weak.pixel < 0.5 && weak.bands[2] > 1.5 * weak.bands[0], "{weak:?}");
        assert!((strong.pixel - 1.0).abs() < 0.2, "{strong:?}");
        // What is measured behind it gives back what was there.
        for variance in [40.0f32, 100.0, 400.0] {
            let measured = variance * packing.left(variance).high_pass[0];
            let back = measured * packing.restored(measured, 0);
            assert!((back / variance - 1.0).abs() < 0.15, "{variance}: {back}");
        }
        assert!(Packing::of(100).left(4.0).pixel > 0.8, "control: the finest quality leaves it");
    }
}
