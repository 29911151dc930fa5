//! What steps that mix neighbouring pixels behind the noise (demosaicking, sharpening, shared chroma) leave of it, by statistic.
//! White noise does not stay white: sharpening lifts single pixels and leaves means over blocks as they were, demosaicking takes
//! from single pixels and adds to those means, in which fewer own values stand than pixels. Steps are linear, so variances are
//! sums of squares of what single impulses become.

use std::sync::LazyLock;

use super::model::{P, Theta};
use super::packing::Left;
use super::photometric::demosaicked;
use super::tone::{noise_gain, noise_lift, row_lift};
use crate::plane::Plane;

/// Weights of brightness (ITU-T T.871).
pub(super) const LUMA: [f32; 3] = [0.299, 0.587, 0.114];
/// Sides of the blocks of the bands of the score, px.
const BANDS: [usize; 3] = [2, 4, 8];
/// Rows of the picture in which impulses are followed, px: the largest block's neighbourhood and what reaches into it.
const SIDE: usize = 20;
/// Where blocks begin in it, px.
const FROM: usize = 2;

/// By channel: shares of what white noise of a pixel's own variance would give means over blocks and lines; nothing where it stays
/// white.
pub(super) fn mixed(theta: &Theta) -> Option<[Left; 3]> {
    let (mosaic, sharp) = (theta.get(P::Mosaic) >= 1.0, theta.get(P::Sharpen) != 0.0);
    if !mosaic && !sharp {
        return None;
    }
    let mut left = if mosaic { *DEMOSAICKED } else { [Left::ALL; 3] };
    if sharp {
        let (bands, line) = (sharpened(theta), row_lift(theta) / noise_lift(theta));
        for of in &mut left {
            of.bands.iter_mut().zip(bands).for_each(|(b, s)| *b *= s);
            of.lines = of.lines.map(|l| l * line);
        }
    }
    Some(left)
}

/// Variance of a pixel's colour from that of each colour before, where n pixels share their chroma: `[of][from]`. Nothing where
/// they do not.
pub(super) fn shared(theta: &Theta) -> Option<[[f32; 3]; 3]> {
    let n = [0.0, 4.0, 2.0][theta.get(P::Chroma) as usize];
    // A pixel has its own brightness, and the mean over n of the colour's difference to brightness.
    let weight = |of: usize, from: usize| {
        let luma = LUMA[from];
        let difference = if of == from { 1.0 - luma } else { -luma };
        (luma + difference / n).powi(2) + (n - 1.0) * (difference / n).powi(2)
    };
    (n > 0.0).then(|| [0, 1, 2].map(|of| [0, 1, 2].map(|from| weight(of, from))))
}

/// Of the bands, over the lift of single pixels: boxes and Gaussians are products of what they are along each axis.
fn sharpened(theta: &Theta) -> [f32; 3] {
    let (amount, sigma) = (theta.get(P::Sharpen), theta.get(P::Radius));
    let radius = (4.0 * sigma + 0.5).floor().max(1.0) as usize;
    let bell: Vec<f64> =
        (0..=2 * radius).map(|k| (-0.5 * ((k as f64 - radius as f64) / sigma).powi(2)).exp()).collect();
    let sum: f64 = bell.iter().sum();
    let soft = |from: &[f64]| -> Vec<f64> {
        let mut to = vec![0.0; from.len()];
        for (i, v) in from.iter().enumerate().filter(|(_, v)| **v != 0.0) {
            bell.iter().enumerate().for_each(|(k, b)| to[i + k - radius] += v * b / sum);
        }
        to
    };
    BANDS.map(|n| {
        let of = |side: usize| -> Vec<f64> {
            let inside = 2 * radius..2 * radius + side;
            (0..4 * radius + 2 * n)
                .map(|i| if inside.contains(&i) { 1.0 / side as f64 } else { 0.0 })
                .collect()
        };
        let plain = [of(n), of(2 * n)];
        let once = [soft(&plain[0]), soft(&plain[1])];
        // Of the block's mean less that of the larger block.
        let product = |a: &[Vec<f64>; 2], b: &[Vec<f64>; 2]| {
            let dot = |i: usize, j: usize| a[i].iter().zip(&b[j]).map(|(a, b)| a * b).sum::<f64>().powi(2);
            dot(0, 0) - dot(0, 1) - dot(1, 0) + dot(1, 1)
        };
        let variance = (1.0 + amount).powi(2) * product(&plain, &plain)
            - 2.0 * amount * (1.0 + amount) * product(&plain, &once)
            + amount * amount * product(&once, &once);
        (variance / product(&plain, &plain)) as f32 / noise_lift(theta)
    })
}

