//! Frames of several pictures: what a warp of one of them counts in the mean over all. Twin of
//! `glsl/include/fast_weight.glsl`.

use glam::Vec2;

use super::fast_push::{Inputs, Push};

/// What a reading at a texel's centre is wrong by nonetheless, beside the (f (1 - f))^2 of one at a share f between
/// two.
const LEAST_ERROR: f32 = 0.003;
/// What is made up, or repeated beyond the border, counts where no picture has better.
const MADE_UP: f32 = 1e-4;

/// How near the picture is in time to the middle of a line's exposure: 1 at its own instant, 0 at those of the pictures
/// before and after it.
pub fn nearness_of(push: &Push, inputs: &Inputs<'_>, fraction: f32) -> f32 {
    if !inputs.one_of_several {
        return 1.0;
    }
    let at_s = push.start_s + push.readout_time_s * fraction + 0.5 * push.exposure_time_s;
    let before = (at_s - push.from_s) / (push.picture_s - push.from_s);
    let after = (push.to_s - at_s) / (push.to_s - push.picture_s);
    before.min(after).clamp(0.0, 1.0)
}

/// What a reading is worth that is blurred along a way: the nearer it runs to centres of texels, the less of the detail
/// across it is lost.
pub(super) fn sharpness(position_px: Vec2, way_px: Vec2) -> f32 {
    let place = position_px - 0.5;
    let f = place - place.floor();
    let off = f * (1.0 - f) / (1.0 + way_px * way_px);
    let share = LEAST_ERROR / (LEAST_ERROR + (off.x * off.x + off.y * off.y));
    share * share
}

/// The last number of a result: its samples, negative where one left the picture; or what it is worth.
pub(super) fn worth(inputs: &Inputs<'_>, (samples, clamped): (f32, bool), worth: f32) -> f32 {
    match (inputs.one_of_several, clamped) {
        (false, true) => -samples,
        (false, false) => samples,
        (true, true) => MADE_UP,
        (true, false) => worth.max(MADE_UP),
    }
}
