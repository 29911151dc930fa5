// Frames of several pictures: what a warp of one of them counts in the mean over all. Twin:
// src/reference/fast_weight.rs. Needs fast_push, fast_blur.
#ifndef FAST_WEIGHT_GLSL
#define FAST_WEIGHT_GLSL

// Whether the picture is one of several. Else results hold their number of samples, as ever.
layout(constant_id = 9) const uint ONE_OF_SEVERAL = 0u;
bool one_of_several() { return ONE_OF_SEVERAL != 0u; }

// What a reading at a texel's centre is wrong by nonetheless, beside the (f (1 - f))^2 of one at a share f between two.
const float LEAST_ERROR = 0.003;
// What is made up, or repeated beyond the border, counts where no picture has better.
const float MADE_UP = 1e-4;

// How near the picture is in time to the middle of a line's exposure: 1 at its own instant, 0 at those of the pictures
// before and after it.
float nearness_of(float fraction) {
    if (!one_of_several()) {
        return 1.0;
    }
    precise float at_s = push.start_s + push.readout_time_s * fraction + 0.5 * push.exposure_time_s;
    precise float before = (at_s - push.from_s) / (push.picture_s - push.from_s);
    precise float after = (push.to_s - at_s) / (push.to_s - push.picture_s);
    return clamp(min(before, after), 0.0, 1.0);
}

// What a reading is worth that is blurred along a way: the nearer it runs to centres of texels, the less of the detail
// across it is lost.
float sharpness(vec2 position_px, vec2 way_px) {
    precise vec2 f = fract(position_px - 0.5);
    precise vec2 off = f * (1.0 - f) / (1.0 + way_px * way_px);
    precise float error = LEAST_ERROR + (off.x * off.x + off.y * off.y);
    precise float share = LEAST_ERROR / error;
    return share * share;
}

// A result: colour, and the number of samples, negative where one left the picture; or what it is worth.
vec4 result_of(vec3 mean, float samples, bool clamped, float worth) {
    if (!one_of_several()) {
        return vec4(mean, clamped ? -samples : samples);
    }
    return vec4(mean, clamped ? MADE_UP : max(worth, MADE_UP));
}

#endif
