//! The photon transfer curve: variance of the noise over intensity, and the line through it (EMVA 1288, release 4.0,
//! section 6: variance = read noise squared + signal / full well, in fractions of full scale).

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::frames::Encoding;
use super::statics::AlignedPair;
use shutterbug::plane::Plane;

/// Bins over the encoded value.
pub const BINS: usize = 32;
/// Fewer pixels than this give no bin.
const MIN_BIN_PX: f64 = 400.0;

/// One bin of the curve of one channel.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Bin {
    /// Its number, 0 to [`BINS`] less 1: what a bin of other frames is found by.
    pub place: usize,
    /// Pixels.
    pub count: f64,
    /// Mean, linear, fraction of full scale.
    pub mean_linear: f64,
    /// Variance of one frame, linear, fraction of full scale squared, without that of the rounding to steps.
    pub variance_linear: f64,
    /// Mean, encoded, in 0 to 255.
    pub mean_dn: f64,
    /// Variance of one frame, encoded, in 0 to 255 squared.
    pub variance_dn2: f64,
    /// Values at black or white are too near for the noise to be whole.
    pub cut_off: bool,
}

/// Sums over the pixels of the bins of one channel.
#[derive(Clone, Debug)]
pub struct Curve {
    sums: Vec<[f64; 7]>,
}

impl Default for Curve {
    fn default() -> Self {
        Self { sums: vec![[0.0; 7]; BINS] }
    }
}

impl Curve {
    /// Adds one channel of a pair. Both differences are those of [`AlignedPair::difference`].
    pub fn add(
        &mut self,
        mean: &Plane<f32>,
        differences: [&Plane<f32>; 2],
        usable: &[bool],
        channel: usize,
        e: Encoding,
    ) {
        let [encoded, linear] = differences;
        for (i, _) in usable.iter().enumerate().filter(|(_, u)| **u) {
            let at = i * 3 + channel;
            let value = mean.data[at];
            let bin = ((value * BINS as f32) as usize).min(BINS - 1);
            let (d, l) = (f64::from(encoded.data[at]), f64::from(linear.data[at]));
            let add = [1.0, f64::from(value), f64::from(e.decode(value)), d, d * d, l, l * l];
            for (sum, add) in self.sums[bin].iter_mut().zip(add) {
                *sum += add;
            }
        }
    }

    /// The bins that hold enough pixels. `step` is the distance of two encoded values.
    pub fn bins(&self, step: f32, encoding: Encoding) -> Vec<Bin> {
        let step2 = f64::from(step).powi(2) / 12.0;
        self.sums
            .iter()
            .enumerate()
            .filter(|(_, s)| s[0] >= MIN_BIN_PX)
            .map(|(place, &[n, value, linear, d, dd, l, ll])| {
                let variance = |sum: f64, square: f64| 0.5 * (square - sum * sum / n) / (n - 1.0);
                let (mean, mean_linear, encoded) = (value / n, linear / n, variance(d, dd));
                let sigma = encoded.max(0.0).sqrt();
                let rounding = step2 / encoding.slope(mean_linear).powi(2);
                Bin {
                    place,
                    count: n,
                    mean_linear,
                    variance_linear: variance(l, ll) - rounding,
                    mean_dn: 255.0 * mean,
                    variance_dn2: 255.0 * 255.0 * encoded,
                    cut_off: mean - 4.0 * sigma <= 0.0 || mean + 4.0 * sigma >= 1.0,
                }
            })
            .collect()
    }
}

/// A number with its 95 % interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its 95 % interval; an infinite bound is `null` in JSON.
    pub ci95: [f64; 2],
}

impl Estimate {
    /// Whether a value lies inside.
    pub fn covers(&self, value: f64) -> bool {
        self.ci95[0] <= value && value <= self.ci95[1]
    }
}

/// The line through a curve.
#[derive(Clone, Debug, Serialize)]
pub struct PtcFit {
    /// Electrons at white: 1 / slope. Those of the delivered picture; smoothing makes them more than the sensor's.
    pub full_well_e: Estimate,
    /// Root of the intercept, fraction of full scale.
    pub read_sigma: Estimate,
    /// Variance per linear intensity.
    pub slope: Estimate,
    /// Variance at black.
    pub intercept: Estimate,
    /// Squared residuals over their expectation; 1 for a straight line.
    pub chi2_per_dof: f64,
    /// t value of a quadratic term; beyond 3 the curve bends.
    pub bend_t: f64,
    /// Whether the line describes the curve: no bend, no bin off by more than noise and 10 %.
    pub linear: bool,
    /// Encoded values (0 to 255) of the bins off by more than 3 sigma and 10 %.
    pub off_at_dn: Vec<f64>,
}

impl PtcFit {
    /// Opens the intervals where the variance is known to be at least what was measured.
    pub(super) fn at_least(&mut self) {
        self.full_well_e.ci95[0] = 0.0;
        for bound in [&mut self.slope, &mut self.intercept, &mut self.read_sigma] {
            bound.ci95[1] = f64::INFINITY;
        }
    }
}

