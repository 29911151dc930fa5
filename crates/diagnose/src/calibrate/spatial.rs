//! How the noise of neighbouring pixels, of rows and of columns hangs together.

use serde::Serialize;

use super::ptc::Estimate;
use shutterbug::plane::{Plane, three};

/// Lags whose correlation is reported and fitted, px (x, y).
pub const LAGS: [(usize, usize); 6] = [(1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (3, 0)];
/// Furthest lag that counts into the number of pixels that act as one, px.
const REACH: i64 = 6;
/// Half side of the window that row means are compared with, rows.
const DETREND_ROWS: usize = 15;
/// Parts that a row is cut into.
const SEGMENTS: usize = 4;

/// Correlation of the noise of one channel with its neighbours'.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Correlation {
    /// One px to the right.
    pub horizontal: f64,
    /// One px down.
    pub vertical: f64,
    /// One px right and down.
    pub diagonal: f64,
    /// Two px to the right.
    pub horizontal_2: f64,
    /// Two px down.
    pub vertical_2: f64,
    /// Three px to the right.
    pub horizontal_3: f64,
    /// Sum of the squared correlations over all lags: so many pixels act as one in the estimate of a variance.
    pub effective_pixels: f64,
}

impl Correlation {
    /// In the order of [`LAGS`].
    pub fn at_lags(&self) -> [f64; 6] {
        [self.horizontal, self.vertical, self.diagonal, self.horizontal_2, self.vertical_2, self.horizontal_3]
    }
}

/// A channel of the noise over its expected sigma, so that no bright area decides alone; 0 where a pixel is not usable.
struct Standardized {
    value: Vec<f32>,
    square: Vec<f32>,
}

impl Standardized {
    fn new(d: &Plane<f32>, sigma: &Plane<f32>, usable: &[bool], channel: usize) -> Self {
        let at =
            |i: usize| if usable[i] { d.data[3 * i + channel] / sigma.data[3 * i + channel] } else { 0.0 };
        let value: Vec<f32> = (0..usable.len()).map(at).collect();
        let square = value.iter().map(|v| v * v).collect();
        Self { value, square }
    }
}

