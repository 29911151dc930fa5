// Gaussian of the source along one axis, for a run of pixels: each texel is read once for all of them. Twin:
// src/effects/gaussian.rs. Needs chain.glsl.
#ifndef GAUSSIAN_GLSL
#define GAUSSIAN_GLSL

// Pixels of a run.
const int GAUSSIAN_RUN = 4;
// Radius whose weights stand in the slot and whose loops are unrolled; 0: any radius, with weights from a table. On a
// software device reading a weight by a computed place costs as much as reading a texel.
layout(constant_id = 51) const uint GAUSSIAN_RADIUS = 0u;

// `slot_weights`: parameter of the slot with the weight of distance 0. The sums' alpha is the pixel's own.
void gaussian_unrolled(ivec2 first, ivec2 axis, uint slot_weights, out vec4 sums[GAUSSIAN_RUN]) {
    [[unroll]] for (int j = 0; j < GAUSSIAN_RUN; ++j) {
        sums[j] = vec4(0.0);
    }
    uint constant = GAUSSIAN_RADIUS;
    int radius = int(constant);
    [[unroll]] for (int k = 0; k < GAUSSIAN_RUN + 2 * radius; ++k) {
        vec4 value = source_at(first + (k - radius) * axis);
        [[unroll]] for (int j = 0; j < GAUSSIAN_RUN; ++j) {
            int away = abs(k - j - radius);
            if (away <= radius) {
                precise vec3 sum = sums[j].rgb + parameter(push.slot, slot_weights + uint(away)) * value.rgb;
                sums[j] = vec4(sum, away == 0 ? value.a : sums[j].a);
            }
        }
    }
}

vec4 gaussian_any(ivec2 pixel, ivec2 axis, int radius, uint weights) {
    precise vec3 sum = vec3(0.0);
    for (int k = -radius; k <= radius; ++k) {
        sum = sum + table(weights + uint(abs(k))) * source_at(pixel + k * axis).rgb;
    }
    return vec4(sum, source_at(pixel).a);
}

// `parameters`: of the slot: radius, place of the weights' table, then the weights themselves where they fit.
void gaussian(ivec2 first, ivec2 axis, uint parameters, out vec4 sums[GAUSSIAN_RUN]) {
    if (GAUSSIAN_RADIUS != 0u) {
        gaussian_unrolled(first, axis, parameters + 2u, sums);
        return;
    }
    int radius = int(parameter_bits(push.slot, parameters));
    uint weights = parameter_bits(push.slot, parameters + 1u);
    [[unroll]] for (int j = 0; j < GAUSSIAN_RUN; ++j) {
        sums[j] = gaussian_any(first + j * axis, axis, radius, weights);
    }
}

// The first pixel of an invocation's run: along the axis each has GAUSSIAN_RUN of them.
ivec2 gaussian_first(uvec2 invocation, ivec2 axis) {
    return ivec2(invocation) * (ivec2(1) + (GAUSSIAN_RUN - 1) * axis);
}

#endif
