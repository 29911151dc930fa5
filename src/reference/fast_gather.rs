//! `--method fast`: rolling shutter and motion blur from one picture and the paths of what it shows. Twin of
//! `glsl/fast_gather.comp`, `include/fast_gather.glsl`, `include/fast_blur.glsl` and `include/pixel_area.glsl`;
//! [`super::fast_silhouettes`] does the pixels that see several surfaces.

use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::cubic::read_cubic;
use super::fast_claims::slot_claims;
use super::fast_pixel::{Pixel, Task, blur_pairs};
use super::fast_push::{Inputs, Push, seed_offset};
use super::fast_seeds::fast_seeds;
use super::fast_silhouettes::blur_many_surfaces;
use super::fast_weight::{nearness_of, sharpness, worth};
use super::timing::readout_fraction;
use crate::plane::Plane;

/// Share of a texel's two neighbours where the pixel's centre is the texel's.
const NEIGHBOURS_SHARE: f32 = 0.3125;

/// What the sensor sees: shape `[height, width, 4]`; linear RGB and the number of samples, which is negative where one
/// of them left the picture (the margin was too small).
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
    let seeds = if inputs.one_surface { Vec::new() } else { fast_seeds(push, inputs) };
    let task = Task { push, inputs, seeds };
    let mut radiance = Plane::new(width, height, 4);
    radiance.data.par_chunks_mut((width * 4).max(1)).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(4).enumerate() {
            pixel.copy_from_slice(&gather_pixel(&task, IVec2::new(x as i32, y as i32)));
        }
    });
    radiance
}

fn gather_pixel(task: &Task<'_>, at: IVec2) -> [f32; 4] {
    let push = task.push;
    let fraction = readout_fraction(at.as_uvec2().to_array(), push.size, push.scan_order, false);
    let near = nearness_of(push, task.inputs, fraction);
    if near <= 0.0 {
        return [0.0; 4];
    }
    let pixel = Pixel {
        at,
        x_px: task.inputs.looks_at(push, at),
        from: (push.start_s + push.readout_time_s * fraction) / push.knot_step_s + push.reference_knot as f32,
        span: push.exposure_time_s / push.knot_step_s,
    };
    let [r, g, b, worth] = match sources_over_exposure(task, &pixel) {
        Some(sources) => blur_one_surface(task, sources),
        None => blur_many_surfaces(task, &pixel),
    };
    [r, g, b, worth * near]
}

/// Whether a claim's whole px, and the px by which its parabola may be off, explain where a source lies.
fn is_claimed(key: u32, pixel_px: Vec2, source_px: Vec2) -> bool {
    (pixel_px + seed_offset(key).as_vec2() - source_px).abs().max_element() < 2.5
}

/// Where the reference picture shows what a pixel sees at begin, middle and end of its exposure, px; `None` where
/// several surfaces come by.
fn sources_over_exposure(task: &Task<'_>, pixel: &Pixel) -> Option<[Vec2; 3]> {
    let (push, paths, x_px) = (task.push, &task.inputs.paths, pixel.x_px);
    let blurs = push.slots > 1;
    let half_span = 0.5 * push.exposure_time_s / push.knot_step_s;
    let weights = |at: f32| paths.weights(at, push.reference_knot, push.last_knot);
    let sources = |block: IVec2| {
        let model = |at: f32| paths.block_displacement(block, &weights(at));
        let middle = model(pixel.from + half_span);
        let middle_px = middle.source(x_px);
        let other = |at: f32| if blurs { model(at).source(x_px) } else { middle_px };
        (middle.one_surface, [other(pixel.from), middle_px, other(pixel.from + 2.0 * half_span)])
    };
    if task.inputs.one_surface {
        let w = weights(pixel.from + half_span);
        let p = (0..2).fold(x_px, |p, _| x_px - paths.nearest_displacement(p, &w));
        return Some(sources(paths.block(p)).1);
    }
    let claims = |slot: u32| slot_claims(push, &task.seeds, slot, pixel.at);
    let middle = claims(u32::from(blurs));
    // Claims count from the pixel, wherever a lens lets it look.
    let pixel_px = pixel.at.as_vec2() + 0.5 + push.margin();
    let (one_surface, found) = sources(paths.block(pixel_px + seed_offset(middle.nearest).as_vec2()));
    if !(middle.agree && one_surface) {
        return None;
    }
    if !blurs {
        return Some(found);
    }
    let (begin, end) = (claims(0), claims(2));
    let claimed =
        is_claimed(begin.nearest, pixel_px, found[0]) && is_claimed(end.nearest, pixel_px, found[2]);
    (begin.agree && end.agree && claimed).then_some(found)
}