/// Of demosaicking, the same for each pattern: what a block's mean has is that of the whole of four cells.
static DEMOSAICKED: LazyLock<[Left; 3]> = LazyLock::new(|| {
    let mut sums = [[0.0f64; 3]; 5];
    for at in 0..SIDE * SIDE {
        let impulse = Plane::from_fn(SIDE, SIDE, |x, y| [f32::from(u8::from(y * SIDE + x == at)); 3]);
        let seen = demosaicked(&impulse, 1);
        let mean = |from: [usize; 2], size: [usize; 2], c: usize| -> f64 {
            let values =
                (from[1]..from[1] + size[1]).flat_map(|y| (from[0]..from[0] + size[0]).map(move |x| (x, y)));
            let sum: f32 = values.map(|(x, y)| seen.pixel(x, y)[c]).sum();
            f64::from(sum) / (size[0] * size[1]) as f64
        };
        for c in 0..3 {
            for (band, n) in BANDS.into_iter().enumerate() {
                sums[band][c] += (mean([FROM; 2], [n; 2], c) - mean([FROM; 2], [2 * n; 2], c)).powi(2) / 0.75
                    * (n * n) as f64;
            }
            // Lines with and without the colour.
            let length = SIDE - 2 * FROM;
            for line in [8, 9] {
                sums[3][c] += 0.5 * mean([FROM, line], [length, 1], c).powi(2) * length as f64;
                sums[4][c] += 0.5 * mean([line, FROM], [1, length], c).powi(2) * length as f64;
            }
        }
    }
    let pixel = noise_gain(&Theta::neutral().with(P::Mosaic, 1.0));
    [0, 1, 2].map(|c| {
        let of = |k: usize| sums[k][c] as f32 / pixel[c];
        Left { bands: [0, 1, 2].map(of), lines: [3, 4].map(of), ..Left::ALL }
    })
});

#[cfg(test)]
mod tests {
    use super::super::packing::{band, lines, normal_noise, square};
    use super::super::photometric::{gaussian, subsampled};
    use super::*;

    /// Shares of what drawn noise has behind the steps of `theta`, over those of white noise of the same pixels.
    fn drawn(theta: &Theta) -> ([f32; 3], [f32; 2]) {
        let mut noise = normal_noise([512, 512]);
        if theta.is_on(P::Mosaic) {
            noise = demosaicked(&noise, theta.get(P::Mosaic) as usize);
        }
        if theta.is_on(P::Sharpen) {
            let (amount, soft) =
                (theta.get(P::Sharpen) as f32, gaussian(&noise, theta.get(P::Radius) as f32));
            noise.data.iter_mut().zip(&soft.data).for_each(|(v, s)| *v += amount * (*v - s));
        }
        let pixel = square(noise.data.iter().copied());
        (
            BANDS.map(|n| band(&noise, n) / (0.75 * pixel / (n * n) as f32)),
            [true, false].map(|rows| lines(&noise, rows) / pixel),
        )
    }

    #[test]
    fn means_over_blocks_and_lines_have_what_drawn_noise_has() {
        let sharp = Theta::neutral().with(P::Sharpen, 0.7).with(P::Radius, 1.5);
        let mosaic = Theta::neutral().with(P::Mosaic, 2.0);
        for (theta, coarse) in [(&sharp, 0.6), (&mosaic, 1.5)] {
            let told = mixed(theta).expect("pixels are mixed");
            let pixel = noise_gain(theta);
            let mean = |of: &dyn Fn(usize) -> f32| {
                (0..3).map(|c| pixel[c] * of(c)).sum::<f32>() / pixel.iter().sum::<f32>()
            };
            let (bands, lines) = drawn(theta);
            for (band, seen) in bands.into_iter().enumerate() {
                let told = mean(&|c| told[c].bands[band]);
                assert!((seen / told - 1.0).abs() < 0.06, "band {band} of {theta:?}: {seen}, told {told}");
            }
            for (k, seen) in lines.into_iter().enumerate() {
                let told = mean(&|c| told[c].lines[k]);
                assert!((seen / told - 1.0).abs() < 0.12, "lines {k} of {theta:?}: {seen}, told {told}");
            }
            // Control: white noise would have all of it.
            assert!((bands[2] < coarse) == (coarse < 1.0), "{bands:?}");
        }
    }

    #[test]
    fn shared_colour_takes_noise_from_the_other_colours() {
        // Noise in red alone.
        let noise = normal_noise([256, 256]);
        let red = Plane::from_fn(256, 256, |x, y| [noise.pixel(x, y)[0], 0.0, 0.0]);
        for scheme in [1usize, 2] {
            let told = shared(&Theta::neutral().with(P::Chroma, scheme as f64)).expect("they share");
            let seen = subsampled(&red, scheme);
            for (of, told) in told.iter().enumerate() {
                let seen = square(seen.data.iter().skip(of).step_by(3).copied());
                assert!((seen / told[0] - 1.0).abs() < 0.05, "{scheme} {of}: {seen}, told {}", told[0]);
            }
        }
        assert!(shared(&Theta::neutral()).is_none(), "control");
    }
}
