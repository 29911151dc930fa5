// What a kernel does with a value that it has made: the effects behind it that act on one pixel at a time, then to
// `target` or to the delivered picture. Twin: src/reference/chain.rs. Needs chain.glsl.
#ifndef DELIVER_GLSL
#define DELIVER_GLSL

// 0: to `target`; 1: encoded values to 8 bits.
layout(constant_id = 0) const uint OUTPUT = 0u;

// Row by row, red in the lowest byte, alpha 255.
layout(set = 0, binding = 5, std430) writeonly buffer Pixels {
    uint pixels[];
};

#include "rng.glsl"
#include "srgb.glsl"
#include "timing.glsl"
#include "effects/all.glsl"

// Alpha 0 instead of 255 where the radiance's alpha is negative (a sample left the rendered picture).
const uint FLAG_MARK_CLAMPED = 1u;

// `value`: colour, and alpha as the method wrote it. The pixel lies in the picture.
void deliver(uvec2 pixel, vec4 value) {
    vec3 seen = apply_effects(value.rgb, pixel);
    if (OUTPUT == 0u) {
        imageStore(target, ivec2(pixel), vec4(seen, value.a));
        return;
    }
    bool marked = (push.flags & FLAG_MARK_CLAMPED) != 0u && value.a < 0.0;
    uint alpha = marked ? 0u : 255u;
    pixels[pixel.y * push.size.x + pixel.x] =
        quantize8(seen.r) | (quantize8(seen.g) << 8u) | (quantize8(seen.b) << 16u) | (alpha << 24u);
}

#endif
