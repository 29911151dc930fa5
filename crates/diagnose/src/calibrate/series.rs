//! What more than two frames, or edges, tell: the temporal spectrum, the sensor's fixed pattern, the edge part of the
//! paper's noise.

use serde::Serialize;

use super::filter::{gaussian, masked_mean};
use super::frames::{Encoding, Frame};
use super::own::beyond;
use super::ptc::{Estimate, PtcFit};
use super::statics::{AlignedPair, LOCAL_MEAN_RADIUS_PX, MAX_CONTAMINATION};
use shutterbug::plane::Plane;

/// Correlation and spectrum over time, mean over pixels and channels.
#[derive(Clone, Debug, Serialize)]
pub struct Temporal {
    /// Correlation of a pixel's noise with its own, 1, 2, ... frames later (bias of the mean over few frames removed).
    pub correlation: Vec<f64>,
    /// Power at the frequencies `k / N` cycles a frame, k = 1 ..= N/2; 1 everywhere for white noise.
    pub spectrum: Vec<f64>,
    /// Variance of the noise between frames that follow each other over that between frames at least half of all apart:
    /// 1 for white noise, less where frames share noise.
    pub near_over_far: Estimate,
}

/// How often frames may be said to share noise that have none in common.
const ALPHA: f64 = 0.01;

impl Temporal {
    /// Whether frames that follow each other share noise: more than chance, and than a displacement that stays unseen
    /// between those further apart, makes it look.
    pub fn is_shared(&self) -> bool {
        let deviation = (self.near_over_far.ci95[1] - self.near_over_far.value) / 1.96;
        let unseen = 1.0 + MAX_CONTAMINATION * MAX_CONTAMINATION;
        (self.near_over_far.value + beyond(ALPHA) * deviation) * unseen < 1.0
    }
}

/// Temporal statistics of more than two frames that need no alignment; `None` otherwise. `effective`: pixels that act
/// as one in the estimate of a variance.
pub fn temporal(frames: &[Frame], usable: &[bool], effective: f64) -> Option<Temporal> {
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
    let near_over_far = near_over_far(frames, usable, &level, effective);
    Some(Temporal { correlation, spectrum: power.iter().map(|p| p / mean_power).collect(), near_over_far })
}

/// See [`Temporal::near_over_far`]; `level`: the mean of each frame.
fn near_over_far(frames: &[Frame], usable: &[bool], level: &[f64], effective: f64) -> Estimate {
    let squares = |lag: usize| {
        let mut sums = vec![0.0f64; usable.len()];
        for t in lag..frames.len() {
            let (a, b) = (&frames[t - lag].encoded, &frames[t].encoded);
            // Another exposure is no noise, and no light that drifts slowly over the picture.
            let scale = (level[t - lag] / level[t].max(1e-9)) as f32;
            let data = (0..usable.len()).map(|i| scale * b.data[3 * i + 1] - a.data[3 * i + 1]).collect();
            let d = Plane { width: a.width, height: a.height, channels: 1, data };
            let local = masked_mean(&d, usable, LOCAL_MEAN_RADIUS_PX);
            let own = d.data.iter().zip(&local.data).map(|(v, m)| f64::from(v - m));
            sums.iter_mut().zip(own).for_each(|(s, v)| *s += v * v);
        }
        let count = (frames.len() - lag) as f64;
        sums.iter_mut().for_each(|s| *s /= count);
        sums
    };
    let (near, far) = (squares(1), squares(frames.len().div_ceil(2)));
    let used = || (0..usable.len()).filter(|i| usable[*i]);
    let [sum_near, sum_far] = [&near, &far].map(|v| used().map(|i| v[i]).sum::<f64>().max(1e-300));
    let value = sum_near / sum_far;
    let rest: f64 = used().map(|i| (near[i] - value * far[i]).powi(2)).sum();
    let half = 1.96 * (rest * effective.max(1.0)).sqrt() / sum_far;
    Estimate { value, ci95: [value - half, value + half] }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::model::{CameraModel, IspCamera};

    /// Frames of a video of which each is that share of the one before, after some that nobody kept.
    fn video(kept: f32, count: usize, drift: f32) -> Vec<Frame> {
        let camera = IspCamera::sensor(3000.0, 0.004, true, 0.0);
        let clean = Plane::from_fn(192, 160, |x, y| {
            let wave = 0.1 * (0.2 * x as f32 + 0.05 * y as f32).sin();
            [0.3 + wave, 0.35 + wave, 0.2 + 0.5 * wave]
        });
        let mut seen: Option<Plane<f32>> = None;
        let mut frames = Vec::new();
        for k in 0..count + 12 {
            let light = |i: usize, v: f32| {
                let x = (i / 3 % 192) as f32 / 192.0;
                v * (1.0 + drift * k as f32 * (0.5 + x))
            };
            let data = clean.data.iter().enumerate().map(|(i, v)| light(i, *v)).collect();
            let mut new = camera.frame(&Plane { data, ..clean }, k as u32, 9).expect("a frame");
            if let Some(last) = &seen {
                new.data.iter_mut().zip(&last.data).for_each(|(v, l)| *v = kept * l + (1.0 - kept) * *v);
            }
            seen = Some(new.clone());
            if k >= 12 {
                frames.push(Frame::from_plane(&format!("frame {k}"), new, 0.0));
            }
        }
        frames
    }

    #[test]
    fn frames_that_share_noise_are_told_from_those_that_do_not() {
        let usable = vec![true; 192 * 160];
        let shared = |kept: f32, count: usize, drift: f32| {
            let found = temporal(&video(kept, count, drift), &usable, 1.0).expect("three frames");
            (found.is_shared(), found.near_over_far)
        };
        for (kept, count) in [(0.6, 3), (0.6, 4), (0.3, 4), (0.6, 9)] {
            let (is, ratio) = shared(kept, count, 0.0);
            // The variance of differences of frames so far apart.
            let [near, far] = [1, count.div_ceil(2)].map(|lag| f64::from(1.0 - kept.powi(lag as i32)));
            assert!(is && (ratio.value / (near / far) - 1.0).abs() < 0.03, "{kept} {count}: {ratio:?}");
        }
        // Controls: white noise, and a lamp that gets warm.
        for (count, drift) in [(3, 0.0), (4, 0.0), (9, 0.0), (6, 0.002)] {
            let (is, ratio) = shared(0.0, count, drift);
            assert!(!is && (ratio.value - 1.0).abs() < 0.03, "{count} {drift}: {ratio:?}");
        }
    }
}
