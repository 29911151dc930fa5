#version 460
// defocus: a Gaussian along the rows, then along the columns, or a disc. Twin: src/effects/defocus.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

// 0: Gaussian along a row, 1: along a column, 2: disc.
layout(constant_id = 0) const uint MODE = 0u;

#include "chain.glsl"
#include "gaussian.glsl"

vec3 disc(ivec2 pixel, int radius, uint weights) {
    precise vec3 sum = vec3(0.0);
    for (int y = -radius; y <= radius; ++y) {
        for (int x = -radius; x <= radius; ++x) {
            sum = sum + table(weights) * source_at(pixel + ivec2(x, y)).rgb;
            ++weights;
        }
    }
    return sum;
}

void main() {
    if (MODE == 2u) {
        ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
        if (all(lessThan(pixel, ivec2(push.size)))) {
            vec3 value = disc(pixel, int(parameter_bits(push.slot, 0u)), parameter_bits(push.slot, 1u));
            imageStore(target, pixel, vec4(value, source_at(pixel).a));
        }
        return;
    }
    ivec2 axis = ivec2(1, 0);
    if (MODE == 1u) {
        axis = axis.yx;
    }
    ivec2 first = gaussian_first(gl_GlobalInvocationID.xy, axis);
    if (any(greaterThanEqual(first, ivec2(push.size)))) {
        return;
    }
    vec3 sums[GAUSSIAN_RUN];
    gaussian(first, axis, 2u, sums);
    for (int j = 0; j < GAUSSIAN_RUN; ++j) {
        ivec2 pixel = first + j * axis;
        if (all(lessThan(pixel, ivec2(push.size)))) {
            imageStore(target, pixel, vec4(sums[j], source_at(pixel).a));
        }
    }
}
