//! Small filters on planes: Gaussian, local mean, dilation. Borders repeat outwards.

use rayon::prelude::*;

use shutterbug::plane::Plane;

/// Convolves rows and columns with a symmetric kernel given by its centre and one side: `half[0]` is the centre.
pub fn convolve_separable(plane: &Plane<f32>, half: &[f32]) -> Plane<f32> {
    let (width, height, channels) = (plane.width, plane.height, plane.channels);
    let mut rows = Plane::new(width, height, channels);
    rows.data.par_chunks_mut(width * channels).enumerate().for_each(|(y, out)| {
        let row = plane.row(y);
        for x in 0..width {
            for c in 0..channels {
                let mut sum = half[0] * row[x * channels + c];
                for (k, weight) in half.iter().enumerate().skip(1) {
                    let left = x.saturating_sub(k);
                    let right = (x + k).min(width - 1);
                    sum += weight * (row[left * channels + c] + row[right * channels + c]);
                }
                out[x * channels + c] = sum;
            }
        }
    });
    let mut out = Plane::new(width, height, channels);
    out.data.par_chunks_mut(width * channels).enumerate().for_each(|(y, out)| {
        for (i, value) in out.iter_mut().enumerate() {
            *value = half[0] * rows.data[y * width * channels + i];
        }
        for (k, weight) in half.iter().enumerate().skip(1) {
            let (above, below) = (rows.row(y.saturating_sub(k)), rows.row((y + k).min(height - 1)));
            for ((value, a), b) in out.iter_mut().zip(above).zip(below) {
                *value += weight * (a + b);
            }
        }
    });
    out
}

/// Centre and one side of a sampled Gaussian of sum 1.
pub fn gaussian_half(sigma_px: f64) -> Vec<f32> {
    if sigma_px < 1e-3 {
        return vec![1.0];
    }
    let radius = (4.0 * sigma_px).ceil() as usize;
    let value = |k: usize| (-0.5 * (k as f64 / sigma_px).powi(2)).exp();
    let sum: f64 = 1.0 + 2.0 * (1..=radius).map(value).sum::<f64>();
    (0..=radius).map(|k| (value(k) / sum) as f32).collect()
}

/// Gaussian of `sigma_px`; 0 changes nothing.
pub fn gaussian(plane: &Plane<f32>, sigma_px: f64) -> Plane<f32> {
    convolve_separable(plane, &gaussian_half(sigma_px))
}

/// Mean of `values` over the pixels of `mask` within `radius_px` (a square), per channel; 0 where there is none.
/// By summed areas, so the cost does not depend on the radius.
pub fn masked_mean(values: &Plane<f32>, mask: &[bool], radius_px: usize) -> Plane<f32> {
    let (width, height, channels) = (values.width, values.height, values.channels);
    let stride = width + 1;
    let mut counts = vec![0u32; stride * (height + 1)];
    let mut sums = vec![0f64; stride * (height + 1) * channels];
    for y in 0..height {
        let (mut row_count, mut row) = (0, vec![0f64; channels]);
        for x in 0..width {
            if mask[y * width + x] {
                row_count += 1;
                for (sum, v) in row.iter_mut().zip(values.pixel(x, y)) {
                    *sum += f64::from(*v);
                }
            }
            let (here, above) = ((y + 1) * stride + x + 1, y * stride + x + 1);
            counts[here] = counts[above] + row_count;
            for c in 0..channels {
                sums[here * channels + c] = sums[above * channels + c] + row[c];
            }
        }
    }
    let mut out = Plane::new(width, height, channels);
    for y in 0..height {
        let (y0, y1) = (y.saturating_sub(radius_px), (y + radius_px + 1).min(height));
        for x in 0..width {
            let (x0, x1) = (x.saturating_sub(radius_px), (x + radius_px + 1).min(width));
            let corners = [y1 * stride + x1, y0 * stride + x1, y1 * stride + x0, y0 * stride + x0];
            let count = counts[corners[0]] + counts[corners[3]] - counts[corners[1]] - counts[corners[2]];
            if count > 0 {
                for c in 0..channels {
                    let [a, b, d, e] = corners.map(|i| sums[i * channels + c]);
                    out.pixel_mut(x, y)[c] = ((a - b - d + e) / f64::from(count)) as f32;
                }
            }
        }
    }
    out
}

/// Pixels with a set pixel within `radius_px` (a square).
pub fn dilate(mask: &[bool], width: usize, radius_px: usize) -> Vec<bool> {
    let spread = |mask: &[bool], length: usize, lines: usize, at: &dyn Fn(usize, usize) -> usize| {
        let mut out = vec![false; mask.len()];
        for line in 0..lines {
            let mut last: Option<usize> = None;
            for i in 0..length + radius_px {
                if i < length && mask[at(line, i)] {
                    last = Some(i);
                }
                if i >= radius_px && last.is_some_and(|l| l + 2 * radius_px >= i) {
                    out[at(line, i - radius_px)] = true;
                }
            }
        }
        out
    };
    let height = mask.len() / width;
    let rows = spread(mask, width, height, &|y, x| y * width + x);
    spread(&rows, height, width, &|x, y| y * width + x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_keeps_the_mean_and_has_its_variance() {
        let point = Plane::from_fn(61, 61, |x, y| [f32::from(x == 30 && y == 30)]);
        let blurred = gaussian(&point, 2.5);
        let sum: f32 = blurred.data.iter().sum();
        let second: f32 = (0..61).map(|x| (x as f32 - 30.0).powi(2) * blurred.row(30)[x]).sum::<f32>()
            / blurred.row(30).iter().sum::<f32>();
        assert!((sum - 1.0).abs() < 1e-4 && (second - 6.25).abs() < 0.05, "{sum} {second}");
        assert_eq!(gaussian(&point, 0.0), point);
    }

    #[test]
    fn masked_means_and_dilation_agree_with_counting() {
        let plane = Plane::from_fn(23, 17, |x, y| [(x * 3 + y * y) as f32, x as f32]);
        let mask: Vec<bool> = (0..23 * 17).map(|i| i * 7 % 11 < 3).collect();
        let (mean, wide) = (masked_mean(&plane, &mask, 3), dilate(&mask, 23, 2));
        for y in 0..17usize {
            for x in 0..23usize {
                let near = |r: usize| {
                    let inside = move |(u, v): &(usize, usize)| u.abs_diff(x) <= r && v.abs_diff(y) <= r;
                    (0..23 * 17).map(|i| (i % 23, i / 23)).filter(inside).filter(|(u, v)| mask[v * 23 + u])
                };
                let values: Vec<f32> = near(3).map(|(u, v)| plane.pixel(u, v)[0]).collect();
                let want = values.iter().sum::<f32>() / values.len().max(1) as f32;
                assert!((mean.pixel(x, y)[0] - want).abs() < 1e-3);
                assert_eq!(wide[y * 23 + x], near(2).next().is_some(), "({x}, {y})");
            }
        }
    }
}
