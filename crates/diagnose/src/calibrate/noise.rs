//! Measures the noise of frames, and compares it with that of simulated ones.

use serde::Serialize;

use super::frames::{Encoding, Frame, check};
use super::model::IspCamera;
use super::ptc::{self, Bin, Estimate, PtcFit};
use super::scene::{Together, one_scene};
use super::series::Temporal;
use super::spatial::{Correlation, column_noise, correlations, row_noise};
use super::statics::{AlignedPair, Registration};
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// What is not in the frames.
#[derive(Clone, Copy, Debug)]
pub struct NoiseOptions {
    /// What the values mean.
    pub encoding: Encoding,
    /// Seed of the simulation.
    pub seed: u64,
    /// Linear value of no light, where it is known.
    pub black_level: Option<f64>,
}

/// Statistics of the noise, of real or simulated frames.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Photon transfer curves of R, G, B.
    pub curves: [Vec<Bin>; 3],
    /// The lines through them; `None` with too few bins.
    pub fits: [Option<PtcFit>; 3],
    /// Correlation with neighbours, R, G, B (encoded values).
    pub neighbours: [Correlation; 3],
    /// Correlation of R with G, G with B, R with B at the same pixel.
    pub channels: [f64; 3],
    /// Noise that rows share, R, G, B, linear, fraction of full scale.
    pub row_sigma: [Estimate; 3],
    /// The same of columns.
    pub column_sigma: [Estimate; 3],
}

/// Real against simulated.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Per channel and bin: encoded mean (0 to 255), simulated over real variance, and the 95 % half width that chance
    /// alone gives this ratio.
    pub variance_ratio: [Vec<[f64; 3]>; 3],
    /// Mean of `|ratio - 1|` over the pixels, per channel; this and the shares below are not a number (null in JSON)
    /// where no bin could be compared.
    pub mean_deviation: [f64; 3],
    /// Share of the pixels in bins within 10 %, per channel.
    pub within_10_percent: [f64; 3],
    /// Share of the pixels in bins within 10 % or within what chance gives.
    pub within_10_percent_or_chance: [f64; 3],
    /// Largest difference of the correlation with direct neighbours (horizontal, vertical, diagonal), per channel.
    pub correlation_error: [f64; 3],
}

/// Pictures for the figure: encoded values in 0 to 1.
#[derive(Clone, Debug)]
pub struct Pictures {
    /// First real frame.
    pub real: Plane<f32>,
    /// Difference of the first two real frames.
    pub real_difference: Plane<f32>,
    /// First simulated frame.
    pub simulated: Plane<f32>,
    /// Difference of two simulated frames.
    pub simulated_difference: Plane<f32>,
    /// Pixels that were used.
    pub usable: Vec<bool>,
}

/// The result.
#[derive(Clone, Debug, Serialize)]
pub struct Calibration {
    /// Files or names of the frames.
    pub frames: Vec<String>,
    /// `srgb` or `linear`.
    pub encoding: &'static str,
    /// How each pair was made comparable.
    pub registration: Vec<Registration>,
    /// Linear value of no light, which was taken off all values: given, or told by the noise; `None` = none of both.
    pub black_level: Option<Estimate>,
    /// The real frames' noise.
    pub real: Measured,
    /// The noise of frames simulated with `camera`.
    pub simulated: Measured,
    /// The two side by side.
    pub comparison: Comparison,
    /// Without the curve of the noise reduction over intensity (`camera.level_gain`): sensor, colours and smoothing
    /// alone.
    pub comparison_without_level_gain: Comparison,
    /// With that curve from every other block of 64 px, compared on the other blocks alone: what it is worth where it
    /// was not fitted. `None` where no curve was needed.
    pub comparison_held_out: Option<Comparison>,
    /// The nearest camera that the engine's chain can hold, written to camera.toml.
    pub chain_camera: IspCamera,
    /// What the chain makes with it.
    pub chain: Measured,
    /// The chain's frames beside the real ones.
    pub comparison_chain: Comparison,
    /// As `comparison_held_out`, of the chain.
    pub comparison_chain_held_out: Option<Comparison>,
    /// The fitted camera.
    pub camera: IspCamera,
    /// Variance (linear) of the paper's colour noise, R, G, B: mean over the usable pixels.
    pub color_variance: [f64; 3],
    /// The paper's static noise (an upper bound unless the scene was a flat field); needs three frames that rest.
    pub static_variance: Option<[f64; 3]>,
    /// The paper's edge noise; needs frames without displacement.
    pub edge_variance: Option<[Estimate; 3]>,
    /// Over time; needs three frames.
    pub temporal: Option<Temporal>,
    /// Columns and rows of the frames as they came, px.
    pub size_px: [usize; 2],
    /// What limits the result, in words.
    pub notes: Vec<String>,
    /// For the figure.
    #[serde(skip)]
    pub pictures: Pictures,
}

