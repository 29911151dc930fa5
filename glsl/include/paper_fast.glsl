// The paper's gather (section 3: remap and blur) for speed, with the pixel chain behind it where that reads no
// neighbours. The path over the exposure is the parabola through its begin, middle and end: exact for up to two motion
// images, and two additions a step. Twin: src/reference/paper_fast.rs. The includer defines `vec3 tap(vec2
// position_px)`.
//
// TAPS_PER_PX 1 reads every px of the path; 0.5 every second one, which bilinear reading covers as well. UNROLL taps
// are read a round: lavapipe runs every loop at least once and both sides of every branch, so a path is cut into a
// multiple of it.
layout(local_size_x = 64, local_size_y = 1) in;

layout(constant_id = 40) const float TAPS_PER_PX = 0.5;
layout(constant_id = 41) const int UNROLL = 2;
// 0: `radiance`; 1: developed by the pixel chain, to `Pixels`.
layout(constant_id = 42) const uint DEVELOP = 0u;
// The count does not follow the path: the paper's other choice, to measure against.
layout(constant_id = 43) const uint FIXED_COUNT = 0u;
// Number of motion images where it is known: what there are fewer of is compiled out.
layout(constant_id = 44) const int MOTION_COUNT = 0;

#define CHAIN_PUSH
layout(push_constant) uniform Push {
#include "paper_push.glsl"
    // Of the pixel chain.
    uvec2 seed;
    uint frame;
    uint flags;
    uint slot;
} push;

// px per frame interval, same size as the colour; layer k belongs to first_motion_s + k motion_step_s.
layout(set = 0, binding = 7, rg32f) uniform readonly image2DArray motion;
// RGB: linear radiance. A: number of samples, negative where the path left the colour.
layout(set = 0, binding = 8, rgba32f) uniform writeonly image2D radiance;
layout(set = 0, binding = 5, std430) writeonly buffer Pixels {
    uint pixels[];
};

#include "chain.glsl"
#include "rng.glsl"
#include "srgb.glsl"
#include "timing.glsl"
#include "motion.glsl"
#include "effects/all.glsl"

// Mean over position(u) = begin + a u + b u^2, u = (i + 1/2) / count. OWN_MEAN: the includer has its own.
#ifndef OWN_MEAN
vec3 mean_of_taps(vec2 begin_px, vec2 a, vec2 b, int count) {
    float h = 1.0 / float(count);
    vec2 at = begin_px + (0.5 * h) * (a + (0.5 * h) * b);
    vec2 along = h * (a + (2.0 * h) * b);
    vec2 bend = (2.0 * h * h) * b;
    vec3 sum = vec3(0.0);
    for (int i = 0; i < count; i += UNROLL) {
        for (int k = 0; k < UNROLL; ++k) {
            sum += tap(at);
            at += along;
            along += bend;
        }
    }
    return sum * h;
}
#endif

// Mean over the exposure; `x_px` is seen at knot `from`.
vec4 mean_of_path(vec2 x_px, float from, float to, float knot_frames, int motion_count, ivec2 image_size) {
    vec2 history[MAX_MOTION_IMAGES];
    motion_history(motion_texel(x_px, image_size), motion_count, history);
    vec2 begin = motion_integral(history, from, motion_count);
    vec2 middle = (motion_integral(history, 0.5 * (from + to), motion_count) - begin) * knot_frames;
    vec2 whole = (motion_integral(history, to, motion_count) - begin) * knot_frames;
    float path_px = length(middle) + length(whole - middle);
    // What is read stays one px inside, so that no tap needs a clamp.
    vec2 last = vec2(image_size) - 1.0;
    vec2 begin_px = clamp(x_px, vec2(1.0), last);
    vec2 end_px = clamp(x_px - whole, vec2(1.0), last);
    vec2 middle_px = x_px - middle;
    bool left = begin_px != x_px || end_px != x_px - whole || clamp(middle_px, vec2(1.0), last) != middle_px;
    middle_px = left ? 0.5 * (begin_px + end_px) : middle_px;
    int count = max(1, int(min(ceil(path_px * TAPS_PER_PX - 0.001), float(push.max_samples))));
    count = FIXED_COUNT != 0u ? int(push.max_samples) : count;
    count = ((count + UNROLL - 1) / UNROLL) * UNROLL;
    // position(u) = begin + a u + b u^2, u = (i + 1/2) / count.
    vec2 a = 4.0 * middle_px - 3.0 * begin_px - end_px;
    vec2 b = 2.0 * (begin_px + end_px) - 4.0 * middle_px;
    vec3 mean = mean_of_taps(begin_px, a, b, count);
    return vec4(mean, left ? -float(count) : float(count));
}

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    ivec2 image_size = imageSize(motion).xy;
    int motion_count = MOTION_COUNT != 0 ? MOTION_COUNT : clamp(int(push.motion_count), 1, MAX_MOTION_IMAGES);
    float step_s = motion_count > 1 ? push.motion_step_s : push.frame_interval_s;
    float fraction = readout_fraction(pixel, push.size, push.scan_order, push.pixel_time);
    float line_start_s = push.start_s + push.readout_time_s * fraction;
    float from = (line_start_s - push.first_motion_s) / step_s;
    float to = from + push.exposure_time_s / step_s;
    vec2 x_px = vec2(pixel) + 0.5 + vec2(push.margin_px);
    vec2 motion_px = motion_at(motion_texel(x_px, image_size), from, motion_count);
    vec2 remapped_px = x_px - (line_start_s / push.frame_interval_s) * motion_px;
    float knot_frames = step_s / push.frame_interval_s;
    vec4 seen = mean_of_path(remapped_px, from, to, knot_frames, motion_count, image_size);
    if (DEVELOP == 0u) {
        imageStore(radiance, ivec2(pixel), seen);
        return;
    }
    vec3 value = apply_effects(seen.rgb, pixel);
    pixels[pixel.y * push.size.x + pixel.x] =
        quantize8(value.r) | (quantize8(value.g) << 8u) | (quantize8(value.b) << 16u) | 0xff000000u;
}
