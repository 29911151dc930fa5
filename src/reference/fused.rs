//! The value at a place from the 2x2 texels around it in each of several pictures, which are moved against each other
//! by parts of a px: that of least expected error where values alike by exp(-distance^2) are known with a little noise
//! (kriging). Twin of `glsl/include/fused.glsl`, but solved in one piece.

use glam::{IVec2, Vec2, Vec3};

use crate::plane::Plane;

/// Variance of a texel's noise over that of the picture.
const NOISE: f64 = 0.008;

/// Texels around the places in as many pictures: each one's offset from its place, px, and colour.
fn around(places: &[(&Plane<f32>, Vec2)]) -> Vec<(Vec2, Vec3)> {
    let mut all = Vec::new();
    for (picture, place_px) in places {
        let size = IVec2::new(picture.width as i32, picture.height as i32);
        let first = (*place_px - 0.5).floor().as_ivec2().clamp(IVec2::ZERO, (size - 2).max(IVec2::ZERO));
        for step in [IVec2::ZERO, IVec2::X, IVec2::Y, IVec2::ONE] {
            let texel = (first + step).min(size - 1);
            let color = Vec3::from_slice(picture.pixel(texel.x as usize, texel.y as usize));
            all.push((first.as_vec2() + step.as_vec2() + 0.5 - *place_px, color));
        }
    }
    all
}

/// Weights by Gaussian elimination.
fn solve(mut system: Vec<Vec<f64>>) -> Vec<f64> {
    let count = system.len();
    for k in 0..count {
        let (above, below) = system.split_at_mut(k + 1);
        let pivot = &above[k];
        for row in below {
            let share = row[k] / pivot[k];
            row.iter_mut().zip(pivot).for_each(|(value, p)| *value -= share * p);
        }
    }
    let mut weights = vec![0.0; count];
    for k in (0..count).rev() {
        let known: f64 = (k + 1..count).map(|i| system[k][i] * weights[i]).sum();
        weights[k] = (system[k][count] - known) / system[k][k];
    }
    weights
}

/// The colour at places of one surface in pictures of one texel a px.
///
/// # Panics
/// If there is none.
pub fn fused(places: &[(&Plane<f32>, Vec2)]) -> Vec3 {
    let texels = around(places);
    let alike = |a: Vec2, b: Vec2| (-f64::from((a - b).length_squared())).exp();
    let row = |(i, a): (usize, &(Vec2, Vec3))| {
        let noise = |k: usize| if k == i { NOISE } else { 0.0 };
        let others = texels.iter().enumerate().map(|(k, b)| alike(a.0, b.0) + noise(k));
        others.chain([alike(a.0, Vec2::ZERO)]).collect()
    };
    let weights = solve(texels.iter().enumerate().map(row).collect());
    let total: f64 = weights.iter().sum();
    let sum: Vec3 = texels.iter().zip(&weights).map(|(t, w)| t.1 * (w / total) as f32).sum();
    let least = texels.iter().fold(Vec3::splat(3e38), |least, t| least.min(t.1));
    let most = texels.iter().fold(Vec3::splat(-3e38), |most, t| most.max(t.1));
    sum.clamp(least, most)
}
