// rolling_shutter as published: the remap of eq. 7. Twin: src/reference/rolling_shutter.rs.
#ifndef ROLLING_SHUTTER_GLSL
#define ROLLING_SHUTTER_GLSL

// Where the picture of the reference instant shows what position `x_px` sees `line_start_s` after that instant: content
// moves by +motion, so the gather reads at x - (s / T) motion. With the reference at the frame's start s / T is the
// paper's f, with the reference at mid-frame its f - 0.5.
vec2 rolling_shutter(vec2 x_px, float line_start_s, float frame_interval_s, vec2 motion_px) {
    precise float f = line_start_s / frame_interval_s;
    precise vec2 remapped = x_px - f * motion_px;
    return remapped;
}

#endif
