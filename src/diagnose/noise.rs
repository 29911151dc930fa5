//! The spread of the real values about the simulated ones, where the picture is flat: which noise the sensor has.

use super::evidence::Evidence;
use super::model::{P, Theta};
use super::photometric::Tone;
use crate::plane::Plane;

/// Steepest slope of the simulated picture where noise is measured, DN a px: beyond it renderers differ.
const FLAT_DN: f32 = 4.0;
/// Fewest values of a bin of brightness.
const FEWEST: usize = 200;

/// Moments of the differences, in linear values of the sensor.
pub(super) struct NoiseData {
    /// Per bin of brightness: linear value, variance, number.
    bins: Vec<[f64; 3]>,
    /// Variance of row means beyond that of their values.
    row2: f64,
    /// Per bin: linear value, variance of what stays the same over the frames, number.
    fixed: Vec<[f64; 3]>,
    /// Share of pixels that are white in every frame and are not so in the simulation.
    pub hot: f64,
}

fn flat(mean: &Plane<f32>, x: usize, y: usize) -> bool {
    let (w, h) = (mean.width, mean.height);
    if x < 2 || y < 2 || x + 2 >= w || y + 2 >= h {
        return false;
    }
    let here = mean.pixel(x, y);
    [(-2i64, 0i64), (2, 0), (0, -2), (0, 2), (-1, -1), (1, 1), (1, -1), (-1, 1)].iter().all(|(dx, dy)| {
        let there = mean.pixel((x as i64 + dx) as usize, (y as i64 + dy) as usize);
        (0..3).all(|c| (there[c] - here[c]).abs() < FLAT_DN)
    })
}

impl NoiseData {
    /// Measures. `means`: simulated values of `frames` (places), DN.
    pub(super) fn measure(
        evidence: &Evidence,
        frames: &[usize],
        means: &[Plane<f32>],
        theta: &Theta,
        masks: Option<&[Plane<f32>]>,
    ) -> Self {
        let tone = Tone::new(theta);
        let gain = [theta.get(P::WbR) as f32, 1.0, theta.get(P::WbB) as f32];
        let (w, h) = (means[0].width, means[0].height);
        let mut by_bin: Vec<Vec<f32>> = vec![Vec::new(); 32];
        let mut row2 = (0.0, 0.0);
        let mut sums = vec![[0.0f32; 4]; w * h * 3];
        let mut white = vec![true; w * h];
        for (&at, mean) in frames.iter().zip(means) {
            let real = &evidence.frames[at].dn;
            for y in 0..h {
                let mut row = [[0.0f64; 3]; 3];
                for x in 0..w {
                    let i = y * w + x;
                    let (r, m) = (real.pixel(x, y), mean.pixel(x, y));
                    white[i] &= (0..3).all(|c| r[c] >= 253.0) && (0..3).any(|c| m[c] < 235.0);
                    if masks.is_some_and(|k| k[at].data[i] <= 0.5) || !flat(mean, x, y) {
                        continue;
                    }
                    for c in 0..3 {
                        let slope = tone.slope_at(m[c]) * gain[c];
                        // Values near the ends are clipped, and their spread with them.
                        if m[c] < 12.0 || m[c] > 240.0 || slope < 20.0 || r[c] <= 0.0 || r[c] >= 255.0 {
                            continue;
                        }
                        let error = (r[c] - m[c]) / slope;
                        let linear = tone.decode(m[c]) / gain[c];
                        let bin = ((m[c] / 8.0) as usize).min(31);
                        by_bin[bin].push(error);
                        let s = &mut sums[3 * i + c];
                        *s = [s[0] + error, s[1] + error * error, s[2] + 1.0, s[3] + linear];
                        let e = f64::from(error);
                        row[c] = [row[c][0] + e, row[c][1] + e * e, row[c][2] + 1.0];
                    }
                }
                for [sum, square, n] in row.into_iter().filter(|r| r[2] > 40.0) {
                    let mean = sum / n;
                    // What is left of the variance of the mean when that of its values is taken off.
                    row2.0 += mean * mean - (square / n - mean * mean) / (n - 1.0);
                    row2.1 += 1.0;
                }
            }
        }
        let quantum = |bin: usize| {
            let slope = f64::from(tone.slope_at(8.0 * bin as f32 + 4.0));
            1.0 / 12.0 / (slope * slope).max(1e-9)
        };
        let bins = by_bin
            .iter_mut()
            .enumerate()
            .filter(|(_, v)| v.len() >= FEWEST)
            .map(|(bin, v)| {
                let linear = f64::from(tone.decode(8.0 * bin as f32 + 4.0));
                [linear, (robust_variance(v) - quantum(bin)).max(0.0), v.len() as f64]
            })
            .collect();
        let fixed = fixed_part(&sums, frames.len());
        let hot = white.iter().filter(|w| **w).count() as f64 / (w * h) as f64;
        let row2 = if row2.1 > 0.0 { (row2.0 / row2.1).max(0.0) } else { 0.0 };
        Self { bins, row2, fixed, hot: if frames.len() >= 3 { hot } else { 0.0 } }
    }

