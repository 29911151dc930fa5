//! Tells linear pictures from sRGB pictures by their edges. A pixel that an edge crosses is a mean of the light of both
//! sides. Edges cross pixels at any place, so the mean share of the brighter side is one half. Decoded with the wrong
//! encoding, the share is larger or smaller.

use crate::plane::{Plane, srgb_decode, srgb_encode};

/// Most pixels from one side of an edge to the other.
const SIDE_PIXELS: usize = 3;
/// Sides vary at most by this share of the step, and what is between them is off them by more: the less is left out,
/// the less do the darkest pixels, which one encoding presses together, bend the mean of the other.
const MAX_SIDE_VARIATION: f32 = 0.015;
/// Edges that say something: so far apart are the shares that the two encodings give at half.
const MIN_SHARE_DIFFERENCE: f32 = 0.06;
/// Edges that are enough, each once for all of its colours.
const MIN_EDGES: f64 = 60.0;
/// Standard deviation of a share that is even from 0 to 1.
const UNIFORM_SIGMA: f64 = 0.289;

/// What values turn out to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Told {
    /// Light, as they were taken.
    Light,
    /// They were decoded and are light without that, or were taken for light and are its sRGB.
    Other,
    /// Too few edges, or neither.
    Nothing,
}

/// Mean share of the brighter side in what edges cross: as the values are taken, and in the other encoding.
#[derive(Default)]
struct Shares {
    count: f64,
    taken: f64,
    other: f64,
}

impl Shares {
    fn line(&mut self, line: &[f32], other: fn(f32) -> f32) {
        let mut at = 1;
        while at + SIDE_PIXELS + 2 < line.len() {
            at += (1..=SIDE_PIXELS).find_map(|n| self.edge(&line[at - 1..at + n + 3], other)).unwrap_or(1);
        }
    }

    /// Two pixels of a side, the mixed ones, and two of the other side; how far the second side is, if they are an
    /// edge.
    fn edge(&mut self, run: &[f32], other: fn(f32) -> f32) -> Option<usize> {
        let mixed = &run[2..run.len() - 2];
        let (a, b) = (run[1], run[run.len() - 2]);
        let (dark, bright) = (a.min(b), a.max(b));
        let flat = MAX_SIDE_VARIATION * (bright - dark);
        let even = (run[0] - a).abs() <= flat && (run[run.len() - 1] - b).abs() <= flat;
        let between = mixed.iter().all(|m| *m > dark + flat && *m < bright - flat);
        let order = |pair: &[f32]| if b > a { pair[0] <= pair[1] } else { pair[0] >= pair[1] };
        let inside = dark >= 0.0 && bright <= 1.0;
        if !(even && between && mixed.windows(2).all(order) && inside) {
            return None;
        }
        let share = |m: f32, of: fn(f32) -> f32| (of(m) - of(dark)) / (of(bright) - of(dark));
        if (share(0.5 * (dark + bright), other) - 0.5).abs() < MIN_SHARE_DIFFERENCE {
            return None;
        }
        let mean = |of: fn(f32) -> f32| {
            mixed.iter().map(|m| f64::from(share(*m, of))).sum::<f64>() / mixed.len() as f64
        };
        self.count += 1.0;
        self.taken += mean(|v| v);
        self.other += mean(other);
        Some(mixed.len() + 1)
    }

    fn told(&self) -> Told {
        // The three colours of an edge tell the same.
        let edges = self.count / 3.0;
        let off = |sum: f64| (sum / self.count - 0.5).abs();
        let (taken, other) = (off(self.taken), off(self.other));
        let chance = 4.0 * UNIFORM_SIGMA / edges.sqrt();
        if edges < MIN_EDGES || (taken < chance && other < chance) {
            Told::Nothing
        } else if other < 0.5 * taken {
            Told::Other
        } else if taken < 0.5 * other {
            Told::Light
        } else {
            Told::Nothing
        }
    }
}

/// What the values of pictures (linear RGB as they were taken) are; `decoded`: from sRGB codes.
pub(super) fn told(pictures: [&Plane<f32>; 2], decoded: bool) -> Told {
    let other = if decoded { srgb_encode } else { srgb_decode };
    let mut shares = Shares::default();
    for picture in pictures {
        for c in 0..3 {
            let at = |x: usize, y: usize| picture.pixel(x, y)[c];
            for y in 0..picture.height {
                shares.line(&(0..picture.width).map(|x| at(x, y)).collect::<Vec<_>>(), other);
            }
            for x in 0..picture.width {
                shares.line(&(0..picture.height).map(|y| at(x, y)).collect::<Vec<_>>(), other);
            }
        }
    }
    shares.told()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bars of many widths, mixed where their edges cross pixels, as `mixed` says; `sharp`: not mixed.
    fn bars(encode: fn(f32) -> f32, sharp: bool) -> Plane<f32> {
        Plane::from_fn(400, 12, |x, y| {
            let cover = |edge: f32| (x as f32 + 1.0 - edge).clamp(0.0, 1.0);
            let step = |i: usize| cover(8.37 * i as f32 + 0.173 * y as f32);
            let bright: f32 = (1..48).map(|i| if i % 2 == 1 { step(i) } else { -step(i) }).sum();
            let bright = if sharp { bright.round() } else { bright };
            [encode(0.05 + 0.6 * bright); 4]
        })
    }

    #[test]
    fn light_and_its_srgb_are_told_apart_and_what_is_not_mixed_is_not_judged() {
        let (light, code) = (bars(|v| v, false), bars(srgb_encode, false));
        let decoded = bars(|v| srgb_decode(srgb_encode(v)), false);
        let darker = bars(srgb_decode, false);
        for (picture, decoded, want) in [
            (&light, false, Told::Light),
            (&decoded, true, Told::Light),
            (&code, false, Told::Other),
            (&darker, true, Told::Other),
        ] {
            assert_eq!(told([picture, picture], decoded), want);
        }
        let sharp = [bars(|v| v, true), bars(srgb_encode, true)];
        assert!(sharp.iter().all(|p| told([p, p], false) == Told::Nothing));
        let few = Plane { width: 200, height: 1, data: code.data[..800].to_vec(), ..code.clone() };
        assert_eq!(told([&few, &few], false), Told::Nothing);
    }
}
