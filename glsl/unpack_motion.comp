#version 460
// A caller's motion vectors to px per frame interval, from the previous to the current position. Twin:
// src/reference/unpack.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

layout(set = 0, binding = 1, rg32f) uniform writeonly image2DArray motion;

layout(push_constant) uniform Push {
    uvec2 size;
    vec2 scale;
    uint first_byte;
    uint stride_bytes;
    uint format;
    uint layer;
} push;

#include "unpack.glsl"

const uint RG16F = 7u;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    uint row = push.first_byte + pixel.y * push.stride_bytes;
    vec2 given;
    if (push.format == RG16F) {
        uint at = row + 4u * pixel.x;
        given = vec2(half_at(at), half_at(at + 2u));
    } else {
        uint at = row + 8u * pixel.x;
        given = vec2(float_at(at), float_at(at + 4u));
    }
    // What is not a number does not move.
    bool known = is_number(given.x) && is_number(given.y);
    precise vec2 motion_px = given * push.scale;
    imageStore(motion, ivec3(pixel, push.layer), vec4(known ? motion_px : vec2(0.0), 0.0, 0.0));
}
