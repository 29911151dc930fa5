//! `rolling_shutter` as published: the remap of eq. 7. Twin of `glsl/include/rolling_shutter.glsl`.

use glam::Vec2;

/// Where the picture of the reference instant shows what position `x_px` sees `line_start_s` after that instant.
///
/// Content moves by +motion (px per frame interval), so the gather reads at x - (s / T) motion. With the reference at
/// the frame's start s / T is the paper's f, with the reference at mid-frame its f - 0.5 (section 3.2).
pub fn rolling_shutter(x_px: Vec2, line_start_s: f32, frame_interval_s: f32, motion_px: Vec2) -> Vec2 {
    let f = line_start_s / frame_interval_s;
    x_px - f * motion_px
}
