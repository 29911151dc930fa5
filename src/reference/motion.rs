//! Motion images and what lies between them in time (the paper's eq. 4, for up to six). Twin of
//! `glsl/include/motion.glsl`.
//!
//! Values are px per frame interval. Place k on the time axis ("knot") is image k; before the first and after the last
//! image the motion stays as it is there.

use glam::Vec2;

use crate::plane::Plane;

/// Most motion images that are kept for a frame (the paper, section 3).
pub const MAX_MOTION_IMAGES: usize = 6;

/// The motion of one texel in all images; the last one fills the rest.
pub type History = [Vec2; MAX_MOTION_IMAGES];

/// The texel (x, y) that holds a position, px. Motion is never averaged in space: between two objects' motions lies
/// nobody's.
pub fn motion_texel(position_px: Vec2, image_size: [usize; 2]) -> [usize; 2] {
    let last = Vec2::new((image_size[0] - 1) as f32, (image_size[1] - 1) as f32);
    let inside = position_px.floor().clamp(Vec2::ZERO, last);
    [inside.x as usize, inside.y as usize]
}

fn load(image: &Plane<f32>, texel: [usize; 2]) -> Vec2 {
    Vec2::from_slice(image.pixel(texel[0], texel[1]))
}

/// Motion of one texel at place `knot` of the time axis: eq. 4 between the two neighbouring images.
///
/// # Panics
/// Without images, or if they do not have two channels.
pub fn motion_at(images: &[Plane<f32>], texel: [usize; 2], knot: f32) -> Vec2 {
    let last = images.len() - 1;
    let inside = knot.clamp(0.0, last as f32);
    let before = (inside as usize).min(last);
    let after = (before + 1).min(last);
    let weight = inside - before as f32;
    let (a, b) = (load(&images[before], texel), load(&images[after], texel));
    a + weight * (b - a)
}

/// The motion of one texel in all images.
pub fn motion_history(images: &[Plane<f32>], texel: [usize; 2]) -> History {
    std::array::from_fn(|k| load(&images[k.min(images.len() - 1)], texel))
}

/// Integral of the motion from knot 0 to `knot`: the closed form of a piecewise linear velocity.
pub fn motion_integral(history: &History, knot: f32, motion_count: usize) -> Vec2 {
    let mut sum = knot.min(0.0) * history[0];
    for k in 0..motion_count - 1 {
        let h = (knot - k as f32).clamp(0.0, 1.0);
        sum += h * (history[k] + 0.5 * h * (history[k + 1] - history[k]));
    }
    sum + (knot - (motion_count - 1) as f32).max(0.0) * history[MAX_MOTION_IMAGES - 1]
}

fn motion_length(v: Vec2) -> f32 {
    (v.x * v.x + v.y * v.y).sqrt()
}

/// Length of the path from knot `from` to knot `to`. Between two images the speed is taken as linear; it is convex, so
/// this is never less than the true length, and equal to it where the motion keeps its direction.
pub fn motion_path_length(history: &History, from: f32, to: f32, motion_count: usize) -> f32 {
    let last = (motion_count - 1) as f32;
    let mut sum = (to.min(0.0) - from).max(0.0) * motion_length(history[0]);
    for k in 0..motion_count - 1 {
        let a = (from - k as f32).clamp(0.0, 1.0);
        let b = (to - k as f32).clamp(0.0, 1.0);
        let slope = history[k + 1] - history[k];
        let (va, vb) = (history[k] + a * slope, history[k] + b * slope);
        sum += (b - a) * (0.5 * (motion_length(va) + motion_length(vb)));
    }
    sum + (to - from.max(last)).max(0.0) * motion_length(history[MAX_MOTION_IMAGES - 1])
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    fn images(values: &[[f32; 2]]) -> Vec<Plane<f32>> {
        values.iter().map(|&v| Plane::from_fn(1, 1, |_, _| v)).collect()
    }

    #[test]
    fn the_integral_is_that_of_the_interpolated_motion() {
        for count in 1..=MAX_MOTION_IMAGES {
            let values: Vec<[f32; 2]> =
                (0..count).map(|k| [(k * k) as f32 - 3.0, 5.0 - 2.0 * k as f32]).collect();
            let images = images(&values);
            let history = motion_history(&images, [0, 0]);
            let (mut want, mut length, step) = (DVec2::ZERO, 0.0_f64, 1e-3);
            // From a knot before the first image to one after the last.
            for i in 0..8000 {
                let v = motion_at(&images, [0, 0], -1.0 + (i as f32 + 0.5) * 1e-3).as_dvec2();
                want += step * v;
                length += step * v.length();
            }
            let got = motion_integral(&history, 7.0, count) - motion_integral(&history, -1.0, count);
            assert!((got.as_dvec2() - want).length() < 1e-3, "{count} images: {got} for {want}");
            let path = f64::from(motion_path_length(&history, -1.0, 7.0, count));
            assert!(path > length - 1e-2 && path < 1.2 * length, "{count} images: {path} for {length}");
            // Control: the first image's motion held for the whole time is another path.
            assert!(count == 1 || (got - 8.0 * history[0]).length() > 0.5);
        }
    }

    #[test]
    fn texels_hold_positions_and_never_leave_the_image() {
        let size = [4, 3];
        assert_eq!(motion_texel(Vec2::new(1.999, 2.0), size), [1, 2]);
        assert_eq!(motion_texel(Vec2::new(-0.1, 3.0), size), [0, 2]);
        assert_eq!(motion_texel(Vec2::new(1e30, f32::NEG_INFINITY), size), [3, 0]);
        assert_eq!(motion_texel(Vec2::NAN, size), [0, 0]);
    }
}
