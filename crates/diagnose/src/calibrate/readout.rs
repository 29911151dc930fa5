//! Readout from stripes: under a light that blinks, a rolling shutter's lines see it at different times, and their
//! means go up and down with the light. The period in lines times the delay between lines is the light's period. A
//! global shutter shows no stripes.
//!
//! Stripes are told from content by their spectrum (a line that stands out of its own surroundings beyond chance), by
//! their phase, which is the same in all parts of a line, and by their being one wave in all places (`wave.rs`).
//! Lines that are printed across the whole picture are so, too: only a second picture tells them from a light's.

use std::f64::consts::TAU;

use serde::Serialize;

use super::bent::{Bent, bent};
use super::frames::Encoding;
use super::second::{Second, is_most, second};
use super::slopes;
use super::spectrum::{self, FEWEST, MOST_HARMONICS, Spectrum, Wave, mean_of, wave_at};
use shutterbug::plane::Plane;

/// Parts of a line whose phases are compared.
const PARTS: usize = 8;
/// Fewest lines in which stripes are looked for.
pub const FEWEST_LINES: usize = 4 * FEWEST as usize;

/// Stripes, and what follows from them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Readout {
    /// Whether lines are rows (else columns).
    pub lines_are_rows: bool,
    /// Number of lines.
    pub lines: usize,
    /// Lines from one stripe to the next.
    pub period_lines: f64,
    /// Relative brightness of the stripes: amplitude over mean.
    pub depth: f64,
    /// Delay from one line to the next, s.
    pub line_delay_s: f64,
    /// Readout of all lines, s.
    pub readout_time_s: f64,
    /// 95 % interval of the readout, s.
    pub ci95_s: [f64; 2],
    /// Where stripes bend by more than the interval holds: by how much more often they come at the ends of the lines
    /// than in the middle, a share. Then the period is that of the middle, and the interval reaches to that of all
    /// lines together.
    pub bent_at_ends: Option<f64>,
    /// Other stripes beside these, if there are any.
    pub second: Option<Second>,
}

impl Readout {
    /// Of stripes that bend, those of the middle, where these lie beyond the interval.
    fn take_middle(&mut self, bent: &Bent, light_hz: f64) {
        let [frequency, half] = bent.middle;
        let [middle_s, half_s] = [frequency, half].map(|f| f * self.lines as f64 / light_hz);
        let [low, high] = self.ci95_s;
        if low <= middle_s && middle_s <= high {
            return;
        }
        self.ci95_s = [low.min(middle_s - half_s), high.max(middle_s + half_s)];
        (self.readout_time_s, self.line_delay_s) = (middle_s, frequency / light_hz);
        (self.period_lines, self.bent_at_ends) = (1.0 / frequency, Some(bent.at_ends));
    }

    /// The other readouts up to the longest possible that give the same stripes: lines see the light at whole steps, so
    /// that its cycles a line are known but for whole ones, and but for their sign.
    pub fn aliases_s(&self, light_hz: f64, longest_s: f64) -> Vec<f64> {
        let lines = self.lines as f64;
        let (seen, most) = (1.0 / self.period_lines, longest_s * light_hz / lines);
        let whole = (1..).map(f64::from).take_while(|k| *k - seen <= most);
        whole
            .flat_map(|k| [k - seen, k + seen])
            .filter(|c| *c <= most)
            .map(|c| c * lines / light_hz)
            .collect()
    }
}

/// Why pictures tell no readout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoReadout {
    /// Nothing repeats along the lines.
    NothingRepeats,
    /// Something does, or steps, but is not one wave over whole lines.
    NotOneWave,
    /// Each picture alone has stripes, at the same places.
    SameInEach,
}

/// What was looked for and how strongly it was seen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stripes {
    /// Readout, where there are stripes.
    pub readout: Option<Readout>,
    /// Why there is none.
    pub no_readout: Option<NoReadout>,
    /// The strongest line of the spectrum over its surroundings: along rows and along columns.
    pub strongest: [f64; 2],
    /// What it would have to be.
    pub threshold: [f64; 2],
}

