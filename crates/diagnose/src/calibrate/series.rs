//! What more than two frames, or edges, tell: the temporal spectrum, the sensor's fixed pattern, the edge part of the
//! paper's noise.

use serde::Serialize;

use super::filter::{gaussian, masked_mean};
use super::frames::{Encoding, Frame};
use super::ptc::{Estimate, PtcFit};
use super::statics::AlignedPair;
use shutterbug::plane::Plane;

/// Correlation and spectrum over time, mean over pixels and channels.
#[derive(Clone, Debug, Serialize)]
pub struct Temporal {
    /// Correlation of a pixel's noise with its own, 1, 2, ... frames later (bias of the mean over few frames removed).
    pub correlation: Vec<f64>,
    /// Power at the frequencies `k / N` cycles a frame, k = 1 ..= N/2; 1 everywhere for white noise.
    pub spectrum: Vec<f64>,
}

/// Temporal statistics of more than two frames that need no alignment; `None` otherwise.
pub fn temporal(frames: &[Frame], usable: &[bool]) -> Option<Temporal> {
    let n = frames.len();
    if n < 3 {
        return None;
    }
    // Brightness changes of whole frames are no noise of pixels: each frame's mean is taken off.
    let level: Vec<f64> = frames
        .iter()
        .map(|f| {
            let used = usable
                .iter()
                .enumerate()
                .filter(|(_, u)| **u)
                .map(|(i, _)| f64::from(f.encoded.data[i * 3 + 1]));
            let (count, sum) = used.fold((0.0, 0.0), |(n, s), v| (n + 1.0, s + v));
            sum / f64::max(count, 1.0)
        })
        .collect();
    let mut covariance = vec![0.0; n];
    let mut power = vec![0.0; n / 2];
    for i in (0..usable.len()).filter(|i| usable[*i]) {
        let mut series: Vec<f64> =
            (0..n).map(|t| f64::from(frames[t].encoded.data[i * 3 + 1]) - level[t]).collect();
        let mean = series.iter().sum::<f64>() / n as f64;
        series.iter_mut().for_each(|v| *v -= mean);
        for (lag, sum) in covariance.iter_mut().enumerate() {
            *sum += (lag..n).map(|t| series[t] * series[t - lag]).sum::<f64>() / (n - lag) as f64;
        }
        for (k, sum) in power.iter_mut().enumerate() {
            let angle = std::f64::consts::TAU * (k + 1) as f64 / n as f64;
            let (re, im) = series.iter().enumerate().fold((0.0, 0.0), |(re, im), (t, v)| {
                (re + v * (angle * t as f64).cos(), im + v * (angle * t as f64).sin())
            });
            *sum += re * re + im * im;
        }
    }
    // White noise less its own mean has covariance -1/N at every lag, and 1 - 1/N at none.
    let white = covariance[0] / (1.0 - 1.0 / n as f64);
    let correlation = covariance[1..n.min(9)].iter().map(|c| c / white + 1.0 / n as f64).collect();
    let mean_power = power.iter().sum::<f64>() / power.len() as f64;
    Some(Temporal { correlation, spectrum: power.iter().map(|p| p / mean_power).collect() })
}

/// Variance of the pattern that stays, per channel, in linear values: what the mean of all frames varies by around its
/// neighbours, less what temporal noise leaves in it. Texture of the scene is in it too, so without a flat field it is
/// an upper bound.
pub fn static_variance(frames: &[Frame], usable: &[bool], encoding: Encoding) -> Option<[f64; 3]> {
    let n = frames.len();
    if n < 3 {
        return None;
    }
    let (width, height) = (frames[0].encoded.width, frames[0].encoded.height);
    let mut mean = Plane::<f32>::new(width, height, 3);
    let mut temporal = [0.0f64; 3];
    for i in 0..mean.data.len() {
        let values = frames.iter().map(|f| f64::from(encoding.decode(f.encoded.data[i])));
        let (sum, squares) = values.fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
        mean.data[i] = (sum / n as f64) as f32;
        if usable[i / 3] {
            temporal[i % 3] += (squares - sum * sum / n as f64) / (n as f64 - 1.0);
        }
    }
    let near = masked_mean(&mean, usable, 3);
    let count = usable.iter().filter(|u| **u).count() as f64;
    Some([0, 1, 2].map(|c| {
        let spread: f64 = (0..usable.len())
            .filter(|i| usable[*i])
            .map(|i| f64::from(mean.data[i * 3 + c] - near.data[i * 3 + c]).powi(2))
            .sum();
        // The 7 x 7 mean holds 1/49 of the pixel itself.
        (spread / count / (1.0 - 1.0 / 49.0) - temporal[c] / count / n as f64).max(0.0)
    }))
}

/// Variance beyond the photon transfer curve per squared gradient (full scale a px), per channel: the paper's edge
/// noise. `None` for displaced frames, whose edges differ for another reason. A displacement of s px that stayed
/// unseen adds s^2 / 4.
pub fn edge_variance(
    pair: &AlignedPair,
    fits: &[Option<PtcFit>; 3],
    encoding: Encoding,
) -> Option<[Estimate; 3]> {
    if pair.registration.moved {
        return None;
    }
    let d = pair.difference(|v| encoding.decode(v));
    let mut mean = pair.mean();
    mean.data.iter_mut().for_each(|v| *v = encoding.decode(*v));
    let smooth = gaussian(&mean, 1.0);
    let width = mean.width;
    let mut out = [Estimate::default(); 3];
    for (c, fit) in fits.iter().enumerate() {
        let fit = fit.as_ref()?;
        let (mut xy, mut xx, mut xxyy) = (0.0f64, 0.0f64, 0.0f64);
        let (mut n, mut sum_x, mut sum_y) = (0.0f64, 0.0f64, 0.0f64);
        for y in 1..mean.height - 1 {
            for x in (1..width - 1).filter(|x| pair.usable[y * width + x]) {
                let at = |x: usize, y: usize| f64::from(smooth.data[(y * width + x) * 3 + c]);
                let level = at(x, y);
                if !(0.02..0.9).contains(&level) {
                    continue;
                }
                let square = (0.25 * (at(x + 1, y) - at(x - 1, y)).powi(2))
                    + 0.25 * (at(x, y + 1) - at(x, y - 1)).powi(2);
                let expected = (fit.intercept.value + fit.slope.value * level).max(1e-12);
                let extra = 0.5 * f64::from(d.data[(y * width + x) * 3 + c]).powi(2) - expected;
                // Variances of bright pixels scatter more.
                let weight = 1.0 / (expected * expected);
                (xy, xx, n) = (xy + weight * square * extra, xx + weight * square * square, n + weight);
                (sum_x, sum_y) = (sum_x + weight * square, sum_y + weight * extra);
                xxyy += (weight * square * extra).powi(2);
            }
        }
        let energy = xx - sum_x * sum_x / n.max(1e-300);
        let slope = if energy > 0.0 { (xy - sum_x * sum_y / n) / energy } else { 0.0 };
        let half = if energy > 0.0 { 1.96 * xxyy.sqrt() / energy } else { f64::INFINITY };
        out[c] = Estimate { value: slope.max(0.0), ci95: [slope - half, slope + half] };
    }
    Some(out)
}