/// Fits variance = intercept + slope * mean, in linear values. `effective` is the number of pixels that act as one in
/// the estimate of a variance (the sum of squared autocorrelations; 1 for white noise). Outliers beyond 3 sigma lose
/// weight (Huber). `None` with fewer than four bins.
pub fn fit(bins: &[Bin], effective: f64) -> Option<PtcFit> {
    let points: Vec<[f64; 3]> = bins
        .iter()
        .filter(|b| !b.cut_off && b.variance_linear > 0.0)
        .map(|b| [b.mean_linear, b.variance_linear, b.count / effective.max(1.0)])
        .collect();
    if points.len() < 4 {
        return None;
    }
    let top = points.iter().map(|p| p[0]).fold(0.0, f64::max);
    let mut model: Vec<f64> = points.iter().map(|p| p[1]).collect();
    let mut huber = vec![1.0; points.len()];
    let mut line = Line::default();
    for _ in 0..20 {
        // The weights come from the line, not from the bins: bins that are low by chance would weigh too much.
        let weights: Vec<f64> =
            points.iter().zip(&model).zip(&huber).map(|((p, m), h)| h * p[2] / (2.0 * m * m)).collect();
        line = Line::through(&points, &weights)?;
        let floor = 1e-3 * line.slope.abs() * top + 1e-12;
        for (i, p) in points.iter().enumerate() {
            model[i] = (line.intercept + line.slope * p[0]).max(floor);
            let z = (p[1] - model[i]) / (model[i] * (2.0 / p[2]).sqrt());
            huber[i] = (3.0 / z.abs()).min(1.0);
        }
    }
    let z: Vec<f64> =
        points.iter().zip(&model).map(|(p, m)| (p[1] - m) / (m * (2.0 / p[2]).sqrt())).collect();
    let dof = points.len() as f64 - 2.0;
    let chi2 = z.iter().zip(&huber).map(|(z, h)| h * z * z).sum::<f64>() / dof;
    Some(describe(&line, &points, &model, &z, chi2))
}

/// What a curve of second degree through the bins has at no light, and its standard deviation. `raised`: what is added
/// to the variance of each. `None` with fewer than five bins.
pub(super) fn at_black(bins: &[Bin], effective: f64, raised: impl Fn(&Bin) -> f64) -> Option<[f64; 2]> {
    let whole = bins.iter().filter(|b| !b.cut_off && b.variance_linear > 0.0);
    let points: Vec<[f64; 3]> =
        whole.map(|b| [b.mean_linear, b.variance_linear + raised(b), b.count / effective.max(1.0)]).collect();
    let n = points.len();
    if n < 5 {
        return None;
    }
    let powers = DMatrix::from_fn(n, 3, |i, k| points[i][0].powi(k as i32));
    let values = DVector::from_iterator(n, points.iter().map(|p| p[1]));
    let least = values.min();
    let mut model = values.clone();
    let mut found = None;
    for _ in 0..20 {
        // Weights come from the curve, as for a line.
        let weights = DVector::from_iterator(n, points.iter().zip(&model).map(|(p, m)| p[2] / (2.0 * m * m)));
        let weighted = DMatrix::from_fn(n, 3, |i, k| weights[i] * powers[(i, k)]);
        let inverse = (weighted.transpose() * &powers).try_inverse()?;
        let by = &inverse * weighted.tr_mul(&values);
        let curve = &powers * &by;
        let chi2: f64 = (0..n).map(|i| weights[i] * (values[i] - curve[i]).powi(2)).sum();
        let widen = (chi2 / (n - 3) as f64).max(1.0).sqrt();
        found = Some([by[0], widen * inverse[(0, 0)].max(0.0).sqrt()]);
        model = curve.map(|v| v.max(least));
    }
    found
}

fn describe(line: &Line, points: &[[f64; 3]], model: &[f64], z: &[f64], chi2: f64) -> PtcFit {
    let dof = points.len() as f64 - 2.0;
    // A curve that is no line has wider intervals than its noise says; a lucky one no narrower.
    let widen = chi2.max(1.0).sqrt() * if chi2 > 1.0 { student_t(dof) / 1.96 } else { 1.0 };
    let interval = |value: f64, sigma: f64| {
        let half = 1.96 * widen * sigma;
        Estimate { value, ci95: [value - half, value + half] }
    };
    let slope = interval(line.slope, line.slope_sigma);
    let intercept = interval(line.intercept, line.intercept_sigma);
    let inverse = |v: f64| if v > 0.0 { 1.0 / v } else { f64::INFINITY };
    let root = |v: f64| v.max(0.0).sqrt();
    let bend_t = bend(points, model) / chi2.max(1.0).sqrt();
    let relative = |i: usize| (points[i][1] / model[i] - 1.0).abs();
    let off = (0..points.len()).filter(|i| z[*i].abs() > 3.0 && relative(*i) > 0.1);
    let off_at_dn: Vec<f64> =
        off.map(|i| 255.0 * f64::from(shutterbug::plane::srgb_encode(points[i][0] as f32))).collect();
    PtcFit {
        full_well_e: Estimate {
            value: inverse(slope.value),
            ci95: [inverse(slope.ci95[1]), inverse(slope.ci95[0])],
        },
        read_sigma: Estimate { value: root(intercept.value), ci95: intercept.ci95.map(root) },
        slope,
        intercept,
        chi2_per_dof: chi2,
        bend_t,
        linear: off_at_dn.is_empty() && (bend_t.abs() < 3.0 || chi2 < 1.5),
        off_at_dn,
    }
}

