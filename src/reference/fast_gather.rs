//! `--method fast`: rolling shutter and motion blur from one picture and the paths of what it shows. Twin of
//! `glsl/fast_gather.comp` with `fast_areas.comp`, `include/fast_gather.glsl`, `include/fast_blur.glsl` and
//! `include/pixel_area.glsl`; [`super::fast_silhouettes`] does the pixels that see several surfaces.

use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::fast_claims::slot_claims;
use super::fast_push::{Inputs, Push, seed_offset};
use super::fast_seeds::fast_seeds;
use super::fast_silhouettes::blur_many_surfaces;
use super::sample::sample_bilinear;
use super::timing::readout_fraction;
use crate::plane::Plane;

/// Everything that a pixel asks.
pub(super) struct Task<'a> {
    pub(super) push: &'a Push,
    pub(super) inputs: &'a Inputs<'a>,
    pub(super) seeds: Vec<u32>,
    /// Means over a px at every texel.
    pub(super) areas: Plane<f32>,
}

/// A pixel's place and time.
#[derive(Clone, Copy)]
pub(super) struct Pixel {
    pub(super) at: IVec2,
    /// In the picture with its margin.
    pub(super) x_px: Vec2,
    /// Begin and duration of its exposure, in knots.
    pub(super) from: f32,
    pub(super) span: f32,
}

/// What the sensor sees: shape `[height, width, 4]`; linear RGB and the number of samples, which is negative where one of
/// them left the picture (the margin was too small).
///
/// # Panics
/// If a shape does not fit.
pub fn fast_gather(push: &Push, inputs: &Inputs<'_>) -> Plane<f32> {
    let (width, height) = (push.size[0] as usize, push.size[1] as usize);
    let full =
        |side: usize, scale: usize| (push.size[side] as usize + 2 * push.margin_px[side] as usize) * scale;
    let shape = (inputs.color.width, inputs.color.height, inputs.color.channels);
    assert_eq!(shape, (full(0, inputs.color_scale), full(1, inputs.color_scale), 4), "colour");
    for image in inputs.paths.images {
        let scale = inputs.paths.scale;
        assert_eq!(
            (image.width, image.height, image.channels),
            (full(0, scale), full(1, scale), 4),
            "path image"
        );
    }
    let areas = if inputs.color_scale == 2 { fast_areas(inputs.color) } else { inputs.color.clone() };
    let task = Task { push, inputs, seeds: fast_seeds(push, inputs), areas };
    let mut radiance = Plane::new(width, height, 4);
    radiance.data.par_chunks_mut((width * 4).max(1)).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(4).enumerate() {
            pixel.copy_from_slice(&gather_pixel(&task, IVec2::new(x as i32, y as i32)));
        }
    });
    radiance
}

/// The mean of the picture over one px at every half px.
fn fast_areas(color: &Plane<f32>) -> Plane<f32> {
    Plane::from_fn(color.width, color.height, |x, y| {
        let far = [(x + 1).min(color.width - 1), (y + 1).min(color.height - 1)];
        let (a, b) = (color.pixel(x, y), color.pixel(far[0], y));
        let (c, d) = (color.pixel(x, far[1]), color.pixel(far[0], far[1]));
        [0, 1, 2, 3].map(|i| 0.25 * ((a[i] + b[i]) + (c[i] + d[i])))
    })
}

fn gather_pixel(task: &Task<'_>, at: IVec2) -> [f32; 4] {
    let push = task.push;
    let fraction = readout_fraction(at.as_uvec2().to_array(), push.size, push.scan_order, false);
    let pixel = Pixel {
        at,
        x_px: at.as_vec2() + 0.5 + IVec2::from(push.margin_px).as_vec2(),
        from: (push.start_s + push.readout_time_s * fraction) / push.knot_step_s + push.reference_knot as f32,
        span: push.exposure_time_s / push.knot_step_s,
    };
    match sources_over_exposure(task, &pixel) {
        Some(sources) => blur_one_surface(task, sources),
        None => blur_many_surfaces(task, &pixel),
    }
}

/// Whether a claim's whole px, and the px by which its parabola may be off, explain the distance.
fn is_claimed(key: u32, x_px: Vec2, source_px: Vec2) -> bool {
    (x_px + seed_offset(key).as_vec2() - source_px).abs().max_element() < 2.5
}

