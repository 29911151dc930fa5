//! Filters that are alike in all places, and what several of them together leave of white noise.

use super::mixing::{BANDS, Left, Mixing};
use crate::plane::stats::LUMA;

/// A sum of kernels, each the product of the same weights along either axis: a factor, and weights about their middle.
type Kernels = Vec<(f64, Vec<f64>)>;

/// A filter of luma and of the colours' differences to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    luma: Kernels,
    chroma: Kernels,
}

/// What two parts of a filtered picture have in common, over what white noise has: single pixels, the noise of rows,
/// and means over blocks.
struct Common {
    pixel: f64,
    row: f64,
    bands: [f64; 3],
}

impl Filter {
    /// None.
    pub fn none() -> Self {
        let kernels = vec![(1.0, vec![1.0])];
        Self { luma: kernels.clone(), chroma: kernels }
    }

    /// v + amount (v - soft v), with the weights of `soft` from its middle on; of luma and of chroma.
    pub fn lifted([luma, chroma]: [(f64, &[f32]); 2]) -> Self {
        let kernels = |(amount, half): (f64, &[f32])| {
            let whole = half.iter().rev().chain(&half[1..]).map(|w| f64::from(*w)).collect();
            vec![(1.0 + amount, vec![1.0]), (-amount, whole)]
        };
        Self { luma: kernels(luma), chroma: kernels(chroma) }
    }

    /// Whether nothing is changed.
    pub fn is_none(&self) -> bool {
        *self == Self::none()
    }

    /// One behind the other.
    pub fn then(&self, next: &Self) -> Self {
        Self { luma: behind(&self.luma, &next.luma), chroma: behind(&self.chroma, &next.chroma) }
    }

    /// What it leaves of white noise that has as much in each colour.
    pub fn mixing(&self) -> Mixing {
        let luma = common(&self.luma, &self.luma);
        let both = common(&self.luma, &self.chroma);
        let chroma = common(&self.chroma, &self.chroma);
        let all: f64 = LUMA.iter().map(|w| f64::from(w * w)).sum();
        // A colour is luma and its difference to it.
        let of = |c: usize, part: &dyn Fn(&Common) -> f64| {
            let w = f64::from(LUMA[c]);
            all * part(&luma) + 2.0 * (w - all) * part(&both) + (1.0 - 2.0 * w + all) * part(&chroma)
        };
        let pixel = [0, 1, 2].map(|c| of(c, &|p| p.pixel));
        let left = [0, 1, 2].map(|c| {
            let bands = [0, 1, 2].map(|i| (of(c, &|p| p.bands[i]) / pixel[c]) as f32);
            Left { bands, lines: [(of(c, &|p| p.row) / pixel[c]) as f32; 2], ..Left::ALL }
        });
        // Noise of rows is the same in all colours.
        let row = luma.row as f32;
        Mixing { pixel: pixel.map(|v| v as f32), row: [row; 3], row_seen: row, left, shared: None }
    }
}

fn behind(first: &Kernels, next: &Kernels) -> Kernels {
    let pairs = first.iter().flat_map(|a| next.iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| (a.0 * b.0, softened(&a.1, &b.1))).filter(|k| k.0 != 0.0).collect()
}

fn softened(values: &[f64], weights: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; values.len() + weights.len() - 1];
    for (i, v) in values.iter().enumerate().filter(|(_, v)| **v != 0.0) {
        weights.iter().enumerate().for_each(|(k, w)| out[i + k] += v * w);
    }
    out
}

/// The sum of products of two lists about their middles.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (short, long) = if a.len() < b.len() { (a, b) } else { (b, a) };
    let from = (long.len() - short.len()) / 2;
    short.iter().zip(&long[from..]).map(|(a, b)| a * b).sum()
}

fn common(a: &Kernels, b: &Kernels) -> Common {
    let pairs = || a.iter().flat_map(|x| b.iter().map(move |y| (x.0 * y.0, &x.1, &y.1)));
    let bands = BANDS.map(|n| {
        // White noise leaves 1/n^2 in a block and a quarter of it in the larger one.
        let white = 0.75 / (n * n) as f64;
        pairs().map(|(factor, x, y)| factor * off_block(n, x, y)).sum::<f64>() / white
    });
    Common {
        pixel: pairs().map(|(factor, x, y)| factor * dot(x, y).powi(2)).sum(),
        row: pairs().map(|(factor, x, y)| factor * dot(x, y)).sum(),
        bands,
    }
}

/// Of the mean of a block less that of the larger block that it begins, by two products of weights.
fn off_block(side: usize, x: &[f64], y: &[f64]) -> f64 {
    let reach = x.len().max(y.len());
    let mean = |n: usize, weights: &[f64]| {
        let block: Vec<f64> = (0..2 * (reach + side) + 1)
            .map(|i| if (reach..reach + n).contains(&i) { 1.0 / n as f64 } else { 0.0 })
            .collect();
        softened(&block, weights)
    };
    let (a, b) = ([mean(side, x), mean(2 * side, x)], [mean(side, y), mean(2 * side, y)]);
    let square = |i: usize, j: usize| dot(&a[i], &b[j]).powi(2);
    square(0, 0) - square(0, 1) - square(1, 0) + square(1, 1)
}
