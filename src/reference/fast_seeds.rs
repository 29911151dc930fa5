//! `--method fast`, first part: every texel of the reference picture finds the line that sees it, and lays claim to the
//! pixel it lands on. What is nearest keeps it. Twin of `glsl/fast_seeds.comp`.

use glam::{IVec2, Vec2};

use super::fast_push::{Inputs, Push, SEED_REACH_PX, seed_key};
use crate::camera::ScanOrder;

/// The claims: one a destination pixel and slot, 0 where nothing lands (see [`Push::seed_index`]).
pub fn fast_seeds(push: &Push, inputs: &Inputs<'_>) -> Vec<u32> {
    let [width, height] = push.size.map(|s| s as i32);
    let mut seeds = vec![0; (4 * width * height) as usize];
    for y in 0..height + 2 * push.margin_px[1] {
        for x in 0..width + 2 * push.margin_px[0] {
            claim(push, inputs, IVec2::new(x, y), &mut seeds);
        }
    }
    seeds
}

/// Fraction of the readout at which the line through a position is read, continuous and limited to the picture.
fn fraction_at(push: &Push, position_px: Vec2) -> f32 {
    let order = ScanOrder::ALL[push.scan_order as usize];
    let backwards = matches!(order, ScanOrder::BottomToTop | ScanOrder::RightToLeft);
    let axis = usize::from(order.lines_are_rows());
    let (place, count) = (position_px[axis], push.size[axis] as f32);
    let line = (if backwards { count - place } else { place }) - 0.5;
    line.clamp(0.0, count - 1.0) / count
}

/// The parabola through begin, reference and end of what path images say: bend t^2 + slope t, t in knots from the
/// reference.
fn parabola_of(push: &Push, inputs: &Inputs<'_>, texel: IVec2) -> [Vec2; 2] {
    let reference = push.reference_knot as f32;
    let after = push.last_knot as f32 - reference;
    let layer = |k: usize| inputs.paths.knots(k / 2, texel)[k % 2];
    let first_px = if reference > 0.0 { layer(0) } else { Vec2::ZERO };
    let last_px = if after > 0.0 { layer(push.last_knot as usize - 1) } else { Vec2::ZERO };
    let slope = if after > 0.0 { last_px / after } else { -first_px / reference.max(1.0) };
    if reference > 0.0 && after > 0.0 {
        let bend = (last_px / after + first_px / reference) / (after + reference);
        return [bend, last_px / after - bend * after];
    }
    [Vec2::ZERO, slope]
}

/// What moves nearly as fast as the lines are read lands nowhere certain: least of 1 - its speed over theirs.
const LEAST_APART: f32 = 0.3;

/// When the lines of a slot are read: time = begin + lines fraction; and how far the lens moves a texel where it is.
struct Traced {
    bent_px: Vec2,
    begin: f32,
    lines: f32,
}

/// Where a pinhole shows what a texel at `at_px` does by the time of the line that it lands on, from a place near
/// there: the path is read at the time of that place's line, and followed straight on from there (a Newton step).
/// `motion`: displacement at a time, and its change a knot.
fn lands_by_depth(
    push: &Push,
    traced: &Traced,
    (at_px, near_px): (Vec2, Vec2),
    motion: impl Fn(f32) -> [Vec2; 2],
) -> Vec2 {
    let order = ScanOrder::ALL[push.scan_order as usize];
    let axis = usize::from(order.lines_are_rows());
    let sign = if matches!(order, ScanOrder::BottomToTop | ScanOrder::RightToLeft) { -1.0 } else { 1.0 };
    // The lens moves it by another bit there than where it came from: that is a fraction of the way, in the time of
    // which nothing moves far.
    let fraction = fraction_at(push, near_px + traced.bent_px);
    let [moved_px, rate_px] = motion(traced.begin + traced.lines * fraction);
    let shown_px = at_px + moved_px;
    let count = push.size[axis] as f32;
    // Fractions of the readout that it is behind its line, and that it moves by in all of the readout.
    let over_px = rate_px * traced.lines;
    let off = sign * (shown_px - near_px)[axis] / count;
    let over = sign * over_px[axis] / count;
    let late = off / (1.0 - over).max(LEAST_APART);
    // No line is read before the first and after the last.
    shown_px + over_px * late.clamp(-fraction, (count - 1.0) / count - fraction)
}

fn claim(push: &Push, inputs: &Inputs<'_>, source: IVec2, seeds: &mut [u32]) {
    let paths = &inputs.paths;
    let texel = source * paths.scale as i32;
    let margin = IVec2::from(push.margin_px);
    let at_px = (texel.as_vec2() + 0.5) / paths.scale as f32 - margin.as_vec2();
    let [bend, slope] = match paths.from_depth {
        Some(_) => [Vec2::ZERO; 2],
        None => parabola_of(push, inputs, texel),
    };
    let depth = inputs.inverse_depth.pixel(texel.x as usize, texel.y as usize)[0];
    let mut lands_px = inputs.on_sensor(push, at_px);
    let (bent_px, mut shown_px) = (lands_px - at_px, at_px);
    for slot in 0..push.slots {
        let begin = (push.start_s + push.slot_fraction(slot) * push.exposure_time_s) / push.knot_step_s;
        let lines = push.readout_time_s / push.knot_step_s;
        if paths.from_depth.is_some() {
            let motion = |t: f32| {
                let motion = paths.depth_motion(texel, t + push.reference_knot as f32);
                motion.expect("paths from depth")
            };
            let traced = Traced { bent_px, begin, lines };
            shown_px = lands_by_depth(push, &traced, (at_px, shown_px), motion);
            lands_px = inputs.on_sensor(push, shown_px);
        } else {
            // The line moves with the point; later slots start from where the one before it landed.
            let next = |px: Vec2| {
                let t = begin + lines * fraction_at(push, px);
                inputs.on_sensor(push, at_px + t * (slope + t * bend))
            };
            lands_px = (0..if slot == 0 { 4 } else { 2 }).fold(lands_px, |px, _| next(px));
        }
        let size = Vec2::new(push.size[0] as f32, push.size[1] as f32);
        if lands_px.cmplt(Vec2::ZERO).any() || !lands_px.cmplt(size).all() {
            continue;
        }
        let pixel = lands_px.floor().as_ivec2();
        let offset = source - margin - pixel;
        if offset.abs().max_element() <= SEED_REACH_PX {
            let seed = &mut seeds[push.seed_index(slot, pixel)];
            *seed = (*seed).max(seed_key(depth, offset));
        }
    }
}
