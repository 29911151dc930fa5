//! `motion_blur` as published (section 3.3, Fig. 4): the mean along the path through the motion images. Twin of
//! `glsl/include/motion_blur.glsl`.

use glam::{Vec2, Vec3};

use super::motion::{motion_history, motion_integral, motion_path_length, motion_texel};
use super::sample::sample_bilinear;
use crate::plane::Plane;

/// The exposure as places on the time axis of the motion images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Start, in knots.
    pub from: f32,
    /// End, in knots.
    pub to: f32,
    /// Time between knots, in frame intervals.
    pub knot_frames: f32,
}

/// Samples for a path: one a px, at least one. A thousandth of a px is let go, so that a path of a whole number of px
/// does not depend on rounding.
pub fn motion_blur_samples(path_px: f32, max_samples: u32) -> u32 {
    ((path_px - 0.001).ceil().min(max_samples as f32) as i32).max(1) as u32
}

/// Mean of `picture` over the exposure at the middles of equal spans of time; `x_px` is the position that is seen at
/// its start.
///
/// Returns linear RGB and the number of samples, which is negative where one was clamped to the picture.
pub fn motion_blur(
    picture: &Plane<f32>,
    motion: &[Plane<f32>],
    x_px: Vec2,
    exposure: Exposure,
    max_samples: u32,
) -> [f32; 4] {
    let Exposure { from, to, knot_frames } = exposure;
    let history = motion_history(motion, motion_texel(x_px, [picture.width, picture.height]));
    let path_px = motion_path_length(&history, from, to, motion.len()) * knot_frames;
    let count = motion_blur_samples(path_px, max_samples);
    let begin = motion_integral(&history, from, motion.len());
    let span = (to - from) / count as f32;
    let (mut sum, mut clamped) = (Vec3::ZERO, false);
    for i in 0..count {
        let knot = from + (i as f32 + 0.5) * span;
        let moved = (motion_integral(&history, knot, motion.len()) - begin) * knot_frames;
        let value = sample_bilinear(picture, x_px - moved, &mut clamped).truncate();
        // One sample is passed on as it is, so that neutral parameters return the input's bits.
        sum = if count == 1 { value } else { sum + value };
    }
    let mean = if count == 1 { sum } else { sum / count as f32 };
    let samples = if clamped { -(count as f32) } else { count as f32 };
    [mean.x, mean.y, mean.z, samples]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_follow_the_path() {
        let samples =
            [0.0, 0.3, 1.0, 1.01, 20.000_002, 1000.0, f32::NAN].map(|px| motion_blur_samples(px, 240));
        assert_eq!(samples, [1, 1, 1, 2, 20, 240, 240]);
        assert_eq!(motion_blur_samples(20.0, 0), 1);
    }
}
