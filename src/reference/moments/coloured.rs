//! Noise of colours that are made of each other ahead of the encoding. A demosaicking that corrects one colour by
//! another, and a colour matrix, give a dark colour the noise of a bright one: its spread is not that of a grey as
//! dark, and black cuts more of it off.

use glam::Mat3;

use super::places::{COARSE, mixed_colors, place, places_by_dn, sensor_at, sensor_place};
use crate::chain::{Mixing, Origins, Variances};
use crate::plane::three;

/// Widths of noise that the tables hold, by their root: what the encoding makes of noise changes most while it is
/// narrow.
const WIDTHS: usize = 20;
/// Roots of the narrowest and of the widest, of a standard deviation of the encoded value.
const ROOTS: [f32; 2] = [0.03, 0.5];
/// Points of the integral over the noise, each side of the mean, and their distance in standard deviations.
const POINTS: i32 = 10;
/// See [`POINTS`].
const STEP: f32 = 0.36;

/// By width of the noise.
type ByWidth = [f32; WIDTHS];

/// A kind of pixels of a colour in a mosaic: its share of them, and what of the variance of each colour of the sensor
/// it has.
type Kind = (f32, [f32; 3]);

/// What two encoded values of a pixel have in common of the variance of each colour of the sensor, `[one][other]`.
type Common = [[[f32; 3]; 3]; 3];

/// What makes delivered values of the sensor's.
pub(super) struct Conversion<'a> {
    /// What encoded values are made of, `[of][from]`.
    pub weights: [[f32; 3]; 3],
    /// What a grey is multiplied with.
    pub whole: [f32; 3],
    /// Whose noise a mosaic gives each colour.
    pub origins: &'static Origins,
    /// What steps that mix pixels leave of it.
    pub mixing: &'a Mixing,
    /// DN of an encoded value of a colour.
    pub encoded: &'a dyn Fn(f32, usize) -> f32,
    /// Noise of the sensor's value of a colour.
    pub noise: &'a dyn Fn(f32, usize) -> Variances,
}

/// Which colours of the sensor give each colour its noise, where that is not its own alone.
pub struct Sources {
    /// Shares of each, by colour: `[of][from]`.
    pub shares: [[f32; 3]; 3],
    /// Variance that a colour matrix leaves of noise that is as much in each, over that of a grey behind it.
    pub kept: [f32; 3],
    /// From what greys as bright as each delivered colour are on the sensor to what is there, `[of][from]`.
    pub back: [[f32; 3]; 3],
}

/// What the encoding makes of noise of any width, and how wide it is by colour.
pub(super) struct Coloured {
    kinds: [Vec<Kind>; 3],
    /// By pixel of the mosaic's cell.
    common: [Common; 4],
    /// From encoded values to those of the sensor, `[of][from]`.
    back: [[f32; 3]; 3],
    /// What encoded values are made of, `[of][from]`: rows have the same noise in all colours.
    weights: [[f32; 3]; 3],
    /// By colour and place of the sensor's value.
    noise: [Vec<Variances>; 3],
    /// By colour and place of the encoded value: what noise adds to the mean, DN, over its width.
    shift: [Vec<ByWidth>; 3],
    /// By colour and whole DN of the mean: variance of the delivered value over that of the encoded one.
    share: [Vec<ByWidth>; 3],
    /// By colour and whole DN of the mean: the encoded value of a grey.
    values: [Vec<f32>; 3],
    /// What filters behind the mosaic leave of the noise of pixels.
    filtered: [f32; 3],
    /// What mosaic and filters leave of the noise of rows.
    row: [f32; 3],
}

impl Coloured {
    /// Of a camera; nothing where each colour has its own noise alone.
    pub(super) fn of(conversion: &Conversion<'_>) -> Option<Self> {
        let weights = conversion.weights;
        let common = conversion.origins.each_ref().map(|pixel| common(&weights, pixel));
        let kinds = three(|c| {
            let mut kinds: Vec<Kind> = Vec::new();
            for pixel in &common {
                let of = pixel[c][c];
                let alike = |k: &&mut Kind| k.1.iter().zip(&of).all(|(a, b)| (a - b).abs() < 1e-5);
                match kinds.iter_mut().find(alike) {
                    Some(kind) => kind.0 += 0.25,
                    None => kinds.push((0.25, of)),
                }
            }
            kinds
        });
        let back = back(&weights).filter(|_| !has_own_noise(&common))?;
        let mut coloured = Self {
            kinds,
            common,
            back,
            weights,
            noise: three(|c| (0..COARSE).map(|i| (conversion.noise)(sensor_at(i), c)).collect()),
            shift: Default::default(),
            share: Default::default(),
            values: Default::default(),
            filtered: three(|c| conversion.mixing.pixel[c] / left_by_mosaic(conversion.origins, c)),
            row: conversion.mixing.row,
        };
        for c in 0..3 {
            coloured.bend(conversion, c);
        }
        Some(coloured)
    }

