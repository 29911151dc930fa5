//! Samples to delivered pixels where no line is exposed for longer than an instant. Twin of `glsl/exact_still.comp`;
//! its multisampled variant differs in nothing but how a sample is fetched.

use super::resolve::mean_of_pixel;
use crate::plane::Plane;

/// Radiance of a picture of `[width, height]` px inside an attachment that has `margin_px` more on each side, shape
/// `[height, width, 4]`; alpha is the number of samples that a statistic counts, one.
///
/// `samples`: shape `[grid (height + 2 margin), grid (width + 2 margin), 4]`.
///
/// # Panics
/// If the samples are fewer.
pub fn exact_still(
    samples: &Plane<f32>,
    grid: usize,
    [width, height]: [usize; 2],
    margin_px: [usize; 2],
) -> Plane<f32> {
    Plane::from_fn(width, height, |x, y| {
        let [r, g, b, _] = mean_of_pixel(samples, x + margin_px[0], y + margin_px[1], grid);
        [r, g, b, 1.0]
    })
}