/// The measurement alone: the noise of the frames, and the pairs that it was taken from (first with second, third with
/// fourth: every frame in one pair, so that the pairs are independent; an odd last frame counts over time alone).
///
/// # Errors
/// Frames that hold no measurement ([`check`]) or no static scene ([`super::statics::align`]).
pub fn measure_noise(frames: &[Frame], encoding: Encoding) -> Result<(Measured, Vec<AlignedPair>)> {
    let (measured, pairs, _) = measure_all(frames, encoding)?;
    Ok((measured, pairs))
}

/// The same, and what all frames together are.
pub(super) fn measure_all(
    frames: &[Frame],
    encoding: Encoding,
) -> Result<(Measured, Vec<AlignedPair>, Together)> {
    check(frames)?;
    let (pairs, together) = one_scene(frames, encoding)?;
    Ok((measure(&pairs, frames[0].step, encoding), pairs, together))
}

pub(super) fn mean_variance(bins: &[Bin]) -> f64 {
    let whole = bins.iter().filter(|b| !b.cut_off);
    let (n, sum) =
        whole.fold((0.0, 0.0), |(n, s), b| (n + b.count, s + b.count * b.variance_linear.max(0.0)));
    if n > 0.0 { sum / n } else { 0.0 }
}

/// All statistics of aligned pairs.
pub(super) fn measure(pairs: &[AlignedPair], step: f32, encoding: Encoding) -> Measured {
    let curves = ptc::curves(pairs, step, encoding);
    let first = &pairs[0];
    let encoded = first.difference(|v| v);
    let (sigma, whole) = expected_sigma(&first.mean(), &curves, &first.usable);
    let (neighbours, channels) = correlations(&encoded, &sigma, &whole);
    let linear = first.difference(|v| encoding.decode(v));
    let fits = [0, 1, 2].map(|c| ptc::fit(&curves[c], neighbours[c].effective_pixels));
    Measured {
        fits,
        row_sigma: row_noise(&linear, &first.usable),
        column_sigma: column_noise(&linear, &first.usable),
        curves,
        neighbours,
        channels,
    }
}

/// Sigma of the difference at each pixel by its bin, and the pixels where no channel's noise is cut off.
pub(super) fn expected_sigma(
    mean: &Plane<f32>,
    curves: &[Vec<Bin>; 3],
    usable: &[bool],
) -> (Plane<f32>, Vec<bool>) {
    let tables: [Vec<Option<f32>>; 3] = curves.each_ref().map(|bins| {
        let mut table = vec![None; ptc::BINS];
        for b in bins.iter().filter(|b| !b.cut_off) {
            table[b.place] = Some((2.0 * b.variance_dn2).sqrt().max(1e-3) as f32 / 255.0);
        }
        table
    });
    let mut sigma = Plane { data: vec![1.0; mean.data.len()], ..*mean };
    let mut whole = usable.to_vec();
    for i in (0..usable.len()).filter(|i| usable[*i]) {
        for c in 0..3 {
            let bin = ((mean.data[i * 3 + c] * ptc::BINS as f32) as usize).min(ptc::BINS - 1);
            match tables[c][bin] {
                Some(s) => sigma.data[i * 3 + c] = s,
                None => whole[i] = false,
            }
        }
    }
    (sigma, whole)
}

pub(super) fn compare(real: &Measured, simulated: &Measured) -> Comparison {
    let mut out = Comparison {
        variance_ratio: Default::default(),
        mean_deviation: [0.0; 3],
        within_10_percent: [0.0; 3],
        within_10_percent_or_chance: [0.0; 3],
        correlation_error: [0.0; 3],
    };
    for c in 0..3 {
        let mut total = 0.0;
        for bin in real.curves[c].iter().filter(|b| !b.cut_off && b.variance_dn2 > 0.0) {
            // Of several pairs the mean within a bin is not to the last figure that of the one that is simulated.
            let Some(other) = simulated.curves[c].iter().find(|b| b.place == bin.place) else { continue };
            let ratio = other.variance_dn2 / bin.variance_dn2;
            let of = |b: &Bin, m: &Measured| 2.0 * m.neighbours[c].effective_pixels / b.count;
            let chance = 1.96 * (of(bin, real) + of(other, simulated)).sqrt();
            let off = (ratio - 1.0).abs();
            total += bin.count;
            out.mean_deviation[c] += bin.count * off;
            out.within_10_percent[c] += if off <= 0.1 { bin.count } else { 0.0 };
            out.within_10_percent_or_chance[c] += if off <= chance.max(0.1) { bin.count } else { 0.0 };
            out.variance_ratio[c].push([bin.mean_dn, ratio, chance]);
        }
        // Of nothing: not a number, which no reader takes for an agreement.
        out.mean_deviation[c] /= total;
        out.within_10_percent[c] /= total;
        out.within_10_percent_or_chance[c] /= total;
        let (a, b) = (real.neighbours[c].at_lags(), simulated.neighbours[c].at_lags());
        out.correlation_error[c] = (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
    }
    out
}
