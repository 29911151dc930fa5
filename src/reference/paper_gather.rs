//! `--method paper`: rolling shutter and motion blur from one picture and up to six motion images (the paper's eq. 4 to
//! 7 and section 3.3, in seconds). Twin of `glsl/paper_gather.comp`.

use bytemuck::{Pod, Zeroable};
use glam::Vec2;
use rayon::prelude::*;

use super::motion::{MAX_MOTION_IMAGES, motion_at, motion_history, motion_integral, motion_texel};
use super::motion_blur::{Exposure, motion_blur};
use super::rolling_shutter::rolling_shutter;
use super::timing::readout_fraction;
use crate::plane::Plane;

/// The kernel's parameters. Times are relative to the reference instant, at which the picture was rendered.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Push {
    /// Width and height of the result, px.
    pub size: [u32; 2],
    /// How much more the picture and the motion images hold on every side, px.
    pub margin_px: [i32; 2],
    /// Start of exposure of the first line read, s.
    pub start_s: f32,
    /// N times the delay from line to line, s.
    pub readout_time_s: f32,
    /// How long every line integrates, s.
    pub exposure_time_s: f32,
    /// The time that the motion images' px refer to, s.
    pub frame_interval_s: f32,
    /// Time of the first motion image, s.
    pub first_motion_s: f32,
    /// Time from one motion image to the next, s; unused with one image.
    pub motion_step_s: f32,
    /// Number of motion images, 1 to 6.
    pub motion_count: u32,
    /// A [`super::timing::scan_order_code`].
    pub scan_order: u32,
    /// Most samples of the blur.
    pub max_samples: u32,
    /// 0: time by line (eq. 6). 1: also by the pixel's place within its line (eq. 1, 5).
    pub pixel_time: u32,
}

/// Asserts that [`Push`] is the push-constant block of a kernel that gathers like the paper's.
macro_rules! assert_gather_push {
    ($kernel:literal) => {
        $crate::assert_push_layout!(
            $kernel,
            GatherPush {
                size,
                margin_px,
                start_s,
                readout_time_s,
                exposure_time_s,
                frame_interval_s,
                first_motion_s,
                motion_step_s,
                motion_count,
                scan_order,
                max_samples,
                pixel_time
            }
        );
    };
}
pub(crate) use assert_gather_push;

/// What the sensor sees: shape `[height, width, 4]`; linear RGB and the number of samples, which is negative where one
/// of them left the picture (the margin was too small).
///
/// `color`: linear RGBA with margin. `motion`: images of the same size, two channels, px per frame interval.
///
/// # Panics
/// If a shape does not fit, or `motion` does not hold `push.motion_count` images.
pub fn paper_gather(push: &Push, color: &Plane<f32>, motion: &[Plane<f32>]) -> Plane<f32> {
    gather(push, color, motion, false)
}

/// As [`paper_gather`]; `integrated`: what a line sees has come the way that the motion says from the picture's instant
/// on.
pub(super) fn gather(push: &Push, color: &Plane<f32>, motion: &[Plane<f32>], integrated: bool) -> Plane<f32> {
    let count = (push.motion_count as usize).clamp(1, MAX_MOTION_IMAGES);
    assert!(motion.len() >= count, "{} motion images for a count of {count}", motion.len());
    let motion = &motion[..count];
    assert_eq!(color.channels, 4, "colour has four channels");
    for image in motion {
        assert_eq!(
            (image.width, image.height, image.channels),
            (color.width, color.height, 2),
            "motion image"
        );
    }
    let (width, height) = (push.size[0] as usize, push.size[1] as usize);
    let mut radiance = Plane::new(width, height, 4);
    radiance.data.par_chunks_mut((width * 4).max(1)).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(4).enumerate() {
            pixel.copy_from_slice(&gather_pixel(push, color, motion, ([x as u32, y as u32], integrated)));
        }
    });
    radiance
}

fn gather_pixel(
    push: &Push,
    color: &Plane<f32>,
    motion: &[Plane<f32>],
    (pixel, integrated): ([u32; 2], bool),
) -> [f32; 4] {
    // A single image has no step; any unit of time does.
    let step_s = if motion.len() > 1 { push.motion_step_s } else { push.frame_interval_s };
    let fraction = readout_fraction(pixel, push.size, push.scan_order, push.pixel_time != 0);
    let line_start_s = push.start_s + push.readout_time_s * fraction;
    let from = (line_start_s - push.first_motion_s) / step_s;
    let to = from + push.exposure_time_s / step_s;
    let exposure = Exposure { from, to, knot_frames: step_s / push.frame_interval_s };

    let margin = Vec2::new(push.margin_px[0] as f32, push.margin_px[1] as f32);
    let x_px = Vec2::new(pixel[0] as f32, pixel[1] as f32) + 0.5 + margin;
    let texel = motion_texel(x_px, [color.width, color.height]);
    let remapped_px = if integrated {
        let history = motion_history(motion, texel);
        let at = |knot: f32| motion_integral(&history, knot, motion.len());
        x_px - (at(from) - at(-push.first_motion_s / step_s)) * exposure.knot_frames
    } else {
        let motion_px = motion_at(motion, texel, from);
        rolling_shutter(x_px, line_start_s, push.frame_interval_s, motion_px)
    };
    motion_blur(color, motion, remapped_px, exposure, push.max_samples)
}
