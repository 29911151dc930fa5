#version 460
// sharpening: unsharp mask on encoded values, v + amount (v - Gaussian of v). Twin: src/effects/sharpening.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

// 0: the Gaussian along a row; 1: along a column, and the mask.
layout(constant_id = 0) const uint MODE = 0u;

#include "chain.glsl"
#include "gaussian.glsl"

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), push.size))) {
        return;
    }
    ivec2 axis = ivec2(1, 0);
    if (MODE == 1u) {
        axis = axis.yx;
    }
    vec3 blurred = gaussian(pixel, axis, parameter_bits(push.slot, 1u), parameter_bits(push.slot, 2u));
    vec4 seen = imageLoad(original, pixel);
    precise vec3 value = blurred;
    if (MODE == 1u) {
        value = seen.rgb + parameter(push.slot, 0u) * (seen.rgb - blurred);
    }
    imageStore(target, pixel, vec4(value, seen.a));
}