    /// Makes the tables of what the encoding of a colour makes of noise.
    fn bend(&mut self, conversion: &Conversion<'_>, c: usize) {
        let encoded = |value: f32| (conversion.encoded)(value, c);
        let bent: Vec<[ByWidth; 2]> = (0..COARSE).map(|i| bent(encoded, sensor_at(i))).collect();
        self.shift[c] = bent.iter().map(|b| b[0]).collect();
        let plain: Vec<f32> = (0..COARSE).map(|i| encoded(sensor_at(i))).collect();
        let mut shares = [[0.0; 256]; WIDTHS];
        for (w, shares) in shares.iter_mut().enumerate() {
            let places = places_by_dn(|i| plain[i] + width(w) * bent[i][0][w]);
            for (share, (i, f)) in shares.iter_mut().zip(places) {
                *share = bent[i.saturating_sub(1)][1][w] * (1.0 - f) + bent[i][1][w] * f;
            }
        }
        self.share[c] = (0..256).map(|dn| shares.each_ref().map(|s| s[dn])).collect();
        // A grey's colours are what one value of the sensor makes of them.
        let grey = |i: usize| three(|k| conversion.whole[k] * sensor_at(i) / conversion.whole[c]);
        let means: Vec<f32> = (0..COARSE).map(|i| plain[i] + self.shift(&grey(i), c)).collect();
        let value = |(i, f): (usize, f32)| sensor_at(i.saturating_sub(1)) * (1.0 - f) + sensor_at(i) * f;
        self.values[c] = places_by_dn(|i| means[i]).map(value).collect();
    }

    /// Noise of the sensor's values that encoded values are made of.
    fn sensor(&self, values: &[f32; 3]) -> [Variances; 3] {
        three(|c| {
            let sensor: f32 = (0..3).map(|k| self.back[c][k] * values[k]).sum();
            self.noise[c][place(sensor_place(sensor) + 0.5).min(COARSE - 1)]
        })
    }

    /// By kind of pixels of a colour: its share, and its noise.
    fn by_kind(&self, noise: [Variances; 3], c: usize) -> impl Iterator<Item = (f32, Variances)> {
        let row = mixed_colors((0..3).map(|from| (self.weights[c][from], noise[from]))).row;
        self.kinds[c].iter().map(move |(share, of)| {
            let all = (0..3).fold(Variances::default(), |all, from| all.plus(of[from], &noise[from]));
            (*share, Variances { row, ..all })
        })
    }

    /// What noise adds to the mean of a colour of encoded values, DN.
    fn shift(&self, values: &[f32; 3], c: usize) -> f32 {
        let noise = self.sensor(values);
        self.shift_by(noise, values[c], c)
    }

    fn shift_by(&self, noise: [Variances; 3], value: f32, c: usize) -> f32 {
        let shift = &self.shift[c][place(sensor_place(value) + 0.5).min(COARSE - 1)];
        let one = |(share, v): (f32, Variances)| {
            let wide = v.width();
            share * wide * at_width(shift, wide)
        };
        self.by_kind(noise, c).map(one).sum()
    }

    /// What noise adds to the means of encoded values, DN.
    pub(super) fn shifts(&self, values: [f32; 3]) -> [f32; 3] {
        let noise = self.sensor(&values);
        three(|c| self.shift_by(noise, values[c], c))
    }

    /// Spread of a channel of a pixel of these mean DN.
    pub(super) fn spread(&self, mean_dn: &[f32], c: usize) -> Variances {
        let dn = |k: usize| (mean_dn[k] + 0.5).clamp(0.0, 255.0) as usize;
        let noise = self.sensor(&three(|k| self.values[k][dn(k)]));
        let share = &self.share[c][dn(c)];
        let mut sum = Variances::default();
        for (of, v) in self.by_kind(noise, c) {
            sum = sum.plus(of * at_width(share, v.width()), &v);
        }
        let [pixel, row] = [self.filtered[c], self.row[c]];
        Variances { free: pixel * sum.free, row: row * sum.row, fixed: pixel * sum.fixed }
    }

