//! A picture read between its texels by a cubic. Twin of `glsl/include/cubic.glsl`.

use glam::{IVec2, Vec2, Vec3};

use crate::plane::Plane;

/// Weights of four texels in a row for a place `f` behind the second: the cubic of Keys with slope -1/2, the only one
/// that leaves a ramp where it is.
fn cubic_weights(f: f32) -> [f32; 4] {
    let square = f * f;
    [
        f * (-0.5 + f * (1.0 - 0.5 * f)),
        1.0 + square * (-2.5 + 1.5 * f),
        f * (0.5 + f * (2.0 - 1.5 * f)),
        square * (-0.5 + 0.5 * f),
    ]
}

/// One texel a px: a cubic through 4x4 texels, which keeps edges that a bilinear reading would widen by a px. It goes
/// beyond none of the four texels around the place, so that nothing rings. At a texel's centre its bits.
pub(super) fn read_cubic(color: &Plane<f32>, position_px: Vec2, clamped: &mut bool) -> Vec3 {
    let last = IVec2::new(color.width as i32 - 1, color.height as i32 - 1);
    let wanted = position_px - 0.5;
    let inside = wanted.clamp(Vec2::ZERO, last.as_vec2());
    *clamped |= inside != wanted;
    let near = inside.as_ivec2().clamp(IVec2::ZERO, last);
    let f = inside - near.as_vec2();
    let (across, down) = (cubic_weights(f.x), cubic_weights(f.y));
    let texel = |x: i32, y: i32| {
        let at = IVec2::new(near.x + x - 1, near.y + y - 1).clamp(IVec2::ZERO, last);
        Vec3::from_slice(color.pixel(at.x as usize, at.y as usize))
    };
    let (mut least, mut most) = (Vec3::splat(3e38), Vec3::splat(-3e38));
    let mut sum = Vec3::ZERO;
    for y in 0..4 {
        let row = [0, 1, 2, 3].map(|x| texel(x, y));
        let along = across[0] * row[0] + across[1] * row[1] + across[2] * row[2] + across[3] * row[3];
        sum += down[y as usize] * along;
        if y == 1 || y == 2 {
            least = least.min(row[1].min(row[2]));
            most = most.max(row[1].max(row[2]));
        }
    }
    sum.clamp(least, most)
}
