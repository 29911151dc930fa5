//! What is left of noise behind compression, block by block. A coefficient that lies between two thresholds keeps
//! nothing of a noise that is narrower than its step, one that lies at a threshold goes either way and makes a whole
//! step of it: where the picture has texture much more is left than in flat places, and a mean over the picture is
//! wrong in both.

use std::sync::LazyLock;

use rayon::prelude::*;

use super::dct::{AREA, Dct, SIDE, TO_YCC, steps};
use super::grain::Grain;
use super::packing::ROUNDED2;
use crate::chain::Left;
use crate::plane::Plane;
use crate::plane::stats::erf;

/// Places between two thresholds, and widths of the noise, at which the variance of a rounded value is tabled.
const TABLE: [usize; 2] = [33, 15];
/// Widths of the noise, in steps, between which the table stands: below only the nearest threshold is within reach,
/// above rounding adds its own 1/12.
const WIDTHS: [f32; 2] = [0.15, 0.7];
/// What a colour has of brightness and of the two colour differences.
const TO_RGB: [[f32; 3]; 3] = [[1.0, 0.0, 1.402], [1.0, -0.344_136, -0.714_136], [1.0, 1.772, 0.0]];

/// Statistics that are told apart: pixels, bands of 2, 4 and 8 px, rows, columns, and what pixels keep of a pattern.
const KINDS: usize = 7;
/// The last of them.
const STEADY: usize = KINDS - 1;
/// Statistics of the noise of rows that are told apart: pixels, bands of 2, 4 and 8 px.
const ROW_KINDS: usize = 4;

/// Variances behind compression, DN^2, by block of 8 px, colour and statistic: of what white noise of that variance
/// would give of it.
pub struct Flips {
    across: usize,
    blocks: Vec<[Noises; 3]>,
}

/// By statistic what is left of noise that is a pixel's own, and of noise that a row shares.
struct Noises {
    own: [f32; KINDS],
    rows: [f32; ROW_KINDS],
}

impl Flips {
    /// Of a picture `dn` before compression, with noise of `variance` by value, DN^2, and `rows` of noise that a row
    /// shares, in all colours alike; nothing without.
    pub fn of(dn: &Plane<f32>, variance: &[f32], rows: &[f32], quality: u8, grain: &Grain) -> Self {
        let dct = Dct::new();
        let tables = [steps(quality, false), steps(quality, true)];
        let (w, h) = (dn.width, dn.height);
        let across = w.div_ceil(SIDE);
        let one = |b: usize| {
            let place = |i: usize| {
                let (x, y) = ((b % across) * SIDE + i % SIDE, (b / across) * SIDE + i / SIDE);
                3 * (y.min(h - 1) * w + x.min(w - 1))
            };
            // Of the three colours, means over the block.
            let mean = |of: &dyn Fn(usize) -> f32| (0..AREA).map(|i| of(place(i))).sum::<f32>() / AREA as f32;
            let before = [0, 1, 2].map(|c| mean(&|at| variance[at + c]));
            let shared = [0, 1, 2].map(|c| mean(&|at| rows.get(at + c).map_or(0.0, |v| v.sqrt())));
            let common =
                |k: usize, l: usize| (0..3).map(|c| TO_YCC[k][c] * TO_YCC[l][c] * before[c]).sum::<f32>();
            let in_rows = |k: usize| (0..3).map(|c| TO_YCC[k][c] * shared[c]).sum::<f32>();
            let parts: [Noises; 3] = std::array::from_fn(|k| {
                let offset = if k == 0 { 128.0 } else { 0.0 };
                let value = |i: usize| {
                    let rgb = &dn.data[place(i)..place(i) + 3];
                    (0..3).map(|c| TO_YCC[k][c] * rgb[c].clamp(0.0, 255.0)).sum::<f32>() - offset
                };
                let own = |i: usize| common(k, k) * grain.own(k, i) + ROUNDED2;
                // The noise of a row is the same along it: eight values that add up in one coefficient.
                let row = |i: usize| match i % SIDE {
                    0 => SIDE as f32 * in_rows(k).powi(2) * grain.rows(k, i),
                    _ => 0.0,
                };
                seen(&dct.forward(&std::array::from_fn(value)), (own, row), &tables[usize::from(k > 0)])
            });
            let had = |k: usize, l: usize| common(k, l) * grain.common([k, l]);
            let had_rows = |k: usize, l: usize| in_rows(k) * in_rows(l);
            TO_RGB.map(|m| Noises {
                own: std::array::from_fn(|s| together(&m, &parts.each_ref().map(|p| p.own[s]), had)),
                rows: std::array::from_fn(|s| together(&m, &parts.each_ref().map(|p| p.rows[s]), had_rows)),
            })
        };
        let blocks = (0..across * h.div_ceil(SIDE)).into_par_iter().map(one).collect();
        Self { across, blocks }
    }

