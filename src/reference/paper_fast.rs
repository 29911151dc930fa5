//! The paper's gather for speed. Twin of `glsl/include/paper_fast.glsl` and its three ways to read a texel.

use glam::Vec2;
use rayon::prelude::*;

use super::motion::{MAX_MOTION_IMAGES, motion_at, motion_history, motion_integral, motion_texel};
use super::paper_gather::Push;
use super::timing::readout_fraction;
use crate::plane::Plane;

/// How a place between texels is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tap {
    /// Bilinear.
    Bilinear,
    /// The texel that holds the place.
    Nearest,
}

/// The constants of a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Way {
    /// How it reads.
    pub tap: Tap,
    /// Taps for each px of the path.
    pub taps_per_px: f32,
    /// Counts are multiples of this.
    pub unroll: u32,
}

/// What the sensor sees: shape `[height, width, 4]`; linear RGB and the number of samples, which is negative where the
/// path left the picture. Arguments as for [`super::paper_gather::paper_gather`].
///
/// # Panics
/// If `motion` does not hold `push.motion_count` images.
pub fn paper_fast(push: &Push, way: Way, color: &Plane<f32>, motion: &[Plane<f32>]) -> Plane<f32> {
    let count = (push.motion_count as usize).clamp(1, MAX_MOTION_IMAGES);
    let motion = &motion[..count];
    let (width, height) = (push.size[0] as usize, push.size[1] as usize);
    let mut radiance = Plane::new(width, height, 4);
    radiance.data.par_chunks_mut((width * 4).max(1)).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(4).enumerate() {
            pixel.copy_from_slice(&gather_pixel(push, way, color, motion, [x as u32, y as u32]));
        }
    });
    radiance
}

fn gather_pixel(
    push: &Push,
    way: Way,
    color: &Plane<f32>,
    motion: &[Plane<f32>],
    pixel: [u32; 2],
) -> [f32; 4] {
    let step_s = if motion.len() > 1 { push.motion_step_s } else { push.frame_interval_s };
    let fraction = readout_fraction(pixel, push.size, push.scan_order, push.pixel_time != 0);
    let line_start_s = push.start_s + push.readout_time_s * fraction;
    let from = (line_start_s - push.first_motion_s) / step_s;
    let to = from + push.exposure_time_s / step_s;
    let margin = Vec2::new(push.margin_px[0] as f32, push.margin_px[1] as f32);
    let x_px = Vec2::new(pixel[0] as f32, pixel[1] as f32) + 0.5 + margin;
    let size = [color.width, color.height];
    let motion_px = motion_at(motion, motion_texel(x_px, size), from);
    let remapped_px = x_px - (line_start_s / push.frame_interval_s) * motion_px;
    let history = motion_history(motion, motion_texel(remapped_px, size));
    let integral = |knot: f32| motion_integral(&history, knot, motion.len());
    let knot_frames = step_s / push.frame_interval_s;
    let begin = integral(from);
    let (middle, whole) =
        ((integral(0.5 * (from + to)) - begin) * knot_frames, (integral(to) - begin) * knot_frames);
    mean_of_path(push, way, color, remapped_px, [middle, whole])
}

/// Mean along the parabola from `x_px` through the displacements at the middle and the end.
fn mean_of_path(
    push: &Push,
    way: Way,
    color: &Plane<f32>,
    x_px: Vec2,
    [middle, whole]: [Vec2; 2],
) -> [f32; 4] {
    let path_px = middle.length() + (whole - middle).length();
    let last = Vec2::new(color.width as f32, color.height as f32) - 1.0;
    let inside = |p: Vec2| p.clamp(Vec2::ONE, last);
    let (begin_px, end_px) = (inside(x_px), inside(x_px - whole));
    let mut middle_px = x_px - middle;
    let left = begin_px != x_px || end_px != x_px - whole || inside(middle_px) != middle_px;
    if left {
        middle_px = 0.5 * (begin_px + end_px);
    }
    let wanted = (path_px * way.taps_per_px - 0.001).ceil().min(push.max_samples as f32) as i32;
    let count = (wanted.max(1) as u32).div_ceil(way.unroll) * way.unroll;
    let a = 4.0 * middle_px - 3.0 * begin_px - end_px;
    let b = 2.0 * (begin_px + end_px) - 4.0 * middle_px;
    let h = 1.0 / count as f32;
    let mut at = begin_px + (0.5 * h) * (a + (0.5 * h) * b);
    let mut along = h * (a + (2.0 * h) * b);
    let bend = (2.0 * h * h) * b;
    let mut sum = glam::Vec3::ZERO;
    for _ in 0..count {
        sum += tap(way.tap, color, at);
        at += along;
        along += bend;
    }
    let mean = sum * h;
    [mean.x, mean.y, mean.z, if left { -(count as f32) } else { count as f32 }]
}

fn tap(tap: Tap, color: &Plane<f32>, at: Vec2) -> glam::Vec3 {
    let texel = |x: usize, y: usize| {
        glam::Vec3::from_slice(color.pixel(x.min(color.width - 1), y.min(color.height - 1)))
    };
    if tap == Tap::Nearest {
        return texel(at.x as usize, at.y as usize);
    }
    let corner = at - 0.5;
    let (x, y) = (corner.x as usize, corner.y as usize);
    let weight = corner - Vec2::new(x as f32, y as f32);
    let row = |y: usize| texel(x, y).lerp(texel(x + 1, y), weight.x);
    row(y).lerp(row(y + 1), weight.y)
}
