//! A Gaussian along one axis of a picture. Twin of `glsl/include/gaussian.glsl`; no effect itself.

use rayon::prelude::*;

use crate::chain::{Packer, Pass};
use crate::plane::Plane;

/// Weights of distance 0 to the radius, which is four sigma (as in scipy.ndimage); both sides add up to 1.
pub(super) fn weights(sigma_px: f64) -> Vec<f32> {
    let radius = (4.0 * sigma_px + 0.5).floor().max(1.0) as i32;
    let bell = |k: i32| (-0.5 * (f64::from(k) / sigma_px).powi(2)).exp();
    let sum: f64 = (-radius..=radius).map(bell).sum();
    (0..=radius).map(|k| (bell(k) / sum) as f32).collect()
}

/// Largest radius whose loops are unrolled, with weights in the effect's slot.
pub(super) const MAX_UNROLLED: usize = 9;
/// Pixels that one invocation makes (`GAUSSIAN_RUN`).
pub(super) const RUN: u32 = 4;

/// The two passes, along rows and along columns, of a kernel whose constant 0 is the axis.
pub(super) fn passes(file: &'static str, sigma_px: f64) -> [Pass; 2] {
    let radius = weights(sigma_px).len() - 1;
    let unrolled = if radius <= MAX_UNROLLED { radius as u32 } else { 0 };
    [
        Pass { file, constants: [0, unrolled], run: [RUN, 1] },
        Pass { file, constants: [1, unrolled], run: [1, RUN] },
    ]
}

/// Radius, table of the weights, and the weights themselves where they fit.
pub(super) fn pack(sigma_px: f64, packer: &mut Packer<'_>) {
    let weights = weights(sigma_px);
    packer.bits(weights.len() as u32 - 1);
    packer.table(weights.iter().copied());
    if weights.len() - 1 <= MAX_UNROLLED {
        weights.iter().for_each(|w| packer.number(f64::from(*w)));
    }
}

/// The Gaussian along rows (`axis` 0) or columns (1); the fourth channel, where there is one, is passed through. Whole
/// rows at a time: compilers turn that into vectors. Each value is summed from one side to the other, as in the kernel.
pub(super) fn along(source: &Plane<f32>, axis: usize, weights: &[f32]) -> Plane<f32> {
    let (width, height, n) = (source.width, source.height, source.channels);
    let radius = weights.len() - 1;
    let mut out = Plane::new(width, height, n);
    let add = |to: &mut [f32], weight: f32, from: &[f32]| {
        for (v, s) in to.iter_mut().zip(from) {
            *v += weight * s;
        }
    };
    out.data.par_chunks_exact_mut(width * n).enumerate().for_each(|(y, to)| {
        let mut wide = Vec::new();
        if axis == 0 {
            let row = source.row(y);
            wide.extend((0..width + 2 * radius).flat_map(|x| {
                let x = x.saturating_sub(radius).min(width - 1);
                row[x * n..(x + 1) * n].iter().copied()
            }));
        }
        for k in 0..=2 * radius {
            let weight = weights[k.abs_diff(radius)];
            if axis == 0 {
                add(to, weight, &wide[k * n..(k + width) * n]);
            } else {
                add(to, weight, source.row((y + k).saturating_sub(radius).min(height - 1)));
            }
        }
        if n > 3 {
            to.iter_mut()
                .skip(3)
                .step_by(n)
                .zip(source.row(y).iter().skip(3).step_by(n))
                .for_each(|(v, s)| *v = *s);
        }
    });
    out
}

/// Both ways.
pub fn blurred(source: &Plane<f32>, sigma_px: f64) -> Plane<f32> {
    let weights = weights(sigma_px);
    along(&along(source, 0, &weights), 1, &weights)
}

/// The colour at a place; the border repeats outwards.
pub(super) fn clamped(source: &Plane<f32>, [x, y]: [i64; 2]) -> [f32; 3] {
    let x = x.clamp(0, source.width as i64 - 1) as usize;
    let y = y.clamp(0, source.height as i64 - 1) as usize;
    let p = source.pixel(x, y);
    [p[0], p[1], p[2]]
}

/// A picture made pixel by pixel from `source`, whose fourth channel it keeps.
pub(super) fn filter(source: &Plane<f32>, f: impl Fn(usize, usize) -> [f32; 3] + Sync) -> Plane<f32> {
    let mut out = source.clone();
    let n = source.channels;
    out.data.par_chunks_exact_mut(source.width * n).enumerate().for_each(|(y, row)| {
        for (x, rgba) in row.chunks_exact_mut(n).enumerate() {
            rgba[..3].copy_from_slice(&f(x, y));
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_add_up_and_have_the_variance() {
        for sigma in [0.6, 1.0, 2.5, 9.0] {
            let w: Vec<f64> = weights(sigma).into_iter().map(f64::from).collect();
            let sum = w[0] + 2.0 * w[1..].iter().sum::<f64>();
            let square: f64 = w.iter().enumerate().map(|(k, w)| 2.0 * w * (k * k) as f64).sum();
            assert!((sum - 1.0).abs() < 1e-6, "{sigma}: {sum}");
            assert!((square.sqrt() / sigma - 1.0).abs() < 0.015, "{sigma}: {}", square.sqrt());
        }
    }

    #[test]
    fn a_flat_picture_stays_and_the_border_repeats() {
        let flat = Plane::from_fn(5, 3, |_, _| [0.25, 0.5, 1.0, -2.0]);
        let seen = along(&flat, 0, &weights(3.0));
        for (a, b) in seen.data.iter().zip(&flat.data) {
            assert!((a - b).abs() < 1e-6);
        }
    }
}