    /// What is left at a value (its place in the picture's data) of noise of that variance before compression, DN^2.
    pub fn left(&self, width: usize, i: usize, variance: f32) -> Left {
        let own = &self.at(width, i).own;
        let share = |k: usize| own[k] / variance.max(1e-6);
        Left {
            pixel: share(0),
            steady: share(STEADY),
            bands: [share(1), share(2), share(3)],
            lines: [share(4), share(5)],
            ..Left::ALL
        }
    }

    /// What noise of rows leaves at a value: its variance in the pixel, DN^2, and the variances of noise of rows that
    /// would give as much in differences of means over blocks of 2, 4 and 8 px.
    pub fn rows(&self, width: usize, i: usize) -> (f32, [f32; 3]) {
        let [pixel, bands @ ..] = self.at(width, i).rows;
        (pixel, bands)
    }

    fn at(&self, width: usize, i: usize) -> &Noises {
        let (x, y) = ((i / 3) % width, i / 3 / width);
        &self.blocks[(y / SIDE) * self.across + x / SIDE][i % 3]
    }
}

/// Variance of a colour made of brightness and differences of such variances. What noise they had in common before
/// compression they have in common still, as far as it is left; what rounding adds they have not.
fn together(m: &[f32; 3], parts: &[f32; 3], common: impl Fn(usize, usize) -> f32) -> f32 {
    let kept = [0, 1, 2].map(|k| (parts[k] / common(k, k).max(1e-9)).min(1.0).sqrt());
    let pair = |k: usize, l: usize| 2.0 * m[k] * m[l] * common(k, l) * kept[k] * kept[l];
    let own: f32 = (0..3).map(|k| m[k] * m[k] * parts[k]).sum();
    (own + pair(0, 1) + pair(0, 2) + pair(1, 2)).max(0.0)
}

/// Variances of one component of a block by statistic. `noise`: what a coefficient has of noise of its own, and of
/// noise of rows; of what rounding makes of both together each has its share.
fn seen(
    coefficients: &[f32; AREA],
    noise: (impl Fn(usize) -> f32, impl Fn(usize) -> f32),
    steps: &[f32; AREA],
) -> Noises {
    let mut sums = Noises { own: [0.0; KINDS], rows: [0.0; ROW_KINDS] };
    for i in 0..AREA {
        let (own, row) = (noise.0(i), noise.1(i));
        let (all, step) = (own + row, steps[i]);
        let variance = rounded_variance(coefficients[i] / step, all.sqrt() / step) * step * step;
        let [of_own, of_row] = [own, row].map(|part| part / all * variance);
        (0..STEADY).for_each(|k| sums.own[k] += SHARES[i][k] * of_own);
        // What rounding adds hangs on the content, and is another wherever that has moved. Told 15 to 40 % low (tests):
        // over many contents some of what this counts as added stays too.
        sums.own[STEADY] += SHARES[i][0] * of_own.min(own);
        if i % SIDE == 0 {
            (0..ROW_KINDS).for_each(|k| sums.rows[k] += ROW_SHARES[i / SIDE][k] * of_row / SIDE as f32);
        }
    }
    sums
}

