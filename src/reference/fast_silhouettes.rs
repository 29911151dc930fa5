//! `--method fast` where several surfaces are seen during the exposure. Twin of `glsl/fast_silhouettes.comp` and
//! `include/fast_silhouettes.glsl`.

use glam::{Vec2, Vec3};

use super::fast_claims::{NO_CLAIM, SlotClaims, slot_claims};
use super::fast_pixel::{Pixel, Task, blur_pairs};
use super::fast_push::{seed_key, seed_offset};
use super::fast_weight::worth;
use super::path::PathWeights;

/// Steps that lead from a claim to what it shows, and the last one's length, px, if it really lands there.
const FOLLOW_STEPS: u32 = 3;
const LANDED_PX: f32 = 0.5;
const BISECTIONS: u32 = 3;
/// Ratio of depths between which a silhouette lies; how far from it texels hold both surfaces, and how far that is
/// given way, px.
const OTHER_DEPTH: f32 = 1.15;
const SILHOUETTE_REACH_PX: f32 = 0.5;
const GIVE_WAY_PX: f32 = 0.5;
/// Most samples of a pixel.
const MAX_SILHOUETTE_SAMPLES: u32 = 64;
const QUARTERS: [Vec2; 4] =
    [Vec2::splat(-0.25), Vec2::splat(0.25), Vec2::new(0.25, -0.25), Vec2::new(-0.25, 0.25)];

/// What a claim shows at a place and instant.
struct Followed {
    source_px: Vec2,
    inverse_depth: f32,
    lands: bool,
}

fn squared(v: Vec2) -> f32 {
    v.x * v.x + v.y * v.y
}

fn inverse_depth_at(task: &Task<'_>, position_px: Vec2) -> f32 {
    let texel = task.inputs.paths.texel(position_px);
    task.inputs.inverse_depth.pixel(texel.x as usize, texel.y as usize)[0]
}

/// Between a place on the nearer surface and one on the farther: the first beyond the silhouette, by bisection, and
/// half a px more, because the texels at the edge hold both.
fn beside_silhouette(task: &Task<'_>, near_px: Vec2, far_px: Vec2, threshold: f32) -> Vec2 {
    let (mut a, mut b) = (near_px, far_px);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (a + b);
        if inverse_depth_at(task, middle) > threshold {
            a = middle;
        } else {
            b = middle;
        }
    }
    let way = far_px - near_px;
    b + way * (0.5 / squared(way).max(1e-6).sqrt()).min(1.0)
}

/// The claimed surface's source by fixed-point iteration. What does not land on `x_px` is hidden in the picture: the
/// iteration then swings between the surface that hides it and what is visible of its own, and the visible place
/// closest to the hidden one is taken.
fn follow(task: &Task<'_>, x_px: Vec2, from_px: Vec2, w: &PathWeights) -> Followed {
    let mut p = from_px;
    let mut before = p;
    for _ in 0..FOLLOW_STEPS {
        before = p;
        p = x_px - task.inputs.paths.nearest_displacement(p, w);
    }
    let depth = inverse_depth_at(task, p);
    if squared(p - before) < LANDED_PX * LANDED_PX {
        return Followed { source_px: p, inverse_depth: depth, lands: true };
    }
    let depth_before = inverse_depth_at(task, before);
    let (near_px, far_px) = if depth_before > depth { (before, p) } else { (p, before) };
    let source_px = beside_silhouette(task, near_px, far_px, 0.5 * (depth + depth_before));
    Followed { source_px, inverse_depth: depth.min(depth_before), lands: false }
}

/// Texels at a silhouette hold both surfaces, and where the nearer one has moved off they would show a seam of it: a
/// place so close gives way, not further than it has moved. Path images of one texel a px do not know the silhouette
/// well enough for that.
fn clear_of_seams(task: &Task<'_>, position_px: Vec2, w: &PathWeights) -> Vec2 {
    let paths = &task.inputs.paths;
    if paths.scale == 1 {
        return position_px;
    }
    let own = inverse_depth_at(task, position_px);
    let own_px = paths.nearest_displacement(position_px, w);
    let give_way = |x: f32, y: f32| {
        let towards = Vec2::new(x, y);
        let beside = position_px + SILHOUETTE_REACH_PX * towards;
        let moved = paths.nearest_displacement(beside, w) - own_px;
        let off = moved.x * towards.x + moved.y * towards.y;
        if inverse_depth_at(task, beside) > OTHER_DEPTH * own { off.clamp(0.0, GIVE_WAY_PX) } else { 0.0 }
    };
    position_px
        + Vec2::new(give_way(-1.0, 0.0) - give_way(1.0, 0.0), give_way(0.0, -1.0) - give_way(0.0, 1.0))
}

