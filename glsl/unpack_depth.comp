#version 460
// A caller's depth picture to metres along the optical axis. Twin: src/reference/unpack.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

layout(set = 0, binding = 1, r32f) uniform writeonly image2D depth;

layout(push_constant) uniform Push {
    uvec2 size;
    uint first_byte;
    uint stride_bytes;
    // 1: metres already. 0: metres = numerator / (constant + slope value).
    uint metres;
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
    precise float bottom = push.constant + push.slope * given;
    precise float depth_m = push.numerator / bottom;
    // Depth 0 is infinitely far in this library's kernels.
    float there = bottom > 0.0 ? depth_m : 0.0;
    imageStore(depth, ivec2(pixel), vec4(push.metres != 0u ? given : there, 0.0, 0.0, 0.0));
}