/// Sum of products; in parts, so that the compiler may take several at once.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let mut sums = [0.0f32; 16];
    let (whole_a, whole_b) = (a.chunks_exact(16), b.chunks_exact(16));
    let rest: f32 = whole_a.remainder().iter().zip(whole_b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in whole_a.zip(whole_b) {
        for k in 0..16 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().map(|s| f64::from(*s)).sum::<f64>() + f64::from(rest)
}

/// Correlation coefficient of `a` with `b` at a lag, over pairs of usable pixels (`usable`: 1 or 0).
fn coefficient(
    [a, b]: [&Standardized; 2],
    usable: &[f32],
    [width, height]: [usize; 2],
    lag: (i64, i64),
) -> f64 {
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    let across = lag.0.unsigned_abs() as usize;
    let down = usize::try_from(lag.1).expect("lags go down");
    if across >= width {
        return 0.0;
    }
    for y in 0..height.saturating_sub(down) {
        let (here, there) = (y * width, (y + down) * width);
        let (i, j) = if lag.0 >= 0 { (here, there + across) } else { (here + across, there) };
        let (i, j) = (i..i + width - across, j..j + width - across);
        xy += dot(&a.value[i.clone()], &b.value[j.clone()]);
        xx += dot(&a.square[i.clone()], &usable[j.clone()]);
        yy += dot(&usable[i], &b.square[j]);
    }
    if xx * yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}

/// Correlation with the neighbours, of each channel, and of R with G, G with B, R with B at the same pixel.
/// `sigma`: the noise expected at each pixel (shape of `d`), for standardization.
pub fn correlations(d: &Plane<f32>, sigma: &Plane<f32>, usable: &[bool]) -> ([Correlation; 3], [f64; 3]) {
    use rayon::prelude::*;
    let size = [d.width, d.height];
    let mask: Vec<f32> = usable.iter().map(|u| f32::from(u8::from(*u))).collect();
    let channels = three(|c| Standardized::new(d, sigma, usable, c));
    let own: Vec<Correlation> = (0..3)
        .into_par_iter()
        .map(|c| {
            let at = |x: i64, y: i64| coefficient([&channels[c]; 2], &mask, size, (x, y));
            let lags: Vec<(i64, i64)> = (0..=REACH)
                .flat_map(|y| (-REACH..=REACH).map(move |x| (x, y)))
                .filter(|(x, y)| *y > 0 || *x > 0)
                .collect();
            let all: Vec<f64> = lags.par_iter().map(|(x, y)| at(*x, *y)).collect();
            let of = |x: i64, y: i64| lags.iter().position(|l| *l == (x, y)).map_or(0.0, |k| all[k]);
            let count = usable.iter().filter(|u| **u).count().max(1) as f64;
            // Each estimate squared holds its own noise, about 1 / n.
            let squares: f64 = all.iter().map(|r| (r * r - 1.0 / count).max(0.0)).sum();
            Correlation {
                horizontal: of(1, 0),
                vertical: of(0, 1),
                diagonal: 0.5 * (of(1, 1) + of(-1, 1)),
                horizontal_2: of(2, 0),
                vertical_2: of(0, 2),
                horizontal_3: of(3, 0),
                effective_pixels: 1.0 + 2.0 * squares,
            }
        })
        .collect();
    let cross =
        [[0, 1], [1, 2], [0, 2]].map(|[a, b]| coefficient([&channels[a], &channels[b]], &mask, size, (0, 0)));
    ([own[0], own[1], own[2]], cross)
}

/// Noise that all pixels of a row share, per channel: root of the covariance of the means of different parts of the
/// same row, which noise of the pixels has none of. Of a single frame, in the unit of `d`.
///
/// A slow change over rows (flicker under a rolling shutter) is taken off first and is not in the figure.
pub fn row_noise(d: &Plane<f32>, usable: &[bool]) -> [Estimate; 3] {
    line_noise(d.width, d.height, |x, y| y * d.width + x, d, usable)
}

/// As [`row_noise`], of columns.
pub fn column_noise(d: &Plane<f32>, usable: &[bool]) -> [Estimate; 3] {
    line_noise(d.height, d.width, |x, y| x * d.width + y, d, usable)
}

fn line_noise(
    length: usize,
    lines: usize,
    index: impl Fn(usize, usize) -> usize,
    d: &Plane<f32>,
    usable: &[bool],
) -> [Estimate; 3] {
    three(|c| {
        // Gaps between the segments, so that correlated neighbours are in one alone.
        let segment = length / SEGMENTS;
        let means: Vec<[Option<f64>; SEGMENTS]> = (0..lines)
            .map(|line| {
                std::array::from_fn(|s| {
                    let (mut n, mut sum) = (0.0, 0.0);
                    for x in s * segment..(s + 1) * segment - (segment / 8).min(8) {
                        let i = index(x, line);
                        if usable[i] {
                            (n, sum) = (n + 1.0, sum + f64::from(d.data[i * 3 + c]));
                        }
                    }
                    // A few pixels have a mean of noise alone.
                    (n > 0.25 * segment as f64).then(|| sum / n)
                })
            })
            .collect();
        covariance_of_segments(&means)
    })
}

fn covariance_of_segments(means: &[[Option<f64>; SEGMENTS]]) -> Estimate {
    let detrended = |line: usize, s: usize| -> Option<f64> {
        let from = line.saturating_sub(DETREND_ROWS);
        let near = &means[from..(line + DETREND_ROWS + 1).min(means.len())];
        let (n, sum) = near.iter().filter_map(|m| m[s]).fold((0.0, 0.0), |(n, sum), m| (n + 1.0, sum + m));
        // The window's mean holds 1/n of the line itself.
        (n > 3.0).then(|| means[line][s].map(|m| (m - sum / n) / (1.0f64 - 1.0 / n).sqrt()))?
    };
    let mut products = Vec::new();
    for line in 0..means.len() {
        let values: Vec<f64> = (0..SEGMENTS).filter_map(|s| detrended(line, s)).collect();
        let pairs = values.len() * values.len().saturating_sub(1);
        if pairs > 0 {
            let (sum, squares) = values.iter().fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
            products.push((sum * sum - squares) / pairs as f64);
        }
    }
    let n = products.len() as f64;
    if n < 8.0 {
        return Estimate { value: 0.0, ci95: [0.0, f64::INFINITY] };
    }
    let mean = products.iter().sum::<f64>() / n;
    let sigma = (products.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    // Neighbouring lines may share noise (the ISP mixes them): the interval is widened for three that act as one.
    let half = 1.96 * 3f64.sqrt() * sigma;
    let one_frame = |covariance: f64| (0.5 * covariance).max(0.0).sqrt();
    Estimate { value: one_frame(mean), ci95: [one_frame(mean - half), one_frame(mean + half)] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_normal;

    fn white(width: usize, height: usize, row_sigma: f32, column_sigma: f32) -> Plane<f32> {
        Plane::from_fn(width, height, |x, y| {
            let n = random_normal([x as u32, y as u32], 0, 1, [3, 4]);
            let row = random_normal([0, y as u32], 0, 2, [3, 4])[0];
            let column = random_normal([x as u32, 0], 0, 3, [3, 4])[0];
            // The difference of two frames has the root of two.
            [0, 1, 2].map(|c| std::f32::consts::SQRT_2 * (n[c] + row_sigma * row + column_sigma * column))
        })
    }

    #[test]
    fn row_and_column_noise_are_told_apart() {
        let usable = vec![true; 400 * 400];
        for (row, column) in [(0.3, 0.0), (0.0, 0.3), (0.0, 0.0)] {
            let d = white(400, 400, row, column);
            let (rows, columns) = (row_noise(&d, &usable), column_noise(&d, &usable));
            for c in 0..3 {
                assert!(rows[c].covers(f64::from(row)), "rows {row}: {:?}", rows[c]);
                assert!(columns[c].covers(f64::from(column)), "columns {column}: {:?}", columns[c]);
            }
        }
        // Control: the interval of one that is there does not hold zero.
        assert!(!row_noise(&white(400, 400, 0.3, 0.0), &usable)[1].covers(0.0));
    }

    #[test]
    fn smoothing_shows_as_the_correlation_of_its_kernel() {
        let one = Plane::from_fn(300, 300, |_, _| [1.0f32; 3]);
        let usable = vec![true; 300 * 300];
        let d = white(300, 300, 0.0, 0.0);
        let (plain, cross) = correlations(&d, &one, &usable);
        assert!(plain[0].horizontal.abs() < 0.02 && cross[0].abs() < 0.02, "{plain:?}");
        assert!((plain[0].effective_pixels - 1.0).abs() < 0.02, "{plain:?}");
        let smooth = super::super::filter::gaussian(&d, 1.0);
        let (got, _) = correlations(&smooth, &one, &usable);
        // A Gaussian of sigma s has the autocorrelation exp(-lag^2 / (4 s^2)).
        for (value, squared_lag) in
            [(got[1].horizontal, 1.0), (got[1].diagonal, 2.0), (got[1].vertical_2, 4.0)]
        {
            let want = (-squared_lag / 4.0f64).exp();
            assert!((value - want).abs() < 0.03, "{value} for {want}");
        }
        // Sum of exp(-lag^2 / 2) over the plane: 2 pi.
        assert!((got[1].effective_pixels / std::f64::consts::TAU - 1.0).abs() < 0.1, "{got:?}");
    }
}
