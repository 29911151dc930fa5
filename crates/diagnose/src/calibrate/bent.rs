//! Whether stripes bend. A sensor's lines are straight, and so are the stripes of a light, whatever the lens: it acts
//! before the sensor. Where they bend, the picture was bent afterwards: a lens's distortion was taken out, say, and the
//! lines of the picture are not the sensor's.
//!
//! With a distortion of y (1 + k r^2) about the middle, the lines that the picture's own lines show come as often as
//! f (1 + k x^2) on average, so that a part of the lines further out shows another period.

use super::ptc::student_t;
use super::slopes::Slopes;

/// Student's t of six degrees of freedom that chance exceeds, to either side, once in a hundred times: eight parts less
/// the two numbers that are fitted to their periods.
const T99: f64 = 3.707;
/// Mean slope of y^3 over the half of the lines, of the square of that half: that of the nearest straight line.
const CUBE: f64 = 0.6;

/// Frequencies of stripes that bend, cycles a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bent {
    /// In the middle of the picture, and half of its 95 % interval.
    pub middle: [f64; 2],
    /// By how much it differs at the ends of the lines, in the middle of them, a share of `middle`.
    pub at_ends: f64,
}

/// Whether the parts of the lines show frequencies that go with the square of their distance from the middle, beyond
/// chance: what they scatter by otherwise.
pub(super) fn bent(parts: &[Vec<f64>], frequency: f64, across_px: usize, harmonics: usize) -> Option<Bent> {
    let n = parts.len() as f64;
    let lines = parts.first()?.len() as f64;
    let half_px = 0.5 * across_px as f64;
    let squares: Vec<f64> =
        (0..parts.len()).map(|k| (half_px * (2.0 * (k as f64 + 0.5) / n - 1.0)).powi(2)).collect();
    let own: Vec<f64> = parts.iter().map(|p| own_frequency(p, frequency, harmonics)).collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
    let (mean_square, mean_own) = (mean(&squares), mean(&own));
    let energy: f64 = squares.iter().map(|s| (s - mean_square).powi(2)).sum();
    let slope =
        squares.iter().zip(&own).map(|(s, f)| (s - mean_square) * (f - mean_own)).sum::<f64>() / energy;
    let rest = squares.iter().zip(&own).map(|(s, f)| (f - mean_own - slope * (s - mean_square)).powi(2));
    let spread = (rest.sum::<f64>() / (n - 2.0)).sqrt();
    if slope.abs() <= T99 * spread / energy.sqrt() {
        return None;
    }
    // The middle of the lines, and of each of them.
    let back = mean_square + CUBE * (0.5 * lines).powi(2);
    let middle = mean_own - slope * back;
    let deviation = spread * (1.0 / n + back * back / energy).sqrt();
    Some(Bent {
        middle: [middle, student_t(n - 2.0) * deviation],
        at_ends: slope * half_px * half_px / middle,
    })
}

/// The frequency within a natural step at which a wave and its harmonics explain most of a part.
fn own_frequency(part: &[f64], frequency: f64, harmonics: usize) -> f64 {
    let natural = 1.0 / part.len().max(1) as f64;
    let slopes = Slopes::of(part);
    let [mut low, mut high] = [-1.0, 1.0].map(|side| frequency + side * natural);
    for _ in 0..30 {
        let (a, b) = (low + 0.382 * (high - low), low + 0.618 * (high - low));
        if slopes.explained(a, harmonics) < slopes.explained(b, harmonics) { low = a } else { high = b }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::super::dice::Dice;
    use super::super::frames::Encoding;
    use super::super::readout::{Readout, find_stripes};
    use shutterbug::plane::Plane;

    /// 20 ms of 240 lines under a light of 500 Hz, in a picture of which a distortion was taken out.
    fn readout(k1: f64, surface: f64, noise: f64, seed: u64) -> Readout {
        let mut dice = Dice(seed);
        let mut normal = || dice.normal();
        let tones: Vec<f64> = (0..20 * 20).map(|_| 1.0 + surface * normal()).collect();
        let picture = Plane::from_fn(320, 240, |x, y| {
            let [u, v] = [(x as f64 - 159.5) / 250.0, (y as f64 - 119.5) / 250.0];
            let line = 119.5 + 250.0 * v * (1.0 + k1 * (u * u + v * v));
            let lamp = if (line / 24.0 + 0.3).fract() < 0.5 { 0.5 } else { 0.15 };
            let light = lamp * tones[y / 16 * 20 + x / 16] + noise * normal();
            [light as f32; 3]
        });
        find_stripes(&[picture], Encoding::Linear, 500.0).readout.expect("stripes")
    }

    #[test]
    fn stripes_that_bend_are_told_and_give_the_readout_of_the_middle() {
        for k1 in [-0.05, -0.15, -0.3, 0.1] {
            let found = readout(k1, 0.0, 0.003, 3);
            let ends = found.bent_at_ends.unwrap_or_else(|| panic!("{k1}: {found:?}"));
            assert!((ends / (k1 * 0.64 * 0.64) - 1.0).abs() < 0.3, "{k1}: {found:?}");
            assert!((found.readout_time_s / 0.02 - 1.0).abs() < 0.003, "{k1}: {found:?}");
            // Control: all lines together show another one.
            let all_s = if k1 < 0.0 { found.ci95_s[0] } else { found.ci95_s[1] };
            assert!((all_s / 0.02 - 1.0).abs() > 0.01, "{k1}: {found:?}");
        }
        // Controls: straight stripes, on an even surface and on one with squares.
        let bends = |surface: f64| {
            (0..12).filter(|seed| readout(0.0, surface, 0.01, 5 + seed).bent_at_ends.is_some()).count()
        };
        assert!(bends(0.0) <= 1 && bends(0.1) <= 1, "{} {}", bends(0.0), bends(0.1));
    }
}
