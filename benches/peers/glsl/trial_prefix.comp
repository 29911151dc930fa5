#version 460
// Trial: sums along rows. The path is cut where it comes to another row, and each piece is the difference of two sums,
// both read between texels along the row. The picture of mostly horizontal motion only: what it can win at best.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#define OWN_MEAN
// Sums of all texels to the left.
layout(set = 0, binding = 6) uniform sampler2D color;
vec3 mean_of_taps(vec2 begin_px, vec2 a, vec2 b, int count);
#include "paper_fast.glsl"

vec3 sum_to(float x_px, int row) {
    int texel = int(x_px);
    vec3 before = texelFetch(color, ivec2(texel, row), 0).rgb;
    return mix(before, texelFetch(color, ivec2(texel + 1, row), 0).rgb, x_px - float(texel));
}

vec3 mean_of_taps(vec2 begin_px, vec2 a, vec2 b, int count) {
    // Pieces of equal time, at least as many as rows; each a px wide at least: what rests must not divide by 0.
    int pieces = int(abs(a.y + b.y)) + 1;
    float h = 1.0 / float(pieces);
    vec3 mean = vec3(0.0);
    vec2 from = begin_px;
    for (int i = 1; i <= pieces; ++i) {
        float u = h * float(i);
        vec2 to = begin_px + u * (a + u * b);
        vec2 middle = 0.5 * (from + to);
        float half_px = max(0.5 * abs(to.x - from.x), 0.5);
        int row = int(middle.y);
        mean += (sum_to(middle.x + half_px, row) - sum_to(middle.x - half_px, row)) / (2.0 * half_px);
        from = to;
    }
    return mean * h;
}
