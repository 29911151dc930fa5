#version 460
// All effects between two resamplings that act on one pixel at a time, as one kernel: each is its own function in
// include/effects/, compiled out where its specialization constant is 0. Twin: src/reference/chain.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

// 0: to `target`; 1: encoded values to 8 bits.
layout(constant_id = 0) const uint OUTPUT = 0u;

// Row by row, red in the lowest byte, alpha 255.
layout(set = 0, binding = 5, std430) writeonly buffer Pixels {
    uint pixels[];
};

#include "chain.glsl"
#include "rng.glsl"
#include "srgb.glsl"
#include "timing.glsl"
#include "effects/all.glsl"

// Alpha 0 instead of 255 where the radiance's alpha is negative (a sample left the rendered picture).
const uint FLAG_MARK_CLAMPED = 1u;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    vec4 seen = imageLoad(source, ivec2(pixel));
    vec3 value = apply_effects(seen.rgb, pixel);
    if (OUTPUT == 0u) {
        imageStore(target, ivec2(pixel), vec4(value, seen.a));
        return;
    }
    bool marked = (push.flags & FLAG_MARK_CLAMPED) != 0u && seen.a < 0.0;
    uint alpha = marked ? 0u : 255u;
    pixels[pixel.y * push.size.x + pixel.x] =
        quantize8(value.r) | (quantize8(value.g) << 8u) | (quantize8(value.b) << 16u) | (alpha << 24u);
}
