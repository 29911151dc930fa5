//! Frames of several pictures: what a warp of one of them counts in the mean over all. Twin of `glsl/include/fast_weight.glsl`.

use glam::Vec2;

use super::fast_push::{Inputs, Push};

/// What a reading at a texel's centre is wrong by nonetheless, beside the (f (1 - f))^2 of one at a share f between two.
const LEAST_ERROR: f32 = 0.004;
/// What is made up, or repeated beyond the border, counts where no picture has better.
const MADE_UP: f32 = 1e-4;

/// How near the picture is in time to the middle of a line's exposure: 1 at its own instant, 0 at those of the pictures before
/// and after it.
pub fn nearness_of(push: &Push, inputs: &Inputs<'_>, fraction: f32) -> f32 {
    if !inputs.one_of_several {
        return 1.0;
    }
    let at_s = push.start_s + push.readout_time_s * fraction + 0.5 * push.exposure_time_s;
    let before = (at_s - push.from_s) / (push.picture_s - push.from_s);
    let after = (push.to_s - at_s) / (push.to_s - push.picture_s);
    before.min(after).clamp(0.0, 1.0)
}

/// What a sharp reading is worth: the nearer to a texel's centre, the less of the detail is lost.
fn sharpness(position_px: Vec2) -> f32 {
    let place = position_px - 0.5;
    let f = place - place.floor();
    let off = f * (1.0 - f);
    LEAST_ERROR / (LEAST_ERROR + (off.x * off.x + off.y * off.y))
}

/// The last number of a result: its samples, negative where one left the picture; or what it counts. `seen`: share of the
/// samples that the picture shows.
pub(super) fn worth(
    (push, inputs): (&Push, &Inputs<'_>),
    (samples, clamped): (f32, bool),
    seen: f32,
    place_px: Vec2,
) -> f32 {
    if !inputs.one_of_several {
        return if clamped { -samples } else { samples };
    }
    let sharp = if push.slots > 1 { 1.0 } else { sharpness(place_px) };
    if clamped { MADE_UP } else { (seen * seen * seen * seen * sharp).max(MADE_UP) }
}