    /// Spread of a mixture of the channels of a pixel of these mean DN, which have noise in common.
    pub(super) fn spread_of_mixture(&self, mean_dn: &[f32; 3], mixture: &[f32; 3]) -> Variances {
        let dn = mean_dn.map(|v| (v + 0.5).clamp(0.0, 255.0) as usize);
        let noise = self.sensor(&three(|k| self.values[k][dn[k]]));
        // By channel: DN per unit of the encoded value, times its part of the mixture.
        let slopes = three(|c| {
            let of = |(share, v): (f32, Variances)| share * at_width(&self.share[c][dn[c]], v.width());
            mixture[c] * self.by_kind(noise, c).map(of).sum::<f32>().sqrt()
        });
        let mut sum = Variances::default();
        for (a, b) in (0..9).map(|i| (i / 3, i % 3)) {
            let filtered = (self.filtered[a] * self.filtered[b]).sqrt();
            for (pixel, from) in (0..12).map(|i| (i / 3, i % 3)) {
                let weight = 0.25 * filtered * slopes[a] * slopes[b] * self.common[pixel][a][b][from];
                sum = sum.plus(weight, &noise[from]);
            }
        }
        let row = |c: usize| mixed_colors((0..3).map(|from| (self.weights[c][from], noise[from]))).row;
        let rows: f32 = (0..3).map(|c| slopes[c] * (self.row[c] * row(c)).sqrt()).sum();
        Variances { row: rows * rows, ..sum }
    }
}

impl Sources {
    /// Of a camera; nothing where each colour has its own noise alone.
    pub(super) fn of(weights: &[[f32; 3]; 3], whole: [f32; 3], origins: &Origins) -> Option<Self> {
        let common = origins.each_ref().map(|pixel| common(weights, pixel));
        let back = back(weights).filter(|_| !has_own_noise(&common))?;
        let variance = |c: usize| three(|from| common.iter().map(|p| 0.25 * p[c][c][from]).sum::<f32>());
        let all = three(|c| variance(c).iter().sum::<f32>());
        let grey2 = whole.map(|whole| whole * whole);
        Some(Self {
            shares: three(|c| variance(c).map(|v| v / all[c])),
            kept: three(|c| all[c] / (grey2[c] * left_by_mosaic(origins, c))),
            back: back.map(|of| three(|from| of[from] * whole[from])),
        })
    }
}

/// Of values that a matrix (`[of][from]`) makes of a mosaic's.
fn common(weights: &[[f32; 3]; 3], pixel: &[[[f64; 3]; 3]; 3]) -> Common {
    let of = |one: usize, other: usize, from: usize| -> f32 {
        let pairs = (0..9).map(|i| (i / 3, i % 3));
        pairs.map(|(a, b)| weights[one][a] * weights[other][b] * pixel[from][a][b] as f32).sum()
    };
    three(|one| three(|other| three(|from| of(one, other, from))))
}

/// Whether each colour has its own noise and nothing else, the same in all pixels.
fn has_own_noise(common: &[Common; 4]) -> bool {
    let others = |p: &Common| (0..9).any(|i| i / 3 != i % 3 && p[i / 3][i / 3][i % 3].abs() > 1e-6);
    common.iter().all(|p| *p == common[0] && !others(p))
}

/// What of its variance, the same in each colour, a mosaic leaves of the noise of one.
fn left_by_mosaic(origins: &Origins, c: usize) -> f32 {
    origins.iter().flatten().map(|from| 0.25 * from[c][c] as f32).sum()
}

/// What takes a matrix of colours back, `[of][from]`; nothing where that cannot be told.
pub(super) fn back(weights: &[[f32; 3]; 3]) -> Option<[[f32; 3]; 3]> {
    let matrix = Mat3::from_cols_array_2d(weights).transpose();
    (matrix.determinant().abs() > 1e-3).then(|| matrix.inverse().transpose().to_cols_array_2d())
}

/// Standard deviation of an entry.
fn width(entry: usize) -> f32 {
    (ROOTS[0] + (ROOTS[1] - ROOTS[0]) * entry as f32 / (WIDTHS - 1) as f32).powi(2)
}

/// Between two entries.
fn at_width(of: &ByWidth, width: f32) -> f32 {
    let at = ((width.sqrt() - ROOTS[0]) / (ROOTS[1] - ROOTS[0])).clamp(0.0, 1.0) * (WIDTHS - 1) as f32;
    let i = place(at).min(WIDTHS - 2);
    let f = at - i as f32;
    of[i] * (1.0 - f) + of[i + 1] * f
}

/// What noise about an encoded value adds to the mean, over its width, and the variance of what is delivered, over
/// its variance.
fn bent(encoded: impl Fn(f32) -> f32, value: f32) -> [ByWidth; 2] {
    let own = encoded(value);
    let mut out = [[0.0; WIDTHS]; 2];
    for w in 0..WIDTHS {
        let sigma = width(w);
        let (mut total, mut mean, mut square) = (0.0, 0.0, 0.0);
        for k in -POINTS..=POINTS {
            let away = STEP * k as f32;
            let weight = (-0.5 * away * away).exp();
            let off = encoded(value + away * sigma) - own;
            (total, mean, square) = (total + weight, mean + weight * off, square + weight * off * off);
        }
        (mean, square) = (mean / total, square / total);
        out[0][w] = mean / sigma;
        out[1][w] = (square - mean * mean).max(0.0) / (sigma * sigma);
    }
    out
}
