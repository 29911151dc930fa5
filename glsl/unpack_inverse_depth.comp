#version 460
// A caller's depth picture to near distance over distance, as the warp of `--method fast` reads it: 0 is infinitely
// far. Twin: src/reference/unpack.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

// Its second channel says which body is seen: unpack_body.comp fills it in.
layout(set = 0, binding = 1, rg32f) uniform writeonly image2D inverse_depth;

layout(push_constant) uniform Push {
    uvec2 size;
    uint first_byte;
    uint stride_bytes;
    // Near distance over distance = numerator / value where it is not 0, else constant + slope value.
    float numerator;
    float constant;
    float slope;
} push;

#include "unpack.glsl"

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    float given = float_at(push.first_byte + pixel.y * push.stride_bytes + 4u * pixel.x);
    // Decided by the bits: drivers may assume that NaN does not occur.
    bool known = is_number(given);
    precise float of_metres = push.numerator / (given > 0.0 ? given : 1.0);
    precise float of_buffer = push.constant + push.slope * given;
    float inverse = push.numerator != 0.0 ? (given > 0.0 ? of_metres : 0.0) : max(of_buffer, 0.0);
    imageStore(inverse_depth, ivec2(pixel), vec4(known ? inverse : 0.0, 0.0, 0.0, 0.0));
}
