//! Filters that are alike in all places, and what several of them together leave of noise.

use super::mixing::{BANDS, Left, Mixing};
use super::spread::{APART, Spread, Table};
use crate::plane::stats::LUMA;

/// A sum of kernels, each the product of the same weights along either axis: a factor, and weights about their middle.
type Kernels = Vec<(f64, Vec<f64>)>;

/// A filter of luma and of the colours' differences to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    luma: Kernels,
    chroma: Kernels,
}

/// A weighted sum over pixels: weights along a row and along a column.
type Sum = [Vec<f64>; 2];

/// Products of the weights of two sums behind filters, of luma with itself, with chroma, and of chroma with itself.
type Products<T> = [T; 3];

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

    /// What it leaves of noise that has as much in each colour ahead of what spreads it.
    pub fn mixing(&self, spread: &Spread) -> Mixing {
        let pixel = self.channels(spread, &self.products(|a, b| sums(a, b, &[block(1, 1), block(1, 1)])));
        let bands = BANDS.map(|n| {
            // White noise leaves 1/n^2 in a block and a quarter of it in the larger one.
            let white = 0.75 / (n * n) as f64;
            self.channels(spread, &self.products(|a, b| off_block(a, b, n))).map(|v| v / white)
        });
        let lines = [true, false].map(|row| self.channels(spread, &self.products(|a, b| of_line(a, b, row))));
        let left = [0, 1, 2].map(|c| {
            let share = |of: &[f64; 3]| (of[c] / pixel[c]) as f32;
            Left { bands: bands.each_ref().map(share), lines: lines.each_ref().map(share), ..Left::ALL }
        });
        let rows = self.products(of_rows);
        let row = [0, 1, 2].map(|c| self.row(spread, &rows, &only(c)) as f32);
        // The mean over a row has no columns, and is that over its colours.
        let means = self.products(|a, b| of_row_means(a, b));
        let row_seen = self.row(spread, &means, &[1.0 / 3.0; 3]) as f32;
        Mixing { pixel: pixel.map(|v| v as f32), row, row_seen, left, shared: None }
    }

    /// Variance of single pixels, by channel, where blocks of so many columns and rows share the colours' differences to
    /// luma behind it.
    pub(super) fn sharing(&self, spread: &Spread, [columns, rows]: [usize; 2]) -> [f64; 3] {
        // A pixel has its own luma. What that and the block's mean have in common is, over the block's pixels on average,
        // what two means have.
        let [own, mean] = [block(1, 1), block(columns, rows)];
        let luma = sums(&self.luma, &self.luma, &[own.clone(), own]);
        let both = sums(&self.luma, &self.chroma, &[mean.clone(), mean.clone()]);
        let chroma = sums(&self.chroma, &self.chroma, &[mean.clone(), mean]);
        self.channels(spread, &[luma, both, chroma])
    }

    fn products<T>(&self, of: impl Fn(&Kernels, &Kernels) -> T) -> Products<T> {
        [of(&self.luma, &self.luma), of(&self.luma, &self.chroma), of(&self.chroma, &self.chroma)]
    }

    /// Variances by channel of sums whose weights have these products.
    fn channels(&self, spread: &Spread, products: &Products<Table>) -> [f64; 3] {
        [0, 1, 2].map(|c| {
            let of = |product: &Table, [one, other]: [&[f64; 3]; 2]| {
                let common = spread.of(one, other);
                product.iter().flatten().zip(common.iter().flatten()).map(|(w, v)| w * v).sum()
            };
            together(products, &only(c), of)
        })
    }

    /// The same of the noise of rows in a mixture of the channels.
    fn row(&self, spread: &Spread, products: &Products<[[f64; 2]; APART + 1]>, channels: &[f64; 3]) -> f64 {
        let of = |product: &[[f64; 2]; APART + 1], [one, other]: [&[f64; 3]; 2]| {
            let common = spread.of_rows(one, other);
            product.iter().flatten().zip(common.iter().flatten()).map(|(w, v)| w * v).sum()
        };
        together(products, channels, of)
    }
}

/// One channel.
fn only(c: usize) -> [f64; 3] {
    [0, 1, 2].map(|k| f64::from(u8::from(k == c)))
}