/// The nearest claimed surface that lands on a place, else the farthest that almost does; and whether one lands.
fn source_of(
    task: &Task<'_>,
    (at_px, aside_px): (Vec2, Vec2),
    w: &PathWeights,
    [middle, around]: [&SlotClaims; 2],
) -> (Vec2, bool) {
    let (mut nearest, mut farthest) = (-1.0, 3e38);
    let (mut source_px, mut beside_px) = (at_px, at_px);
    for key in [middle.nearest, middle.farthest, around.nearest, around.farthest] {
        if key == 0 || key == NO_CLAIM {
            continue;
        }
        let f = follow(task, at_px, at_px - aside_px + seed_offset(key).as_vec2(), w);
        if f.lands && f.inverse_depth > nearest {
            (nearest, source_px) = (f.inverse_depth, f.source_px);
        }
        if !f.lands && f.inverse_depth < farthest {
            (farthest, beside_px) = (f.inverse_depth, f.source_px);
        }
    }
    let lands = nearest >= 0.0;
    (clear_of_seams(task, if lands { source_px } else { beside_px }, w), lands)
}

/// Mean over the exposure: every sample, at a quarter of the pixel in turn, asks the claims of the exposure's middle
/// and of the end that is closer in time.
pub(super) fn blur_many_surfaces(task: &Task<'_>, pixel: &Pixel) -> [f32; 4] {
    let push = task.push;
    let blur = u32::from(push.slots > 1);
    let claims = |slot: u32| slot_claims(push, &task.seeds, slot, pixel.at);
    let (begin, mut middle, end) = (claims(0), claims(blur), claims(2 * blur));
    // How far the lens lets it look beside itself.
    let aside_px = pixel.x_px - (pixel.at.as_vec2() + 0.5 + push.margin());
    let moved = (seed_offset(begin.nearest) - seed_offset(end.nearest)).as_vec2();
    let count = match blur {
        0 => 4,
        _ => (2 * blur_pairs(push, moved.length())).clamp(8, MAX_SILHOUETTE_SAMPLES),
    };
    // In a gap too wide for any claim the search starts from the place itself.
    if middle.nearest.max(begin.nearest).max(end.nearest) == 0 {
        middle.nearest = seed_key(0.0, (aside_px + 0.5).floor().as_ivec2());
    }
    let (mut sum, mut clamped, mut landed) = (Vec3::ZERO, false, 0);
    for i in 0..count {
        let t = (i as f32 + 0.5) / count as f32;
        let at = pixel.from + t * pixel.span;
        let w = task.inputs.paths.weights(at, push.reference_knot, push.last_knot);
        let quarter = QUARTERS[i as usize % 4];
        let around = if t < 0.5 { &begin } else { &end };
        let (position, lands) = source_of(task, (pixel.x_px + quarter, aside_px), &w, [&middle, around]);
        landed += u32::from(lands);
        // The quarter decides who is seen. What is read is narrower, as bilinear texels have a width of their own; with
        // blur it stands for the whole pixel, because each quarter comes by too seldom to be a picture of its own.
        let centre_px = position - quarter;
        let aside = 4.0 * task.spread_px() * quarter;
        clamped |= task.is_beyond(centre_px);
        sum += match (blur, task.inputs.color_scale) {
            (0, 1) => task.read_between(position),
            (0, _) => task.read_between(centre_px + aside),
            _ => 0.5 * (task.read_between(centre_px + aside) + task.read_between(centre_px - aside)),
        };
    }
    let [r, g, b] = (sum / count as f32).to_array();
    let seen = landed as f32 / count as f32;
    [r, g, b, worth(task.inputs, (count as f32, clamped), seen * seen * seen * seen)]
}
