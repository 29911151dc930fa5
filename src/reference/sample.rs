//! Reading a picture between its pixels. Twin of `glsl/include/sample.glsl`.

use glam::{Vec2, Vec4};

use crate::plane::Plane;

/// Bilinear value at a position, px, clamped to the outermost pixel centres; `clamped` is set (never cleared) where
/// that changed the position. At a pixel's centre: its bits.
///
/// # Panics
/// If the picture does not have four channels.
pub fn sample_bilinear(picture: &Plane<f32>, position_px: Vec2, clamped: &mut bool) -> Vec4 {
    let last = [picture.width - 1, picture.height - 1];
    let wanted = position_px - 0.5;
    let inside = wanted.clamp(Vec2::ZERO, Vec2::new(last[0] as f32, last[1] as f32));
    *clamped |= inside != wanted;
    let near = [(inside.x as usize).min(last[0]), (inside.y as usize).min(last[1])];
    let far = [(near[0] + 1).min(last[0]), (near[1] + 1).min(last[1])];
    let weight = inside - Vec2::new(near[0] as f32, near[1] as f32);
    let fetch = |x: usize, y: usize| Vec4::from_slice(picture.pixel(x, y));
    let along_row = |y: usize| {
        let value = fetch(near[0], y);
        if weight.x != 0.0 { value + weight.x * (fetch(far[0], y) - value) } else { value }
    };
    let value = along_row(near[1]);
    if weight.y != 0.0 { value + weight.y * (along_row(far[1]) - value) } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_of_values_is_met_between_its_pixels_and_held_at_its_border() {
        let value = |x: f32, y: f32| 0.25 * x - 0.5 * y + 3.0;
        let picture = Plane::from_fn(5, 4, |x, y| [value(x as f32 + 0.5, y as f32 + 0.5), 1.0, 2.0, -1.0]);
        for (x, y) in [(2.2, 1.9), (0.5, 0.5), (4.5, 3.5), (0.5, 2.25), (1.75, 3.5)] {
            let mut clamped = false;
            let got = sample_bilinear(&picture, Vec2::new(x, y), &mut clamped);
            assert!((got.x - value(x, y)).abs() < 1e-6 && got.w == -1.0 && !clamped, "({x}, {y}): {got}");
        }
        for (x, y) in [(0.49, 2.0), (4.51, 2.0), (2.0, 0.0), (2.0, 9.0), (f32::NAN, 1.0)] {
            let mut clamped = false;
            sample_bilinear(&picture, Vec2::new(x, y), &mut clamped);
            assert!(clamped, "({x}, {y})");
        }
    }
}