/// Variance, in squares of a step, of a normal value of that mean and width, in steps, after it has been rounded.
pub(crate) fn rounded_variance(at: f32, wide: f32) -> f32 {
    if wide >= WIDTHS[1] {
        return wide * wide + 1.0 / 12.0;
    }
    // From 0 at a whole step to a half at a threshold.
    let off = (at - at.round()).abs();
    if wide < WIDTHS[0] {
        let beyond =
            0.5 - 0.5 * erf(f64::from((0.5 - off) / wide.max(1e-6) * std::f32::consts::FRAC_1_SQRT_2));
        return (beyond * (1.0 - beyond)) as f32;
    }
    let x = 2.0 * off * (TABLE[0] - 1) as f32;
    let y = (wide - WIDTHS[0]) / (WIDTHS[1] - WIDTHS[0]) * (TABLE[1] - 1) as f32;
    let (i, j) = ((x as usize).min(TABLE[0] - 2), (y as usize).min(TABLE[1] - 2));
    let (fx, fy) = (x - i as f32, y - j as f32);
    let line = |j: usize| ROUNDED[j][i] * (1.0 - fx) + ROUNDED[j][i + 1] * fx;
    line(j) * (1.0 - fy) + line(j + 1) * fy
}

/// [`rounded_variance`] between [`WIDTHS`], by width and place.
static ROUNDED: LazyLock<Vec<Vec<f32>>> = LazyLock::new(|| {
    let one = |i: usize, j: usize| {
        let off = 0.5 * i as f64 / (TABLE[0] - 1) as f64;
        let wide = f64::from(WIDTHS[0] + (WIDTHS[1] - WIDTHS[0]) * j as f32 / (TABLE[1] - 1) as f32);
        let below = |t: f64| 0.5 + 0.5 * erf((t - off) / wide * std::f64::consts::FRAC_1_SQRT_2);
        let chances = (-5..=5).map(|k| (f64::from(k), below(f64::from(k) + 0.5) - below(f64::from(k) - 0.5)));
        let (mean, square) = chances.fold((0.0, 0.0), |(m, s), (k, p)| (m + k * p, s + k * k * p));
        (square - mean * mean) as f32
    };
    (0..TABLE[1]).map(|j| (0..TABLE[0]).map(|i| one(i, j)).collect()).collect()
});

/// What a coefficient of variance 1 gives of each statistic, over what all of them together give.
static SHARES: LazyLock<Vec<[f32; STEADY]>> = LazyLock::new(|| shares(0..AREA));

/// The same of the coefficients that noise of rows is in, over what these give together.
static ROW_SHARES: LazyLock<Vec<[f32; STEADY]>> = LazyLock::new(|| shares((0..AREA).step_by(SIDE)));

fn shares(coefficients: impl Iterator<Item = usize>) -> Vec<[f32; STEADY]> {
    let dct = Dct::new();
    let mut all: Vec<[f32; STEADY]> = coefficients
        .map(|i| {
            let mut one = [0.0; AREA];
            one[i] = 1.0;
            statistics(&dct.inverse(&one))
        })
        .collect();
    for k in 0..STEADY {
        let sum: f32 = all.iter().map(|s| s[k]).sum();
        all.iter_mut().for_each(|s| s[k] /= sum);
    }
    all
}

/// Mean squares of the statistics of a block.
fn statistics(block: &[f32; AREA]) -> [f32; STEADY] {
    let mean = |x0: usize, y0: usize, w: usize, h: usize| {
        let sum: f32 = (0..w * h).map(|i| block[(y0 + i / w) * SIDE + x0 + i % w]).sum();
        sum / (w * h) as f32
    };
    let band = |n: usize| {
        let cells = SIDE / n;
        let square = |i: usize| {
            let (x, y) = (i % cells * n, i / cells * n);
            let outer = 2 * n;
            // The mean over a block is all that a band of 8 px sees of it.
            let coarse =
                if outer > SIDE { 0.0 } else { mean(x / outer * outer, y / outer * outer, outer, outer) };
            (mean(x, y, n, n) - coarse).powi(2)
        };
        (0..cells * cells).map(square).sum::<f32>() / (cells * cells) as f32
    };
    let lines = |rows: bool| {
        let one = |i: usize| if rows { mean(0, i, SIDE, 1) } else { mean(i, 0, 1, SIDE) };
        (0..SIDE).map(|i| one(i).powi(2)).sum::<f32>() / SIDE as f32
    };
    let pixels = block.iter().map(|v| v * v).sum::<f32>() / AREA as f32;
    [pixels, band(2), band(4), band(8), lines(true), lines(false)]
}

