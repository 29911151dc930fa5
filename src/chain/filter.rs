//! Filters that are alike in all places, and what several of them together leave of noise.

use super::mixing::{BANDS, DISTANCES, Left, Mixing};
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
        let one = block([1, 1]);
        let singles = self.products(|a, b, _| sums(a, b, [&one, &one]));
        let pixel = self.channels(spread, &singles);
        let bands = BANDS.map(|n| {
            // White noise leaves 1/n^2 in a block and a quarter of it in the larger one.
            let white = 0.75 / (n * n) as f64;
            self.channels(spread, &self.products(|a, b, _| off_block(a, b, n))).map(|v| v / white)
        });
        let lines =
            [true, false].map(|row| self.channels(spread, &self.products(|a, b, _| of_line(a, b, row))));
        // White noise leaves 1.5 of its variance.
        let apart = DISTANCES.map(beside);
        let apart =
            apart.each_ref().map(|t| self.products(|a, b, _| sums(a, b, [t, t]).map(|l| l.map(|v| v / 1.5))));
        let high_pass = apart.each_ref().map(|products| self.channels(spread, products));
        let left = [0, 1, 2].map(|c| {
            let share = |of: &[f64; 3]| (of[c] / pixel[c]) as f32;
            Left {
                pixel: 1.0,
                steady: 1.0,
                high_pass: high_pass.each_ref().map(share),
                bands: bands.each_ref().map(share),
                lines: lines.each_ref().map(share),
            }
        });
        let brightness = LUMA.map(f64::from);
        let white: f64 = brightness.iter().map(|w| w * w).sum();
        let luma = |products: &Products<Table>| {
            (together(products, [&brightness; 2], |product, colours| over(product, spread, colours)) / white)
                as f32
        };
        let luma = [luma(&singles), luma(&apart[0]), luma(&apart[1])];
        let rows = self.products(|a, b, _| of_rows(a, b));
        let row = [0, 1, 2].map(|c| over_rows(spread, &rows, &only(c)) as f32);
        // The mean over a row has no columns, and is that over its colours. It is held against others as far away.
        let [far, _] = beside(DISTANCES[1]);
        let means = self.products(|a, b, _| of_row_means(a, b, &far));
        let row_seen = (over_rows(spread, &means, &[1.0 / 3.0; 3]) / 1.5) as f32;
        Mixing { pixel: pixel.map(|v| v as f32), row, row_seen, left, luma, shared: None }
    }

    /// What two mixtures of the channels have in common in a pixel, where blocks of so many columns and rows share the
    /// colours' differences to luma behind it.
    pub(super) fn in_common(&self, spread: &Spread, size: [usize; 2], mixtures: [&[f64; 3]; 2]) -> f64 {
        // A pixel has its own luma, and the mean over its block of the rest.
        let [own, mean] = [block([1, 1]), block(size)];
        let of = |shared: bool| if shared { &mean } else { &own };
        let products = self.products(|a, b, shared| sums(a, b, shared.map(of)));
        together(&products, mixtures, |product, colours| over(product, spread, colours))
    }

    /// See [`super::Mixed::spectrum`].
    pub(super) fn spectrum<const N: usize>(
        &self,
        spread: &Spread,
        size: [usize; 2],
        mixture: &[f64; 3],
        waves: &[[f64; N]; N],
    ) -> Vec<f64> {
        let [rows, columns] = size.map(|of| self.along(waves, of));
        let products: [_; 3] = std::array::from_fn(|k| (&rows[k], &columns[k]));
        let one = |i: usize| {
            together(&products, [mixture; 2], |(row, column), colours| {
                let common = spread.of(colours[0], colours[1]);
                let both = row[i % N].iter().zip(&column[i / N]);
                both.map(|((factor, x), (_, y))| factor * weighed(&common, x, y)).sum()
            })
        };
        (0..N * N).map(one).collect()
    }

    /// See [`super::Mixed::row_spectrum`].
    pub(super) fn row_spectrum<const N: usize>(
        &self,
        spread: &Spread,
        size: [usize; 2],
        mixture: &[f64; 3],
        waves: &[[f64; N]; N],
    ) -> [f64; N] {
        let levels = self.products(|a, b, _| by_parity(a, b, &waves[0]));
        let columns = self.along(waves, size[1]);
        let products: [_; 3] = std::array::from_fn(|k| (&levels[k], &columns[k]));
        std::array::from_fn(|v| {
            together(&products, [mixture; 2], |(level, columns), colours| {
                let common = spread.of_rows(colours[0], colours[1]);
                let both = level.iter().zip(&columns[v]);
                let one = |([even, odd], (factor, column)): (&[f64; 2], &(f64, Reach))| {
                    let along = common.iter().zip(column).map(|(c, w)| w * (even * c[0] + odd * c[1]));
                    factor * along.sum::<f64>()
                };
                both.map(one).sum()
            })
        })
    }

    /// By wave along an axis, where so many pixels share the colours' differences to luma.
    fn along<const N: usize>(&self, waves: &[[f64; N]; N], of: usize) -> Products<Vec<Vec<(f64, Reach)>>> {
        let means = waves.map(|wave| averaged(&wave, of));
        self.products(|a, b, shared| {
            let wave = |u: usize| shared.map(|shares| if shares { &means[u][..] } else { &waves[u][..] });
            (0..N).map(|u| by_kernel(a, b, wave(u))).collect()
        })
    }

    /// `of`: of two kernels, and whether blocks share what each of them makes.
    fn products<T>(&self, of: impl Fn(&Kernels, &Kernels, [bool; 2]) -> T) -> Products<T> {
        [
            of(&self.luma, &self.luma, [false, false]),
            of(&self.luma, &self.chroma, [false, true]),
            of(&self.chroma, &self.chroma, [true, true]),
        ]
    }

    /// Variances by channel of sums whose weights have these products.
    fn channels(&self, spread: &Spread, products: &Products<Table>) -> [f64; 3] {
        [0, 1, 2]
            .map(|c| together(products, [&only(c); 2], |product, colours| over(product, spread, colours)))
    }
}

