#version 460
// sharpening: unsharp mask on encoded values, v + amount (v - Gaussian of v). Twin: src/effects/sharpening.rs.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 16, local_size_y = 8) in;

// 0: the Gaussian along a row; 1: along a column, and the mask.
layout(constant_id = 50) const uint MODE = 0u;

#include "chain.glsl"
#include "deliver.glsl"
#include "gaussian.glsl"

void main() {
    ivec2 axis = ivec2(1, 0);
    if (MODE == 1u) {
        axis = axis.yx;
    }
    ivec2 first = gaussian_first(gl_GlobalInvocationID.xy, axis);
    if (any(greaterThanEqual(first, ivec2(push.size)))) {
        return;
    }
    vec4 sums[GAUSSIAN_RUN];
    gaussian(first, axis, 1u, sums);
    [[unroll]] for (int j = 0; j < GAUSSIAN_RUN; ++j) {
        ivec2 pixel = first + j * axis;
        if (all(lessThan(pixel, ivec2(push.size)))) {
            vec4 value = sums[j];
            if (MODE == 1u) {
                vec3 seen = imageLoad(original, pixel).rgb;
                precise vec3 sharp = seen + parameter(push.slot, 0u) * (seen - value.rgb);
                value.rgb = sharp;
            }
            deliver(uvec2(pixel), value);
        }
    }
}
