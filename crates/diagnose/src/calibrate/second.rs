//! A second wave along the lines: another lamp's, or that of a picture which was read out otherwise than the one that
//! it is compared with. The deepest is taken for the light's; that there is another must be said.
//!
//! Where the light of two lamps adds, its logarithm beats: a second wave need not be the same in all places, as the
//! first must, but only of one phase along the lines.

use serde::Serialize;

use super::slopes::Slopes;
use super::spectrum::{Spectrum, Wave, mean_of, threshold, wave_across};

/// Least depth of the second wave, a share of the first's: a lamp that adds less is not taken for the one that blinks.
const LEAST_PART: f64 = 0.1;
/// Harmonics of the light: those of a pulse of a twentieth of the period, and more.
const HARMONICS: usize = 24;
/// How close to a harmonic a wave is one, natural steps (one over the number of lines): what the window spreads.
const NEAR: f64 = 2.0;

/// Stripes beside those of the light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Second {
    /// Lines from one stripe to the next.
    pub period_lines: f64,
    /// Amplitude over the mean light.
    pub depth: f64,
    /// Readout of all lines if these stripes are the light's, s.
    pub readout_time_s: f64,
}

/// What the parts of the lines show beside a wave and its harmonics.
fn beside(parts: &[Vec<f64>], first: Wave) -> Option<Vec<Vec<f64>>> {
    parts.iter().map(|p| Slopes::of(p).without_wave(first.frequency, HARMONICS)).collect()
}

/// Whether a wave with its harmonics is two thirds or more, by power, of what all parts of the lines show alike. A
/// light that blinks too slowly to be seen has been taken for a slope, and one of its harmonics for the light: the
/// others are left then.
pub(super) fn is_most(parts: &[Vec<f64>], first: Wave) -> bool {
    let Some(left) = beside(parts, first) else { return false };
    let power = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
    let [whole, rest] = [parts, &left].map(|p| power(&mean_of(p)));
    // Noise of each part is in their mean as well.
    let count = parts.len() as f64;
    let noise = (left.iter().map(|p| power(p)).sum::<f64>() - count * rest) / (count * (count - 1.0));
    rest - noise.max(0.0) < 0.5 * (whole - rest)
}

/// The deepest wave that is none of `first`'s harmonics, if it stands out beyond chance.
pub(super) fn second(parts: &[Vec<f64>], first: Wave, light_hz: f64) -> Option<Second> {
    let left = beside(parts, first)?;
    let (mean, lines) = (mean_of(&left), left.first()?.len());
    let spectrum = Spectrum::of(&mean);
    let at = spectrum.strongest(|f| !is_harmonic(f, first.frequency, NEAR / lines as f64))?;
    if spectrum.over_surroundings(at) <= threshold(lines) {
        return None;
    }
    let wave = wave_across(&left, &mean, spectrum.frequency(at))?;
    (wave.amplitude >= LEAST_PART * first.amplitude).then(|| Second {
        period_lines: 1.0 / wave.frequency,
        depth: wave.amplitude,
        readout_time_s: wave.frequency * lines as f64 / light_hz,
    })
}

/// Whether a frequency is within `near` of a multiple of another, as lines show it: folded at half a cycle a line.
fn is_harmonic(frequency: f64, of: f64, near: f64) -> bool {
    let multiples = (1..=HARMONICS).map(|k| k as f64 * of);
    multiples.map(|m| (m - m.round()).abs()).any(|m| (m - frequency).abs() < near)
}

#[cfg(test)]
mod tests {
    use super::super::dice::Dice;
    use super::super::frames::Encoding;
    use super::super::readout::find_stripes;
    use super::*;
    use shutterbug::plane::Plane;

    const LINES: usize = 480;
    /// 480 lines in 20 ms under a light of 500 Hz: ten stripes.
    const LIGHT_HZ: f64 = 500.0;

    /// A picture under lamps of several frequencies (Hz) and depths, read out in `readout_s`.
    fn picture(readout_s: f64, lamps: &[(f64, f64)], seed: u64) -> Plane<f32> {
        let mut dice = Dice(seed);
        let start = dice.roll();
        Plane::from_fn(320, LINES, |x, y| {
            let t = start + readout_s * y as f64 / LINES as f64;
            // Pulses, seen for a tenth of a period: many harmonics.
            let until = |turn: f64| 0.2 * turn.floor() + turn.rem_euclid(1.0).min(0.2);
            let pulse = |hz: f64| (until(hz * t + 0.1) - until(hz * t)) / 0.1;
            let light: f64 = 0.3 + lamps.iter().map(|(hz, depth)| depth * pulse(*hz)).sum::<f64>();
            let print = 1.0 - 0.3 * (x as f64 / 320.0).powi(2);
            [(0.4 * light * print * (1.0 + 0.03 * dice.normal())) as f32; 3]
        })
    }

    fn found(pictures: &[Plane<f32>]) -> Option<Second> {
        find_stripes(pictures, Encoding::Linear, LIGHT_HZ).readout.expect("stripes").second
    }

    #[test]
    fn a_second_lamp_and_another_readout_are_seen() {
        let second = found(&[picture(0.02, &[(LIGHT_HZ, 0.6), (830.0, 0.3)], 1)]).expect("two lamps");
        assert!((second.period_lines / (LINES as f64 / (830.0 * 0.02)) - 1.0).abs() < 0.02, "{second:?}");
        let [one, other] = [0.02, 0.014].map(|s| picture(s, &[(LIGHT_HZ, 0.6)], (1e3 * s) as u64));
        let second = found(&[one.clone(), other]).expect("two readouts");
        let is = |s: f64| (second.readout_time_s / s - 1.0).abs() < 0.02;
        assert!(is(0.014) || is(0.02), "{second:?}");
        // Controls: the same readout twice, and one picture.
        assert_eq!(found(&[one.clone(), picture(0.02, &[(LIGHT_HZ, 0.6)], 5)]), None);
        assert_eq!(found(&[one]), None);
    }

    #[test]
    fn one_lamp_has_no_second_wave() {
        for seed in 0..12 {
            let periods = 4.0 + 3.7 * seed as f64;
            let one = picture(periods / LIGHT_HZ, &[(LIGHT_HZ, 0.6)], seed);
            let stripes = find_stripes(&[one], Encoding::Linear, LIGHT_HZ);
            assert_eq!(stripes.readout.and_then(|r| r.second), None, "{periods} stripes");
        }
    }
}
