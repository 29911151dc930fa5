#version 460
// Trial: the nearest texel, around eight places of a pixel in turn, so that neighbours count by how near they are.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#define OWN_MEAN
layout(set = 0, binding = 6) uniform sampler2D color;
vec3 mean_of_taps(vec2 begin_px, vec2 a, vec2 b, int count);
#include "paper_fast.glsl"

const vec2 PLACE_PX[8] = vec2[8](
    vec2(-0.4375, 0.0625), vec2(0.0625, -0.4375), vec2(-0.1875, 0.3125), vec2(0.3125, -0.1875),
    vec2(-0.3125, -0.3125), vec2(0.1875, 0.1875), vec2(-0.0625, -0.0625), vec2(0.4375, 0.4375));

vec3 mean_of_taps(vec2 begin_px, vec2 a, vec2 b, int count) {
    float h = 1.0 / float(count);
    vec2 at = begin_px + (0.5 * h) * (a + (0.5 * h) * b);
    vec2 along = h * (a + (2.0 * h) * b);
    vec2 bend = (2.0 * h * h) * b;
    vec3 sum = vec3(0.0);
    for (int i = 0; i < count; i += 8) {
        [[unroll]] for (int k = 0; k < 8; ++k) {
            sum += texelFetch(color, ivec2(at + PLACE_PX[k]), 0).rgb;
            at += along;
            along += bend;
        }
    }
    return sum * h;
}
