//! Covariance of the three channels in cells of similar colour: what the noise of an ISP depends on, since its colour
//! matrix mixes the sensor's channels. The fit works on these; the curves per channel are what it is judged by.

use std::collections::HashMap;

use super::spatial::LAGS;
use shutterbug::plane::Plane;

/// Width of a cell, as a share of full scale.
const CELLS_A_SIDE: f32 = 16.0;
/// Fewer pixels than this give no cell.
const MIN_CELL_PX: f64 = 1_500.0;

/// Noise of one colour. Encoded values, 0 to 1.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Pixels.
    pub count: f64,
    /// Mean colour.
    pub mean: [f64; 3],
    /// Variances of R, G, B, then covariances RG, GB, RB, of one frame.
    pub covariance: [f64; 6],
    /// Autocovariance of R, G, B at [`LAGS`], of one frame.
    pub lagged: [[f64; 6]; 3],
}

impl Cell {
    /// Variance of a channel.
    pub fn variance(&self, channel: usize) -> f64 {
        self.covariance[channel]
    }
}

/// Pairs of channels in the order of [`Cell::covariance`].
pub const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)];

#[derive(Clone, Default)]
struct Sums {
    count: f64,
    mean: [f64; 3],
    difference: [f64; 3],
    products: [f64; 6],
    lagged: [[f64; 6]; 3],
    lag_counts: [f64; 6],
}

/// The cell of a colour; cells keep their key between pictures.
pub type Key = [u8; 3];

/// Cells of all usable pixels that are clear of black and white by four sigma, by colour.
pub fn cells(mean: &Plane<f32>, d: &Plane<f32>, usable: &[bool]) -> HashMap<Key, Cell> {
    let (width, height) = (mean.width, mean.height);
    let mut all: HashMap<Key, Sums> = HashMap::new();
    for i in (0..usable.len()).filter(|i| usable[*i]) {
        let (x, y) = (i % width, i / width);
        let colour: [f32; 3] = std::array::from_fn(|c| mean.data[i * 3 + c]);
        let key = colour.map(|v| (v * CELLS_A_SIDE).min(CELLS_A_SIDE - 1.0) as u8);
        let sums = all.entry(key).or_default();
        let here: [f64; 3] = std::array::from_fn(|c| f64::from(d.data[i * 3 + c]));
        sums.count += 1.0;
        for c in 0..3 {
            sums.mean[c] += f64::from(colour[c]);
            sums.difference[c] += here[c];
        }
        for (sum, (a, b)) in sums.products.iter_mut().zip(PAIRS) {
            *sum += here[a] * here[b];
        }
        for (k, (lx, ly)) in LAGS.into_iter().enumerate() {
            let j = i + ly * width + lx;
            if x + lx < width && y + ly < height && usable[j] {
                sums.lag_counts[k] += 1.0;
                for c in 0..3 {
                    sums.lagged[c][k] += here[c] * f64::from(d.data[j * 3 + c]);
                }
            }
        }
    }
    let finish = |s: Sums| {
        let n = s.count;
        let offset = s.difference.map(|d| d / n);
        let mut covariance = [0.0; 6];
        for (k, (a, b)) in PAIRS.into_iter().enumerate() {
            covariance[k] = 0.5 * (s.products[k] / n - offset[a] * offset[b]);
        }
        let mut lagged = [[0.0; 6]; 3];
        for c in 0..3 {
            for k in 0..LAGS.len() {
                lagged[c][k] = 0.5 * (s.lagged[c][k] / s.lag_counts[k].max(1.0) - offset[c] * offset[c]);
            }
        }
        Cell { count: n, mean: s.mean.map(|m| m / n), covariance, lagged }
    };
    all.into_iter()
        .filter(|(_, s)| s.count >= MIN_CELL_PX)
        .map(|(key, s)| (key, finish(s)))
        .filter(|(_, cell)| {
            (0..3).all(|c| {
                let reach = 4.0 * cell.variance(c).sqrt();
                reach > 0.0 && cell.mean[c] > reach && cell.mean[c] + reach < 1.0
            })
        })
        .collect()
}