/// Where the reference picture shows what a pixel sees at begin, middle and end of its exposure, px; `None` where several
/// surfaces come by.
fn sources_over_exposure(task: &Task<'_>, pixel: &Pixel) -> Option<[Vec2; 3]> {
    let (push, paths, x_px) = (task.push, &task.inputs.paths, pixel.x_px);
    let claims = |slot: u32| slot_claims(push, &task.seeds, slot, pixel.at);
    let half_span = 0.5 * push.exposure_time_s / push.knot_step_s;
    let middle = claims(u32::from(push.slots > 1));
    let block = paths.block(x_px + seed_offset(middle.nearest).as_vec2());
    let model =
        |at: f32| paths.block_displacement(block, &paths.weights(at, push.reference_knot, push.last_knot));
    let at_middle = model(pixel.from + half_span);
    let middle_px = at_middle.source(x_px);
    if !(middle.agree && at_middle.one_surface) {
        return None;
    }
    if push.slots == 1 {
        return Some([middle_px; 3]);
    }
    let (begin, end) = (claims(0), claims(2));
    let begin_px = model(pixel.from).source(x_px);
    let end_px = model(pixel.from + 2.0 * half_span).source(x_px);
    let claimed = is_claimed(begin.nearest, x_px, begin_px) && is_claimed(end.nearest, x_px, end_px);
    (begin.agree && end.agree && claimed).then_some([begin_px, middle_px, end_px])
}

/// Mean of the picture over one px around a position. At a pixel's centre: the mean of its texels, to the bit.
fn read_pixel_area(task: &Task<'_>, position_px: Vec2, clamped: &mut bool) -> Vec3 {
    let (color, scale) = (task.inputs.color, task.inputs.color_scale);
    let size = [color.width, color.height];
    let wanted = (position_px - 0.5) * scale as f32;
    let inside = wanted.clamp(Vec2::ZERO, Vec2::new((size[0] - scale) as f32, (size[1] - scale) as f32));
    *clamped |= inside != wanted;
    let near = [inside.x as usize, inside.y as usize];
    let f = inside - Vec2::new(near[0] as f32, near[1] as f32);
    let mut sum = Vec3::ZERO;
    for y in 0..=scale {
        let row = (near[1] + y).min(size[1] - 1);
        let texel = |x: usize| Vec3::from_slice(color.pixel((near[0] + x).min(size[0] - 1), row));
        let mut along = (1.0 - f.x) * texel(0);
        for x in 1..scale {
            along += texel(x);
        }
        along += f.x * texel(scale);
        let weight = if y == 0 {
            1.0 - f.y
        } else if y == scale {
            f.y
        } else {
            1.0
        };
        sum += weight * along;
    }
    sum / (scale as f32 * scale as f32)
}

/// Samples for a path, px: steps of at most a px, both ends included.
pub(super) fn blur_samples(push: &Push, path_px: f32) -> u32 {
    if path_px < 0.02 { 1 } else { ((path_px - 0.001).ceil() + 1.0).min(push.max_samples as f32) as u32 }
}

/// Mean over the exposure along the parabola through three sources: no motion is read for it.
fn blur_one_surface(task: &Task<'_>, [begin_px, middle_px, end_px]: [Vec2; 3]) -> [f32; 4] {
    let mut clamped = false;
    if task.push.slots == 1 {
        let [r, g, b] = read_pixel_area(task, middle_px, &mut clamped).to_array();
        return [r, g, b, if clamped { -1.0 } else { 1.0 }];
    }
    let chord = end_px - begin_px;
    let bend = 2.0 * (begin_px + end_px - 2.0 * middle_px);
    let length = |v: Vec2| (v.x * v.x + v.y * v.y).sqrt();
    let count = blur_samples(task.push, length(middle_px - begin_px) + length(end_px - middle_px));
    let mut sum = Vec3::ZERO;
    for i in 0..count {
        let t = (i as f32 + 0.5) / count as f32 - 0.5;
        let area = middle_px + t * (chord + t * bend) - 0.5;
        let texel = area * task.inputs.color_scale as f32 + 0.5;
        sum += sample_bilinear(&task.areas, texel, &mut clamped).truncate();
    }
    let [r, g, b] = (sum / count as f32).to_array();
    [r, g, b, if clamped { -(count as f32) } else { count as f32 }]
}