/// What noise that is spread so has in sums whose weights have these products.
fn over(products: &Table, spread: &Spread, [one, other]: [&[f64; 3]; 2]) -> f64 {
    let common = spread.of(one, other);
    products.iter().flatten().zip(common.iter().flatten()).map(|(w, v)| w * v).sum()
}

/// The same of the noise of rows in a mixture of the channels.
fn over_rows(spread: &Spread, products: &Products<[[f64; 2]; APART + 1]>, channels: &[f64; 3]) -> f64 {
    together(products, [channels; 2], |product, [one, other]| {
        let common = spread.of_rows(one, other);
        product.iter().flatten().zip(common.iter().flatten()).map(|(w, v)| w * v).sum()
    })
}

/// One channel.
pub(super) fn only(c: usize) -> [f64; 3] {
    [0, 1, 2].map(|k| f64::from(u8::from(k == c)))
}

/// What two mixtures of the channels have in common, each of which is luma and its difference to it.
fn together<T>(
    products: &Products<T>,
    mixtures: [&[f64; 3]; 2],
    of: impl Fn(&T, [&[f64; 3]; 2]) -> f64,
) -> f64 {
    let parts = mixtures.map(|channels| {
        let whole: f64 = channels.iter().sum();
        let luma = LUMA.map(|w| whole * f64::from(w));
        [luma, [0, 1, 2].map(|c| channels[c] - luma[c])]
    });
    let [[luma, chroma], [other_luma, other_chroma]] = &parts;
    of(&products[0], [luma, other_luma])
        + of(&products[1], [luma, other_chroma])
        + of(&products[1], [other_luma, chroma])
        + of(&products[2], [chroma, other_chroma])
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
fn block(size: [usize; 2]) -> Sum {
    size.map(|n| vec![1.0 / n as f64; n])
}

/// A pixel beside the mean of two others in its row, so far away.
fn beside(distance: usize) -> Sum {
    let weight = |x: usize| match x {
        x if x == distance => 1.0,
        x if x % (2 * distance) == 0 => -0.5,
        _ => 0.0,
    };
    [(0..=2 * distance).map(weight).collect(), vec![1.0]]
}

/// Weights of which each so many have their mean.
fn averaged<const N: usize>(weights: &[f64; N], of: usize) -> [f64; N] {
    std::array::from_fn(|i| weights[i / of * of..(i / of + 1) * of].iter().sum::<f64>() / of as f64)
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

/// By distance.
type Reach = [f64; APART + 1];

/// By pair of kernels: its factor, and products of two lists of weights, each behind its kernel.
fn by_kernel(a: &Kernels, b: &Kernels, [s, t]: [&[f64]; 2]) -> Vec<(f64, Reach)> {
    let of = |(factor, x, y): (f64, &Vec<f64>, &Vec<f64>)| {
        let all = products(&softened(s, x), &softened(t, y), [middle(x), middle(y)], APART as isize);
        (factor, folded(&all))
    };
    pairs(a, b).map(of).collect()
}

/// By pair of kernels: products at all even and at all odd distances.
fn by_parity(a: &Kernels, b: &Kernels, s: &[f64]) -> Vec<[f64; 2]> {
    let of = |(_, x, y): (f64, &Vec<f64>, &Vec<f64>)| {
        let most = (x.len() + y.len() + 2 * s.len()) as isize;
        let all = products(&softened(s, x), &softened(s, y), [middle(x), middle(y)], most);
        let mut sums = [0.0; 2];
        (-most..=most).zip(all).for_each(|(d, v)| sums[d.rem_euclid(2) as usize] += v);
        sums
    };
    pairs(a, b).map(of).collect()
}

fn weighed(common: &Table, row: &Reach, column: &Reach) -> f64 {
    let along = |line: &Reach| line.iter().zip(row).map(|(c, w)| c * w).sum::<f64>();
    common.iter().zip(column).map(|(line, w)| w * along(line)).sum()
}

/// Products of the weights of two sums, each over what a filter makes, by distance along a column and along a row.
fn sums(a: &Kernels, b: &Kernels, [s, t]: [&Sum; 2]) -> Table {
    let mut out = Table::default();
    let along = |axis: usize| by_kernel(a, b, [&s[axis], &t[axis]]);
    for ((factor, row), (_, column)) in along(0).into_iter().zip(along(1)) {
        for (dy, dx) in (0..=APART).flat_map(|dy| (0..=APART).map(move |dx| (dy, dx))) {
            out[dy][dx] += factor * column[dy] * row[dx];
        }
    }
    out
}

/// The same of the mean of a block less that of the larger block that it begins.
fn off_block(a: &Kernels, b: &Kernels, side: usize) -> Table {
    let [small, large] = [side, 2 * side].map(|n| block([n, n]));
    let mut out = Table::default();
    for (sign, s, t) in
        [(1.0, &small, &small), (-1.0, &small, &large), (-1.0, &large, &small), (1.0, &large, &large)]
    {
        let more = sums(a, b, [s, t]);
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
    for (across, (factor, column)) in by_parity(a, b, &[1.0]).into_iter().zip(by_kernel(a, b, [&[1.0]; 2])) {
        (0..=APART).for_each(|dy| (0..2).for_each(|k| out[dy][k] += factor * column[dy] * across[k]));
    }
    out
}

/// The same of the means of long rows, with these weights.
fn of_row_means(a: &Kernels, b: &Kernels, weights: &[f64]) -> [[f64; 2]; APART + 1] {
    let mut out = [[0.0; 2]; APART + 1];
    for ((factor, x, y), (_, column)) in pairs(a, b).zip(by_kernel(a, b, [weights; 2])) {
        let whole = x.iter().sum::<f64>() * y.iter().sum::<f64>();
        (0..=APART).for_each(|dy| out[dy] = out[dy].map(|o| o + 0.5 * factor * whole * column[dy]));
    }
    out
}