#[cfg(test)]
mod tests {
    use super::super::packing::{band, packed_mean, square};
    use super::*;
    use crate::chain::rng::random_bits;

    /// Texture beside a flat half.
    fn picture() -> Plane<f32> {
        Plane::from_fn(64, 48, |x, y| {
            [0usize, 1, 2].map(|c| {
                let flat = 120.3 + 9.0 * c as f32;
                if x < 32 { flat } else { flat + 18.0 * ((x * 5 / 3 + y / 2 + c) % 7) as f32 - 50.0 }
            })
        })
    }

    fn normal(i: usize, seed: u32) -> f32 {
        let bits = random_bits([i as u32, seed], 0, 6, [2, 1]);
        let unit = |b: u32| (b as f32 + 0.5) / 4_294_967_296.0;
        (-2.0 * unit(bits[0]).ln()).sqrt() * (std::f32::consts::TAU * unit(bits[1])).cos()
    }

    #[test]
    fn what_is_left_of_noise_is_what_many_encoded_pictures_differ_by_in_texture_and_in_flat_places() {
        let plain = picture();
        for (sigma, quality) in [(1.5f32, 40u8), (4.0, 60), (9.0, 80)] {
            let variance = vec![sigma * sigma; plain.data.len()];
            let flips = Flips::of(&plain, &variance, &[], quality, Grain::white());
            let expected = packed_mean(&plain, &variance, &[], quality, Grain::white());
            let (mut seen, mut told) = ([0.0f64; 2], [0.0f64; 2]);
            for seed in 0..24u32 {
                let noisy = Plane {
                    data: (0..plain.data.len())
                        .map(|i| (plain.data[i] + sigma * normal(i, seed)).round())
                        .collect(),
                    ..plain.clone()
                };
                let encoded = super::super::compressed(&noisy, quality);
                for i in 0..plain.data.len() {
                    let half = usize::from((i / 3) % 64 >= 32);
                    seen[half] += f64::from(encoded.data[i] - expected.data[i]).powi(2);
                    let left = flips.left(64, i, sigma * sigma).pixel;
                    told[half] += f64::from(left * sigma * sigma) + 1.0 / 12.0;
                }
            }
            for half in 0..2 {
                let ratio = told[half] / seen[half];
                assert!(
                    (0.7..1.3).contains(&ratio),
                    "noise {sigma}, quality {quality}, half {half}: {ratio}"
                );
            }
            // Control: one share for all of the picture is wrong in one of the halves.
            let one = f64::from(super::super::packing::Packing::of(quality).left(sigma * sigma).pixel);
            let n = 24.0 * plain.data.len() as f64 / 2.0;
            let all = [0, 1].map(|h| (f64::from(sigma * sigma) * one + 1.0 / 12.0) * n / seen[h]);
            let worst = all.into_iter().map(|r| r.ln().abs()).fold(0.0, f64::max);
            assert!(sigma > 2.0 || worst > 0.4, "control: noise {sigma}, quality {quality}: {all:?}");
        }
    }