    /// Parameters of the given noise effects, by weighted least squares that keeps them from going negative.
    pub(super) fn fit(&self, theta: &Theta, names: &[&str]) -> Theta {
        let on = |name: &str| names.contains(&name);
        let mut theta = theta.clone();
        for p in [P::Shot, P::Read, P::Row, P::Dsnu, P::Prnu, P::Hot] {
            theta.set(p, 0.0);
        }
        let row2 = if on("row_noise") { self.row2 } else { 0.0 };
        theta.set(P::Row, row2.sqrt());
        if on("fixed_pattern_noise") {
            let [dsnu2, prnu2] = line(&self.fixed, |l| [1.0, l * l]);
            theta.set(P::Dsnu, dsnu2.sqrt());
            theta.set(P::Prnu, prnu2.sqrt());
        }
        let (dsnu2, prnu2) = (theta.get(P::Dsnu).powi(2), theta.get(P::Prnu).powi(2));
        let rest: Vec<[f64; 3]> =
            self.bins.iter().map(|&[l, v, n]| [l, (v - row2 - dsnu2 - prnu2 * l * l).max(0.0), n]).collect();
        let [read2, inverse] = match (on("read_noise"), on("shot_noise")) {
            (true, true) => line(&rest, |l| [1.0, l]),
            (true, false) => line(&rest, |_| [1.0, 0.0]),
            (false, true) => line(&rest, |l| [0.0, l]),
            (false, false) => [0.0, 0.0],
        };
        theta.set(P::Read, read2.sqrt());
        theta.set(P::Shot, inverse);
        if on("hot_pixels") {
            theta.set(P::Hot, self.hot);
        }
        theta
    }
}

/// Variance from the middle half of the values: edges of renderers and stuck pixels have no say.
fn robust_variance(values: &mut [f32]) -> f64 {
    let n = values.len();
    let mut at = |share: f64| {
        let i = ((n as f64 * share) as usize).min(n - 1);
        *values.select_nth_unstable_by(i, f32::total_cmp).1
    };
    let (low, high) = (at(0.1587), at(0.8413));
    (0.5 * f64::from(high - low)).powi(2)
}

/// Variance between pixels of what their frames have in common, by brightness.
fn fixed_part(sums: &[[f32; 4]], frames: usize) -> Vec<[f64; 3]> {
    let mut bins = [[0.0f64; 3]; 12];
    for s in sums.iter().filter(|s| s[2] >= 3.0 && s[2] as usize * 2 >= frames) {
        let n = f64::from(s[2]);
        let (mean, square) = (f64::from(s[0]) / n, f64::from(s[1]) / n);
        let own = (square - mean * mean) / (n - 1.0);
        let linear = f64::from(s[3]) / n;
        let bin = &mut bins[((linear.sqrt() * 12.0) as usize).min(11)];
        // Stuck pixels have a variance of their own.
        if mean.abs() < 0.25 {
            *bin = [bin[0] + linear, bin[1] + mean * mean - own, bin[2] + 1.0];
        }
    }
    let enough = bins.into_iter().filter(|b| b[2] >= FEWEST as f64);
    enough.map(|[l, v, n]| [l / n, (v / n).max(0.0), n]).collect()
}

/// Two coefficients, neither negative, of `variance = x . f(linear)`, weighted by number over squared variance.
fn line(bins: &[[f64; 3]], f: impl Fn(f64) -> [f64; 2]) -> [f64; 2] {
    let solve = |use_: [bool; 2], previous: [f64; 2]| -> [f64; 2] {
        let (mut a, mut b) = ([[0.0; 2]; 2], [0.0; 2]);
        for &[l, v, n] in bins {
            let g = f(l);
            let model = (previous[0] * g[0] + previous[1] * g[1]).max(0.1 * v).max(1e-9);
            let weight = n / (model * model);
            for i in 0..2 {
                b[i] += weight * g[i] * v;
                (0..2).for_each(|j| a[i][j] += weight * g[i] * g[j]);
            }
        }
        let one = |i: usize| if a[i][i] > 0.0 { b[i] / a[i][i] } else { 0.0 };
        match use_ {
            [true, true] => {
                let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
                if det.abs() <= 1e-12 * a[0][0] * a[1][1] {
                    return [one(0), 0.0];
                }
                [(b[0] * a[1][1] - b[1] * a[0][1]) / det, (b[1] * a[0][0] - b[0] * a[1][0]) / det]
            }
            [true, false] => [one(0), 0.0],
            _ => [0.0, one(1)],
        }
    };
    let probe = f(0.5);
    let both = [probe[0] > 0.0, probe[1] > 0.0];
    let mut x = [0.0; 2];
    for _ in 0..6 {
        x = solve(both, x);
        if x[0] < 0.0 {
            x = solve([false, true], [0.0, x[1].max(0.0)]);
        } else if x[1] < 0.0 {
            x = solve([true, false], [x[0], 0.0]);
        }
        x = x.map(|v| v.max(0.0));
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_are_recovered_and_never_negative() {
        let bins: Vec<[f64; 3]> =
            (1..20).map(|i| f64::from(i) / 20.0).map(|l| [l, 3e-5 + l / 800.0, 1000.0]).collect();
        let [read2, inverse] = line(&bins, |l| [1.0, l]);
        assert!((read2 - 3e-5).abs() < 1e-8 && (inverse - 1.0 / 800.0).abs() < 1e-8, "{read2} {inverse}");
        let falling: Vec<[f64; 3]> =
            (1..20).map(|i| [f64::from(i) / 20.0, 1e-3 - 4e-5 * f64::from(i), 1e3]).collect();
        let [read2, inverse] = line(&falling, |l| [1.0, l]);
        assert!(read2 > 0.0 && inverse == 0.0);
    }
}
