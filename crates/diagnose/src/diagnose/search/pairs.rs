//! Whether pixels of the real frames share their colour, told from the frames alone: where colour is stored at half the
//! resolution, neighbours of a pair differ in brightness only, whatever the picture shows and however noisy it was
//! before. Compression behind it spreads what a pair shares; nothing is told then. Pairs that share their brightness as
//! well are a picture that was enlarged.

use crate::diagnose::evidence::{Evidence, spread_out};
use shutterbug::plane::Plane;
use shutterbug::plane::stats::luma;

/// Frames that are looked at.
const FRAMES: usize = 4;
/// Least mean difference between neighbours of different pairs, in units of a colour difference: rounding makes 0.2.
const LEAST_DN: f64 = 0.5;
/// Most of that that may be left within pairs, besides rounding.
const WITHIN: f64 = 0.2;
/// What rounding to whole DN leaves within pairs.
const ROUNDING_DN: f64 = 0.25;

/// The scheme (a place among the options of `chroma_subsampling.scheme`) that the frames (places) show; none where they
/// show none.
pub(crate) fn scheme(evidence: &Evidence, frames: &[usize]) -> Option<u8> {
    let some = spread_out(frames, FRAMES);
    let shared = |down: bool| {
        let sums = some.iter().map(|&at| differences(&evidence.frames[at].dn, down));
        let sums = sums.fold(Sums::default(), |a, s| std::array::from_fn(|i| a[i] + s[i]));
        let [color, brightness] = [&sums[..2], &sums[2..4]].map(|s| [0, 1].map(|k| s[k] / sums[4].max(1.0)));
        tracing::debug!(
            "within pairs and between them: colour {color:?}, brightness {brightness:?} (down: {down})"
        );
        let share = |[within, between]: [f64; 2]| {
            between > LEAST_DN && within < ROUNDING_DN.min(0.5 * between) + WITHIN * between
        };
        share(color) && !share(brightness)
    };
    match (shared(false), shared(true)) {
        (true, true) => Some(1),
        (true, false) => Some(2),
        _ => None,
    }
}

/// Sums of the differences of colour within pairs and between them, of those of brightness, and their number.
type Sums = [f64; 5];

/// The sums along rows or down columns.
fn differences(dn: &Plane<f32>, down: bool) -> Sums {
    let step = if down { [0, 1] } else { [1, 0] };
    let (w, h) = (dn.width - 2 * step[0], dn.height - 2 * step[1]);
    let mut sums = Sums::default();
    for y in (0..h).step_by(1 + step[1]) {
        for x in (0..w).step_by(1 + step[0]) {
            let pixel = |k: usize| dn.pixel(x + k * step[0], y + k * step[1]);
            // Clipped colours have lost what they shared.
            if (0..3).any(|k| pixel(k).iter().any(|v| *v < 1.0 || *v > 254.0)) {
                continue;
            }
            let [one, two, three] = [0, 1, 2].map(|k| chroma(pixel(k)));
            for c in 0..2 {
                sums[0] += f64::from((two[c] - one[c]).abs());
                sums[1] += f64::from((three[c] - two[c]).abs());
                sums[4] += 1.0;
            }
            let [one, two, three] = [0, 1, 2].map(|k| luma(pixel(k)));
            // One for two colours.
            sums[2] += 2.0 * f64::from((two - one).abs());
            sums[3] += 2.0 * f64::from((three - two).abs());
        }
    }
    sums
}

/// The two colour differences of a pixel (ITU-T T.871).
fn chroma(p: &[f32]) -> [f32; 2] {
    let luma = luma(p);
    [(p[2] - luma) / 1.772, (p[0] - luma) / 1.402]
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_uniform;
    use shutterbug::effects::chroma_subsampling::sharing;

    fn picture(sigma: f32) -> Plane<f32> {
        Plane::from_fn(64, 48, |x, y| {
            [0u32, 1, 2].map(|c| {
                let uniform = random_uniform([x as u32, y as u32], c, 9, [3, 4]);
                let noise: f32 = uniform.iter().map(|u| u - 0.5).sum();
                90.0 + 20.0 * ((x / 7 + (c as usize + 1) * (y / 5)) % 4) as f32 + 1.73 * sigma * noise
            })
        })
    }

    fn told(plane: &Plane<f32>) -> Option<u8> {
        let rounded = Plane { data: plane.data.iter().map(|v| v.round()).collect(), ..plane.clone() };
        scheme(&Evidence::of_one(rounded), &[0])
    }

    #[test]
    fn a_picture_that_was_enlarged_shares_no_colour_alone() {
        for sigma in [0.0, 6.0] {
            let small = picture(sigma);
            let large = Plane::from_fn(64, 48, |x, y| [0, 1, 2].map(|c| small.pixel(x / 2, y / 2)[c]));
            assert_eq!(told(&large), None, "noise of {sigma} DN");
            assert_eq!(told(&sharing(&large, 2)), None, "noise of {sigma} DN");
        }
    }

    #[test]
    fn pairs_that_share_their_colour_are_told_with_noise_and_without_and_none_where_there_are_none() {
        for sigma in [0.0, 2.0, 8.0] {
            let plain = picture(sigma);
            assert_eq!(told(&plain), None, "control: noise of {sigma} DN");
            assert_eq!(told(&sharing(&plain, 2)), Some(1), "noise of {sigma} DN");
            assert_eq!(told(&sharing(&plain, 1)), Some(2), "noise of {sigma} DN");
        }
        let grey = Plane::from_fn(64, 48, |x, y| [(40 + (x * 3 + y * 5) % 120) as f32; 3]);
        assert_eq!(told(&grey), None, "what has no colour tells of none");
    }
}