    /// The same pattern over two pictures: what their files have in common of it.
    #[test]
    fn a_pattern_keeps_over_moving_content_what_is_said() {
        let plain = picture();
        let data =
            (0..plain.data.len()).map(|i| 250.0 - plain.data[(i + 9 * 3) % plain.data.len()]).collect();
        let moved = Plane { data, ..plain.clone() };
        for (sigma, quality) in [(1.5f32, 40u8), (3.0, 83), (4.0, 60)] {
            let variance = vec![sigma * sigma; plain.data.len()];
            let known = [&plain, &moved].map(|p| {
                let flips = Flips::of(p, &variance, &[], quality, Grain::white());
                (p, flips, packed_mean(p, &variance, &[], quality, Grain::white()))
            });
            let (mut seen, mut told, mut whole) = (0.0f64, 0.0f64, 0.0f64);
            for seed in 0..24u32 {
                let errors = known.each_ref().map(|(p, _, expected)| {
                    let with = |i: usize| p.data[i] + sigma * normal(i, seed);
                    let data = (0..p.data.len()).map(with).map(f32::round).collect();
                    let encoded = super::super::compressed(&Plane { data, ..(*p).clone() }, quality);
                    encoded.data.iter().zip(&expected.data).map(|(e, m)| e - m).collect::<Vec<f32>>()
                });
                for i in (0..plain.data.len()).filter(|i| (i / 3) % 64 >= 32) {
                    seen += f64::from(errors[0][i] * errors[1][i]);
                    let left = [0, 1].map(|k| known[k].1.left(64, i, sigma * sigma));
                    let both = |of: fn(&Left) -> f32| {
                        f64::from((of(&left[0]) * of(&left[1])).sqrt() * sigma * sigma)
                    };
                    told += both(|l| l.steady);
                    whole += both(|l| l.pixel);
                }
            }
            let ratios = [told / seen, whole / seen];
            assert!((0.5..1.2).contains(&ratios[0]), "noise {sigma}, quality {quality}: {ratios:?}");
            assert!(ratios[1] > 5.0 * ratios[0], "control: {ratios:?}");
        }
    }

    #[test]
    fn noise_of_rows_is_left_where_its_coefficients_lie_at_a_threshold() {
        // Steps of 31 in the coefficient of the mean: grey 101 lies between two thresholds, grey 99 at one.
        let (sigma, quality) = (1.35f32, 26u8);
        let greys = [101.0, 99.0].map(|grey| Plane::from_fn(64, 64, |_, _| [grey; 3]));
        for (plain, often) in greys.iter().zip([false, true]) {
            let [none, rows] = [0.0, sigma * sigma].map(|v| vec![v; plain.data.len()]);
            let flips = Flips::of(plain, &none, &rows, quality, Grain::white());
            let expected = packed_mean(plain, &none, &rows, quality, Grain::white());
            let at = 3 * (20 * 64 + 30);
            let (in_pixel, [_, _, in_band]) = flips.rows(64, at);
            let (mut pixels, mut bands) = (0.0f64, 0.0f64);
            for seed in 0..60u32 {
                let noisy =
                    Plane::from_fn(64, 64, |_, y| [(plain.data[0] + sigma * normal(y, seed)).round(); 3]);
                let encoded = super::super::compressed(&noisy, quality);
                let errors = encoded.data.iter().zip(&expected.data).map(|(e, m)| e - m);
                let errors = Plane { data: errors.collect(), ..noisy };
                pixels += f64::from(square(errors.data.iter().copied())) / 60.0;
                // Of two blocks of a row one half is left beside the mean over four.
                bands += f64::from(band(&errors, 8)) / 60.0;
            }
            let told = [f64::from(in_pixel) + 1.0 / 12.0, f64::from(in_band) * 0.5 / 8.0];
            let ratios = [told[0] / pixels, told[1] / bands.max(1e-3)];
            if often {
                assert!(ratios.iter().all(|r| (0.75..1.3).contains(r)), "{ratios:?} {told:?}");
                // Control: what a picture of all greys keeps on average is too little here.
                let [average, _] = super::super::packing::Packing::of(quality).rows_left(sigma * sigma);
                assert!(f64::from(average * sigma * sigma) < 0.6 * pixels, "control: {average} {pixels}");
            } else {
                assert!(told[1] < 0.01 && bands < 0.01, "{told:?} {bands}");
            }
        }
    }

    #[test]
    fn strong_noise_is_left_whole_whatever_is_looked_at() {
        let plain = picture();
        let variance = vec![900.0; plain.data.len()];
        let left = Flips::of(&plain, &variance, &[], 85, Grain::white()).left(64, 3 * (20 * 64 + 10), 900.0);
        for share in [left.pixel, left.bands[0], left.bands[2], left.lines[0], left.lines[1]] {
            // Rounding adds its own: the steps of colours are up to 30 DN wide here.
            assert!((0.95..1.2).contains(&share), "{left:?}");
        }
    }
}