#[derive(Clone, Copy, Default)]
struct Line {
    slope: f64,
    intercept: f64,
    slope_sigma: f64,
    intercept_sigma: f64,
}

impl Line {
    fn through(points: &[[f64; 3]], weights: &[f64]) -> Option<Self> {
        let (mut s, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ([px, py, _], w) in points.iter().zip(weights) {
            (s, x, y) = (s + w, x + w * px, y + w * py);
            (xx, xy) = (xx + w * px * px, xy + w * px * py);
        }
        let determinant = s * xx - x * x;
        // All at one intensity: no slope.
        (determinant > 1e-9 * s * xx).then(|| Self {
            slope: (s * xy - x * y) / determinant,
            intercept: (xx * y - x * xy) / determinant,
            slope_sigma: (s / determinant).sqrt(),
            intercept_sigma: (xx / determinant).sqrt(),
        })
    }
}

/// t value of a quadratic term added to the line: the residuals' projection on the part of x^2 that no line explains.
fn bend(points: &[[f64; 3]], model: &[f64]) -> f64 {
    let weights: Vec<f64> = points.iter().zip(model).map(|(p, m)| p[2] / (2.0 * m * m)).collect();
    let squares: Vec<[f64; 3]> = points.iter().map(|p| [p[0], p[0] * p[0], p[2]]).collect();
    let (Some(of_y), Some(of_square)) = (Line::through(points, &weights), Line::through(&squares, &weights))
    else {
        return 0.0;
    };
    let (mut product, mut energy) = (0.0, 0.0);
    for ((p, q), w) in points.iter().zip(&squares).zip(&weights) {
        let rest = |l: &Line, v: f64| v - l.intercept - l.slope * p[0];
        let (y, x2) = (rest(&of_y, p[1]), rest(&of_square, q[1]));
        (product, energy) = (product + w * y * x2, energy + w * x2 * x2);
    }
    product / energy.sqrt().max(1e-300)
}

/// 97.5 % quantile of Student's t (Cornish-Fisher expansion; 0.5 % off at 3 degrees of freedom).
pub(super) fn student_t(dof: f64) -> f64 {
    let z: f64 = 1.959_964;
    let n = dof.max(1.0);
    z + (z.powi(3) + z) / (4.0 * n)
        + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * n * n)
        + (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / (384.0 * n.powi(3))
}

/// Photon transfer curves of R, G, B through all pairs.
pub fn curves(pairs: &[AlignedPair], step: f32, encoding: Encoding) -> [Vec<Bin>; 3] {
    let mut curves = [Curve::default(), Curve::default(), Curve::default()];
    for pair in pairs {
        let mean = pair.mean();
        let encoded = pair.difference(|v| v);
        let linear = pair.difference(|v| encoding.decode(v));
        for (channel, curve) in curves.iter_mut().enumerate() {
            curve.add(&mean, [&encoded, &linear], &pair.usable, channel, encoding);
        }
    }
    curves.map(|curve| curve.bins(step, encoding))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bin(mean_linear: f64, variance_linear: f64) -> Bin {
        Bin {
            place: 0,
            count: 1e4,
            mean_linear,
            variance_linear,
            mean_dn: 0.0,
            variance_dn2: 0.0,
            cut_off: false,
        }
    }

    #[test]
    fn an_exact_line_is_found_and_a_bent_curve_is_reported() {
        let line: Vec<Bin> =
            (1..20).map(|i| f64::from(i) / 20.0).map(|m| bin(m, 4e-6 + m / 5000.0)).collect();
        let got = fit(&line, 1.0).expect("a line");
        assert!((got.full_well_e.value - 5000.0).abs() < 1e-3, "{got:?}");
        assert!((got.read_sigma.value - 2e-3).abs() < 1e-8 && got.linear, "{got:?}");
        let bent: Vec<Bin> =
            (1..20).map(|i| f64::from(i) / 20.0).map(|m| bin(m, m * (1.2 - m) / 5000.0)).collect();
        assert!(!fit(&bent, 1.0).expect("a fit").linear, "control: a curve is no line");
        assert!(fit(&line[..3], 1.0).is_none());
        assert!(fit(&[line[0]; 8], 1.0).is_none(), "one intensity has no slope");
    }

    #[test]
    fn students_t_agrees_with_the_tables() {
        for (dof, want) in [(3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (30.0, 2.042), (1e6, 1.960)] {
            assert!((student_t(dof) / want - 1.0).abs() < 0.01, "{dof}");
        }
    }
}