/// Mean of the picture over one px around a position: three texels an axis with the position as their mean. At a
/// pixel's centre the mean of its texels, to the bit.
fn read_pixel_area(task: &Task<'_>, position_px: Vec2, clamped: &mut bool) -> Vec3 {
    let color = task.inputs.color;
    if task.inputs.color_scale == 1 {
        return read_cubic(color, position_px, clamped);
    }
    let last = IVec2::new(color.width as i32 - 1, color.height as i32 - 1);
    let wanted = position_px * 2.0 - 0.5;
    let inside = wanted.clamp(Vec2::splat(0.5), last.as_vec2() - 0.5);
    *clamped |= inside != wanted;
    let middle = (inside + 0.5).as_ivec2().clamp(IVec2::ZERO, last);
    let v = inside - middle.as_vec2();
    let share = NEIGHBOURS_SHARE + (2.0 - 4.0 * NEIGHBOURS_SHARE) * (v * v);
    let weights = [0.5 * (share - v), 1.0 - share, 0.5 * (share + v)];
    let places = [(middle - 1).max(IVec2::ZERO), middle, (middle + 1).min(last)];
    let mut sum = Vec3::ZERO;
    for (row, down) in places.iter().zip(&weights) {
        let texel = |i: usize| Vec3::from_slice(color.pixel(places[i].x as usize, row.y as usize));
        let along = weights[0].x * texel(0) + weights[1].x * texel(1) + weights[2].x * texel(2);
        sum += down.y * along;
    }
    sum
}

/// Mean over the exposure along the parabola through three sources: no motion is read for it. Two samples a step of a
/// px, opposite each other.
fn blur_one_surface(task: &Task<'_>, [begin_px, middle_px, end_px]: [Vec2; 3]) -> [f32; 4] {
    if task.push.slots == 1 {
        // The pictures are read together.
        if task.inputs.one_of_several && !task.is_beyond(middle_px) {
            return [middle_px.x, middle_px.y, 0.0, -1.0];
        }
        let mut clamped = false;
        let [r, g, b] = read_pixel_area(task, middle_px, &mut clamped).to_array();
        return [r, g, b, worth(task.inputs, (1.0, clamped), 1.0)];
    }
    let chord = end_px - begin_px;
    let bend = 2.0 * (begin_px + end_px - 2.0 * middle_px);
    let pairs = blur_pairs(task.push, (middle_px - begin_px).length() + (end_px - middle_px).length());
    let way = chord.abs();
    let side = task.spread_px() * if way.x > way.y { Vec2::Y } else { Vec2::X };
    let ahead = Vec2::splat(task.spread_px()) - side;
    let (even, odd) = (side + ahead, side - ahead);
    let count = (2 * pairs) as f32;
    let apart = if pairs == 2 { 1.0 } else { 1.0 / (1.0 - 1.0 / (count * count)).sqrt() };
    let step = apart / count;
    let mut sum = Vec3::ZERO;
    for i in 0..2 * pairs {
        let t = (i as f32 + 0.5) * step - 0.5 * apart;
        let place = middle_px + t * (chord + t * bend);
        let aside = if i % 2 == 0 { even } else { odd };
        sum += task.read_between(place + aside) + task.read_between(place - aside);
    }
    let clamped = task.is_beyond(begin_px) || task.is_beyond(end_px);
    let [r, g, b] = (sum / (2.0 * count)).to_array();
    [r, g, b, worth(task.inputs, (count, clamped), sharpness(middle_px, way))]
}