/// Finds stripes in photographs (encoded values) of one scene at rest under a light of `light_hz` blinks a second. From
/// two on, content that they share is divided out; of one alone an evenly lit surface is expected.
pub fn find_stripes(photographs: &[Plane<f32>], encoding: Encoding, light_hz: f64) -> Stripes {
    let mut strongest = [0.0; 2];
    let mut threshold = [0.0; 2];
    let mut best: Option<(f64, Readout)> = None;
    for (axis, rows) in [true, false].into_iter().enumerate() {
        let seen = changes(photographs, encoding, rows);
        let parts = without_slopes(&seen);
        let lines = parts.first().map_or(0, Vec::len);
        if lines < FEWEST_LINES {
            continue;
        }
        let mean = mean_of(&parts);
        let spectrum = Spectrum::of(&mean);
        threshold[axis] = spectrum::threshold(lines);
        strongest[axis] = spectrum.strongest(|_| true).map_or(0.0, |i| spectrum.over_surroundings(i));
        let found = spectrum.fundamental(threshold[axis]).and_then(|f| wave_at(&parts, &mean, f));
        let is_light = |wave: &Wave| {
            // One picture has the lens's slopes, two of a scene at rest have none.
            let is_seen = if photographs.len() > 1 { !is_slow(&seen) } else { is_most(&parts, *wave) };
            is_seen && !parts_are_apart(&parts, wave.frequency)
        };
        let one = found.filter(is_light);
        let Some(wave @ Wave { frequency, .. }) = one else { continue };
        let mut readout = readout(rows, lines, wave, spectrum.noise_near(frequency), light_hz);
        readout.second = second(&parts, wave, light_hz);
        let across_px = photographs.first().map_or(0, |p| if rows { p.width } else { p.height });
        if let Some(bent) = bent(&parts, frequency, across_px, MOST_HARMONICS) {
            readout.take_middle(&bent, light_hz);
        }
        let over = strongest[axis] / threshold[axis];
        if best.as_ref().is_none_or(|b| over > b.0) {
            best = Some((over, readout));
        }
    }
    let readout = best.map(|b| b.1);
    let alone = |photograph: &Plane<f32>| {
        find_stripes(std::slice::from_ref(photograph), encoding, light_hz).readout.is_some()
    };
    let no_readout = if readout.is_some() {
        None
    } else if photographs.len() > 1 && photographs.iter().all(alone) {
        Some(NoReadout::SameInEach)
    } else if strongest.iter().zip(threshold).any(|(s, t)| *s > t) {
        Some(NoReadout::NotOneWave)
    } else {
        Some(NoReadout::NothingRepeats)
    };
    Stripes { readout, no_readout, strongest, threshold }
}

/// Whether most parts of the lines have stripes of which the given ones are a harmonic, and which their mean has not:
/// lamps of different phases light them, and their sum blinks more often than each.
fn parts_are_apart(parts: &[Vec<f64>], frequency: f64) -> bool {
    let is_harmonic = |part: &&Vec<f64>| {
        let own = Spectrum::of(part).fundamental(spectrum::threshold(part.len()));
        own.map(|own| frequency / own).is_some_and(|k| k > 1.5 && (k - k.round()).abs() < 0.05 * k)
    };
    2 * parts.iter().filter(is_harmonic).count() > parts.len()
}

/// Whether most of what pictures differ by along the lines is slow: a light of fewer than three periods, of which what
/// repeats are harmonics.
fn is_slow(changes: &[Vec<f64>]) -> bool {
    let mean = mean_of(changes);
    let level = mean.iter().sum::<f64>() / mean.len() as f64;
    let whole: f64 = mean.iter().map(|v| (v - level).powi(2)).sum();
    let fast: f64 = slopes::without_finer(mean).iter().map(|v| v * v).sum();
    whole > 2.0 * fast
}

fn readout(rows: bool, lines: usize, wave: Wave, noise: f64, light_hz: f64) -> Readout {
    let (n, Wave { frequency, amplitude }) = (lines as f64, wave);
    // Cramer and Rao's bound of a sine's frequency in noise of that variance a line.
    let spread = (24.0 * noise / (amplitude * amplitude * n * n * n)).sqrt() / TAU;
    let line_delay_s = frequency / light_hz;
    let half_s = 1.96 * n * spread / light_hz;
    let readout_time_s = n * line_delay_s;
    Readout {
        lines_are_rows: rows,
        lines,
        period_lines: 1.0 / frequency,
        depth: amplitude,
        line_delay_s,
        readout_time_s,
        ci95_s: [readout_time_s - half_s, readout_time_s + half_s],
        bent_at_ends: None,
        second: None,
    }
}

/// The parts of the lines without what changes slowly.
fn without_slopes(seen: &[Vec<f64>]) -> Vec<Vec<f64>> {
    seen.iter().cloned().map(slopes::without).collect()
}

