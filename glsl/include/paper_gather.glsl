// The gather of paper_gather.comp and, with INTEGRATED, of outside_gather.comp. Twin: src/reference/paper_gather.rs.
layout(local_size_x = 16, local_size_y = 8) in;

// Number of motion images where it is known: what there are fewer of is compiled out. Changes no bit.
layout(constant_id = 0) const int MOTION_COUNT = 0;

// Linear radiance at the reference instant, with `margin_px` more on every side.
layout(set = 0, binding = 0) uniform sampler2D color;
// px per frame interval, same size as `color`; layer k belongs to first_motion_s + k motion_step_s.
layout(set = 0, binding = 1, rg32f) uniform readonly image2DArray motion;
// RGB: linear radiance. A: number of samples, negative where one left `color` (the margin was too small).
layout(set = 0, binding = 2, rgba32f) uniform writeonly image2D radiance;

layout(push_constant) uniform Push {
#include "paper_push.glsl"
} push;

#include "timing.glsl"
#include "motion.glsl"
#include "sample.glsl"
#include "rolling_shutter.glsl"
#include "motion_blur.glsl"

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    int motion_count = MOTION_COUNT != 0 ? MOTION_COUNT : clamp(int(push.motion_count), 1, MAX_MOTION_IMAGES);
    // A single image has no step; any unit of time does.
    float step_s = motion_count > 1 ? push.motion_step_s : push.frame_interval_s;
    float fraction = readout_fraction(pixel, push.size, push.scan_order, push.pixel_time);
    precise float line_start_s = push.start_s + push.readout_time_s * fraction;
    precise float from = (line_start_s - push.first_motion_s) / step_s;
    precise float to = from + push.exposure_time_s / step_s;
    precise float knot_frames = step_s / push.frame_interval_s;

    precise vec2 x_px = vec2(pixel) + 0.5 + vec2(push.margin_px);
#ifdef INTEGRATED
    vec2 history[MAX_MOTION_IMAGES];
    motion_history(motion_texel(x_px, textureSize(color, 0)), motion_count, history);
    precise float color_knot = -push.first_motion_s / step_s;
    precise vec2 come = motion_integral(history, from, motion_count)
        - motion_integral(history, color_knot, motion_count);
    precise vec2 remapped_px = x_px - come * knot_frames;
#else
    vec2 motion_px = motion_at(motion_texel(x_px, textureSize(color, 0)), from, motion_count);
    vec2 remapped_px = rolling_shutter(x_px, line_start_s, push.frame_interval_s, motion_px);
#endif
    vec4 seen = motion_blur(color, remapped_px, from, to, knot_frames, motion_count, int(push.max_samples));
    imageStore(radiance, ivec2(pixel), seen);
}
