#version 460
// noise_reduction: a Gaussian on luma and a wider one on colour, along the rows, then along the columns; edges may be
// spared. Twin: src/effects/noise_reduction.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

// 0: along a row, from RGB; 1: along a column, to RGB.
layout(constant_id = 0) const uint AXIS = 0u;
// Whether edges are spared.
layout(constant_id = 1) const uint SPARED = 0u;

#include "chain.glsl"

// Luma (ITU-R BT.601), and red and blue against it. Between the passes the picture holds these.
vec3 luma_at(ivec2 pixel) {
    vec3 rgb = source_at(pixel).rgb;
    if (AXIS == 1u) {
        return rgb;
    }
    precise float y = 0.299 * rgb.r + 0.587 * rgb.g + 0.114 * rgb.b;
    return vec3(y, rgb.r - y, rgb.b - y);
}

vec3 rgb_of(vec3 v) {
    precise float g = v.x - (0.299 * v.y + 0.114 * v.z) / 0.587;
    return vec3(v.x + v.y, g, v.x + v.z);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), push.size))) {
        return;
    }
    int radius = int(parameter_bits(push.slot, 0u));
    uint luma = parameter_bits(push.slot, 1u);
    uint chroma = parameter_bits(push.slot, 2u);
    float falloff = parameter(push.slot, 3u);
    ivec2 axis = ivec2(1, 0);
    if (AXIS == 1u) {
        axis = axis.yx;
    }
    float own = luma_at(pixel).x;
    precise vec3 sum = vec3(0.0);
    precise vec2 total = vec2(0.0);
    for (int k = -radius; k <= radius; ++k) {
        vec3 value = luma_at(pixel + k * axis);
        precise vec2 weight = vec2(table(luma + uint(abs(k))), table(chroma + uint(abs(k))));
        if (SPARED != 0u) {
            precise float difference = value.x - own;
            weight = weight * exp(-falloff * (difference * difference));
        }
        sum = sum + weight.xyy * value;
        total = total + weight;
    }
    if (SPARED != 0u) {
        sum = sum / total.xyy;
    }
    vec3 seen = sum;
    if (AXIS == 1u) {
        seen = rgb_of(sum);
    }
    imageStore(target, pixel, vec4(seen, source_at(pixel).a));
}
