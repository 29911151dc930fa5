//! Samples to pixels, for pictures that are supersampled by a grid and hold one sample a texel. Twin of
//! `glsl/resolve_color.comp`, `glsl/resolve_motion.comp` and `glsl/accumulate.comp`. Their multisampled variants differ
//! in nothing but how a sample is fetched; pictures of several samples a texel exist on a device only.

use crate::plane::Plane;

/// Mean over the texels of pixel (x, y): a box of one px, linear radiance and coverage.
///
/// `samples`: shape `[grid height, grid width, 4]`.
///
/// # Panics
/// If the pixel lies outside.
pub fn mean_of_pixel(samples: &Plane<f32>, x: usize, y: usize, grid: usize) -> [f32; 4] {
    let mut sum = [0.0_f32; 4];
    for (column, row) in texels(x, y, grid) {
        for (sum, value) in sum.iter_mut().zip(samples.pixel(column, row)) {
            *sum += value;
        }
    }
    sum.map(|s| s / (grid * grid) as f32)
}

/// Radiance and coverage of all pixels, shape `[height, width, 4]`, before the kernel's rounding to half floats.
///
/// # Panics
/// If the sides of `samples` are no multiples of `grid`, or it has not four channels.
pub fn resolve_color(samples: &Plane<f32>, grid: usize) -> Plane<f32> {
    let (width, height) = pixels(samples, grid);
    assert_eq!(samples.channels, 4, "radiance and coverage");
    Plane::from_fn(width, height, |x, y| mean_of_pixel(samples, x, y, grid))
}

/// Motion (two channels) and distance along the optical axis, m, of each pixel's NEAREST sample; of samples at the same
/// distance the first. Where nothing was drawn: the motion of the first sample and an infinite distance.
///
/// `inverse_depth`: one channel, `near_m` over the distance, 0 where nothing was drawn.
///
/// # Panics
/// If shapes do not fit.
pub fn resolve_motion(
    motion: &Plane<f32>,
    inverse_depth: &Plane<f32>,
    grid: usize,
    near_m: f32,
) -> (Plane<f32>, Plane<f32>) {
    let (width, height) = pixels(motion, grid);
    assert_eq!((inverse_depth.width, inverse_depth.height), (motion.width, motion.height), "depth");
    let nearest = |x: usize, y: usize| {
        let first = ((x * grid, y * grid), 0.0_f32);
        texels(x, y, grid).fold(first, |best, (column, row)| {
            let value = inverse_depth.pixel(column, row)[0];
            if value > best.1 { ((column, row), value) } else { best }
        })
    };
    let motion = Plane::from_fn(width, height, |x, y| {
        let ((column, row), _) = nearest(x, y);
        let v = motion.pixel(column, row);
        [v[0], v[1]]
    });
    let depth_m = Plane::from_fn(width, height, |x, y| {
        let (_, inverse) = nearest(x, y);
        [if inverse > 0.0 { near_m / inverse } else { f32::INFINITY }]
    });
    (motion, depth_m)
}

/// Adds the mean of each pixel times its line's weight to `sum`. `weight_of` says the weight of a pixel; `None` where
/// its line does not see this instant.
///
/// # Panics
/// If `samples` is not `grid` times larger than `sum`, or one has not four channels.
pub fn accumulate(
    sum: &mut Plane<f32>,
    samples: &Plane<f32>,
    grid: usize,
    weight_of: impl Fn(usize, usize) -> Option<f32>,
) {
    assert_eq!((pixels(samples, grid), samples.channels), ((sum.width, sum.height), 4), "samples");
    for y in 0..sum.height {
        for x in 0..sum.width {
            let Some(weight) = weight_of(x, y) else { continue };
            let mean = mean_of_pixel(samples, x, y, grid);
            for (sum, value) in sum.pixel_mut(x, y).iter_mut().zip(mean) {
                *sum += weight * value;
            }
        }
    }
}

/// Texels of a pixel, row by row.
fn texels(x: usize, y: usize, grid: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..grid * grid).map(move |i| (x * grid + i % grid, y * grid + i / grid))
}

fn pixels(samples: &Plane<f32>, grid: usize) -> (usize, usize) {
    assert!(
        grid > 0 && samples.width.is_multiple_of(grid) && samples.height.is_multiple_of(grid),
        "{}x{} texels are no whole pixels of {grid}x{grid}",
        samples.width,
        samples.height
    );
    (samples.width / grid, samples.height / grid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_is_averaged_and_motion_is_that_of_the_nearest() {
        let color = Plane::from_fn(4, 2, |x, y| [(x + 4 * y) as f32, 1.0, 0.0, 1.0]);
        assert_eq!(resolve_color(&color, 2).data, [2.5, 1.0, 0.0, 1.0, 4.5, 1.0, 0.0, 1.0]);
        let motion = Plane::from_fn(4, 2, |x, y| [(10 * x) as f32, y as f32]);
        let inverse = Plane::from_fn(4, 2, |x, y| [if x < 2 { 0.1 + 0.1 * (x * y) as f32 } else { 0.0 }]);
        let (motion, depth_m) = resolve_motion(&motion, &inverse, 2, 0.01);
        assert_eq!(motion.data, [10.0, 1.0, 20.0, 0.0]);
        assert_eq!(depth_m.data, [0.01 / 0.2, f32::INFINITY]);
        let mut sum = Plane::from_fn(2, 1, |_, _| [1.0; 4]);
        accumulate(&mut sum, &color, 2, |x, _| (x == 1).then_some(2.0));
        assert_eq!(sum.data, [1.0, 1.0, 1.0, 1.0, 10.0, 3.0, 1.0, 3.0]);
    }
}