/// Variance of a mixture of the channels, each of which is luma and its difference to it.
fn together<T>(products: &Products<T>, channels: &[f64; 3], of: impl Fn(&T, [&[f64; 3]; 2]) -> f64) -> f64 {
    let luma = LUMA.map(f64::from);
    let whole: f64 = channels.iter().sum();
    let luma = luma.map(|w| whole * w);
    let chroma = [0, 1, 2].map(|c| channels[c] - luma[c]);
    of(&products[0], [&luma, &luma])
        + 2.0 * of(&products[1], [&luma, &chroma])
        + of(&products[2], [&chroma, &chroma])
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

/// The mean over a block of so many columns and rows.
fn block(columns: usize, rows: usize) -> Sum {
    [columns, rows].map(|n| vec![1.0 / n as f64; n])
}

/// Sums of products of two lists of weights at a distance from minus to plus `most`, which begin so far from the middle
/// of their kernels' own place.
fn products(a: &[f64], b: &[f64], [from_a, from_b]: [isize; 2], most: isize) -> Vec<f64> {
    let at = |d: isize| {
        // Value i of a lies at i - from_a, and meets value i - from_a + d + from_b of b.
        let value = |(i, v): (usize, &f64)| {
            let j = i as isize - from_a + d + from_b;
            usize::try_from(j).ok().and_then(|j| b.get(j)).map_or(0.0, |w| v * w)
        };
        a.iter().enumerate().map(value).sum()
    };
    (-most..=most).map(at).collect()
}

/// By the distance's size.
fn folded(products: &[f64]) -> [f64; APART + 1] {
    let middle = products.len() / 2;
    std::array::from_fn(
        |d| if d == 0 { products[middle] } else { products[middle - d] + products[middle + d] },
    )
}

/// Middle of a kernel.
fn middle(weights: &[f64]) -> isize {
    (weights.len() / 2) as isize
}

fn pairs<'a>(a: &'a Kernels, b: &'a Kernels) -> impl Iterator<Item = (f64, &'a Vec<f64>, &'a Vec<f64>)> {
    a.iter().flat_map(move |x| b.iter().map(move |y| (x.0 * y.0, &x.1, &y.1)))
}

/// Products of the weights of two sums, each over what a filter makes, by distance along a column and along a row.
fn sums(a: &Kernels, b: &Kernels, [s, t]: &[Sum; 2]) -> Table {
    let mut out = Table::default();
    for (factor, x, y) in pairs(a, b) {
        let along = |axis: usize| {
            let (x_all, y_all) = (softened(&s[axis], x), softened(&t[axis], y));
            folded(&products(&x_all, &y_all, [middle(x), middle(y)], APART as isize))
        };
        let [row, column] = [along(0), along(1)];
        for (dy, dx) in (0..=APART).flat_map(|dy| (0..=APART).map(move |dx| (dy, dx))) {
            out[dy][dx] += factor * column[dy] * row[dx];
        }
    }
    out
}

/// The same of the mean of a block less that of the larger block that it begins.
fn off_block(a: &Kernels, b: &Kernels, side: usize) -> Table {
    let [small, large] = [block(side, side), block(2 * side, 2 * side)];
    let mut out = Table::default();
    for (sign, s, t) in
        [(1.0, &small, &small), (-1.0, &small, &large), (-1.0, &large, &small), (1.0, &large, &large)]
    {
        let more = sums(a, b, &[s.clone(), t.clone()]);
        out.iter_mut().flatten().zip(more.iter().flatten()).for_each(|(o, m)| *o += sign * m);
    }
    out
}

/// The same of the mean of a long row, or column, times its length.
fn of_line(a: &Kernels, b: &Kernels, row: bool) -> Table {
    let mut out = Table::default();
    for (factor, x, y) in pairs(a, b) {
        let whole = x.iter().sum::<f64>() * y.iter().sum::<f64>();
        let across = folded(&products(x, y, [middle(x), middle(y)], APART as isize));
        for (far, near) in (0..=APART).flat_map(|far| (0..=APART).map(move |near| (far, near))) {
            // What lies along the line is there on either side.
            let weight = factor * whole * across[far] * if near == 0 { 1.0 } else { 2.0 };
            let [dy, dx] = if row { [far, near] } else { [near, far] };
            out[dy][dx] += weight;
        }
    }
    out
}

/// The same of single pixels, by distance along a column and whether columns lie an odd number apart.
fn of_rows(a: &Kernels, b: &Kernels) -> [[f64; 2]; APART + 1] {
    let mut out = [[0.0; 2]; APART + 1];
    for (factor, x, y) in pairs(a, b) {
        let most = (x.len() + y.len()) as isize;
        let row = products(x, y, [middle(x), middle(y)], most);
        let column = folded(&products(x, y, [middle(x), middle(y)], APART as isize));
        for (i, weight) in row.iter().enumerate() {
            let odd = (i as isize - most).rem_euclid(2) as usize;
            (0..=APART).for_each(|dy| out[dy][odd] += factor * column[dy] * weight);
        }
    }
    out
}

/// The same of the means of long rows.
fn of_row_means(a: &Kernels, b: &Kernels) -> [[f64; 2]; APART + 1] {
    let mut out = [[0.0; 2]; APART + 1];
    for (factor, x, y) in pairs(a, b) {
        let whole = x.iter().sum::<f64>() * y.iter().sum::<f64>();
        let column = folded(&products(x, y, [middle(x), middle(y)], APART as isize));
        (0..=APART).for_each(|dy| out[dy] = out[dy].map(|o| o + 0.5 * factor * whole * column[dy]));
    }
    out
}