/// Logarithms of the lines' mean light in each part of the lines; of several photographs their changes.
fn changes(photographs: &[Plane<f32>], encoding: Encoding, rows: bool) -> Vec<Vec<f64>> {
    let logs = |p: &Plane<f32>| -> Vec<Vec<f64>> {
        let (lines, across) = if rows { (p.height, p.width) } else { (p.width, p.height) };
        let part = |k: usize| k * across / PARTS..(k + 1) * across / PARTS;
        let line = |i: usize, k: usize| {
            let at = |j: usize| if rows { p.pixel(j, i) } else { p.pixel(i, j) };
            let sum: f64 = part(k).flat_map(at).map(|v| f64::from(encoding.decode(*v))).sum();
            (sum / (part(k).len() * p.channels).max(1) as f64).max(1e-6).ln()
        };
        (0..PARTS).map(|k| (0..lines).map(|i| line(i, k)).collect()).collect()
    };
    let all: Vec<_> = photographs.iter().map(logs).collect();
    match all.as_slice() {
        [one] => one.clone(),
        several => {
            // Pairs apart, so that what one shows is not in two changes.
            let pairs: Vec<_> = several.chunks_exact(2).collect();
            let change = |k: usize, i: usize| {
                let sum: f64 = pairs.iter().map(|p| p[0][k][i] - p[1][k][i]).sum();
                sum / pairs.len() as f64
            };
            let lines = several.first().map_or(0, |s| s[0].len());
            (0..PARTS).map(|k| (0..lines).map(|i| change(k, i)).collect()).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dice::Dice;
    use super::super::spectrum::{ALPHA, in_phase};
    use super::*;

    /// A lamp that is on for `duty` of its period, seen by lines that are open for `open` periods, `delay` periods
    /// apart.
    fn photograph(
        size: [usize; 2],
        delay: f64,
        open: f64,
        duty: f64,
        noise: f64,
        content: bool,
    ) -> Plane<f32> {
        let mut dice = Dice(7);
        let light_until = |t: f64| t.floor() * duty + t.rem_euclid(1.0).min(duty);
        Plane::from_fn(size[0], size[1], |x, y| {
            let t = 0.3 + delay * y as f64;
            let light = 0.2 + 0.8 * (light_until(t + open) - light_until(t)) / open;
            let print = if content { 1.0 + 0.5 * (0.9 * y as f64 + 0.05 * x as f64).sin() } else { 1.0 };
            [(0.4 * light * print * (1.0 + noise * dice.normal())) as f32; 3]
        })
    }

    #[test]
    fn the_readout_follows_from_the_stripes_and_a_global_shutter_has_none() {
        // 480 lines in 20 ms under a light of 500 Hz: ten stripes.
        let delay = 0.02 / 480.0 * 500.0;
        for (open, duty) in [(0.4, 0.5), (0.2, 0.1), (1.3, 0.5)] {
            let striped = photograph([320, 480], delay, open, duty, 0.05, false);
            let found = find_stripes(&[striped], Encoding::Linear, 500.0);
            let readout = found.readout.clone().unwrap_or_else(|| panic!("{open} {duty}: {found:?}"));
            assert!(readout.lines_are_rows);
            assert!((readout.readout_time_s / 0.02 - 1.0).abs() < 0.01, "{open} {duty}: {readout:?}");
        }
        let global = photograph([320, 480], 0.0, 0.4, 0.5, 0.05, false);
        assert!(find_stripes(&[global], Encoding::Linear, 500.0).readout.is_none(), "control");
        // Open for a whole number of periods, every line sees the same.
        let whole = photograph([320, 480], delay, 1.0, 0.5, 0.05, false);
        assert!(find_stripes(&[whole], Encoding::Linear, 500.0).readout.is_none());
    }

    #[test]
    fn lamps_of_opposite_phase_are_no_stripes_and_pictures_at_one_phase_are_told() {
        let delay = 0.02 / 480.0 * 500.0;
        let [left, right] = [0.0, 0.5].map(|phase| {
            let mut dice = Dice(7);
            Plane::from_fn(320, 480, move |_, y| {
                let light = 0.5 + 0.4 * (TAU * (0.3 + phase + delay * y as f64)).sin();
                [(0.4 * light * (1.0 + 0.02 * dice.normal())) as f32; 3]
            })
        });
        let both = Plane::from_fn(320, 480, |x, y| {
            let p = if x < 160 { &left } else { &right }.pixel(x, y);
            [p[0], p[1], p[2]]
        });
        let why = |pictures: &[Plane<f32>]| find_stripes(pictures, Encoding::Linear, 500.0).no_readout;
        assert_eq!(why(&[both]), Some(NoReadout::NotOneWave));
        assert_eq!(why(std::slice::from_ref(&left)), None, "control");
        let mut again = left.clone();
        again.data.iter_mut().for_each(|v| *v *= 0.5);
        assert_eq!(why(&[left.clone(), again]), Some(NoReadout::SameInEach));
        assert_eq!(why(&[left, right]), None, "control: another phase");
        let dark = photograph([320, 480], 0.0, 0.4, 0.5, 0.05, false);
        assert_eq!(why(&[dark]), Some(NoReadout::NothingRepeats), "control: a global shutter");
    }

    /// One to two periods of a lamp that is on or off: its harmonics repeat often enough, and are no light themselves.
    #[test]
    fn harmonics_of_a_light_that_is_too_slow_to_be_seen_are_no_stripes() {
        for periods in [1.0, 1.2, 1.4, 1.6, 2.0, 2.5] {
            let delay = periods / 240.0;
            let one = photograph([320, 240], delay, 0.1, 0.5, 0.01, false);
            // Another moment of the light.
            let other = Plane::from_fn(320, 240, |x, y| [one.pixel(x, 239 - y)[0]; 3]);
            for pictures in [vec![one.clone()], vec![one, other]] {
                let found = find_stripes(&pictures, Encoding::Linear, 60.0);
                assert!(found.readout.is_none(), "{periods} {}: {found:?}", pictures.len());
            }
        }
        let enough = photograph([320, 240], 4.2 / 240.0, 0.1, 0.5, 0.01, false);
        assert!(find_stripes(&[enough], Encoding::Linear, 60.0).readout.is_some(), "control");
    }

    #[test]
    fn a_light_faster_than_lines_leaves_several_readouts() {
        // 192 lines in 20 ms under 9 kHz: 0.9375 cycles a line, which look like 0.0625.
        let striped = photograph([320, 192], 0.02 / 192.0 * 9000.0, 0.1, 0.5, 0.02, false);
        let readout = find_stripes(&[striped], Encoding::Linear, 9000.0).readout.expect("stripes");
        assert!((readout.readout_time_s / 0.02 * 15.0 - 1.0).abs() < 0.01, "{readout:?}");
        let others = readout.aliases_s(9000.0, 0.05);
        assert_eq!(others.len(), 4, "{others:?}");
        assert!((others[0] / 0.02 - 1.0).abs() < 1e-3, "{others:?}");
        // Control: a lamp that blinks less than once in two lines of the longest readout leaves one.
        assert!(readout.aliases_s(1900.0, 0.05).is_empty());
    }

    /// Lines that are printed on a part of the picture, whose parts agree in phase.
    #[test]
    fn a_print_on_a_part_of_the_picture_is_no_stripe() {
        let mut dice = Dice(3);
        let print = Plane::from_fn(320, 480, |_, y| {
            let dark = y > 280 && (y / 10) % 2 == 0;
            [if dark { 0.1 } else { 0.5 } * (1.0 + 0.05 * dice.normal()) as f32]
        });
        let found = find_stripes(std::slice::from_ref(&print), Encoding::Linear, 200.0);
        assert!(found.readout.is_none(), "{found:?}");
        // Control: without the comparison of places it would be a light.
        let parts = without_slopes(&changes(&[print], Encoding::Linear, true));
        let spectrum = Spectrum::of(&mean_of(&parts));
        let wave = spectrum.fundamental((240.0 / ALPHA).ln()).expect("a line of the spectrum");
        assert!(in_phase(&parts, wave), "control");
    }

    #[test]
    fn the_ripple_of_another_lamp_is_not_taken_for_the_lights_own_period() {
        let plain = photograph([320, 480], 0.02 / 480.0 * 500.0, 0.4, 0.5, 0.02, false);
        for (hz, depth) in [(100.0, 0.1), (120.0, 0.05), (120.0, 0.2), (175.0, 0.1)] {
            let ripple = |y: usize| 1.0 + depth * (TAU * hz * 0.02 * y as f64 / 480.0 + 0.7).sin() as f32;
            let both = Plane::from_fn(320, 480, |x, y| [plain.pixel(x, y)[0] * ripple(y); 3]);
            let found = find_stripes(&[both], Encoding::Linear, 500.0);
            let readout = found.readout.clone().unwrap_or_else(|| panic!("{hz} {depth}: {found:?}"));
            assert!((readout.readout_time_s / 0.02 - 1.0).abs() < 0.01, "{hz} {depth}: {readout:?}");
        }
        // Control: where the exposure hides most of the first harmonic, the period is still the light's.
        let second = photograph([320, 480], 0.02 / 480.0 * 500.0, 0.95, 0.25, 0.02, false);
        let found = find_stripes(&[second], Encoding::Linear, 500.0).readout.expect("stripes");
        assert!((found.readout_time_s / 0.02 - 1.0).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn a_pattern_across_the_lines_is_no_stripe() {
        let print = photograph([320, 480], 0.0, 0.4, 0.5, 0.02, true);
        assert!(find_stripes(&[print], Encoding::Linear, 500.0).readout.is_none());
    }
}
