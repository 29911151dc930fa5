#version 460
// noise_reduction: a Gaussian on luma and a wider one on colour, along the rows, then along the columns; edges may be
// spared. Twin: src/effects/noise_reduction.rs.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 16, local_size_y = 8) in;

// 0: along a row, from RGB; 1: along a column, to RGB. Plus 2: edges are spared.
layout(constant_id = 50) const uint MODE = 0u;

#include "chain.glsl"
#include "deliver.glsl"
#include "gaussian.glsl"

const uint SPARED = 2u;

// Luma (ITU-R BT.601), and red and blue against it. Between the passes the picture holds these.
vec4 luma_at(ivec2 pixel) {
    vec4 rgb = source_at(pixel);
    if ((MODE & 1u) == 1u) {
        return rgb;
    }
    precise float y = 0.299 * rgb.r + 0.587 * rgb.g + 0.114 * rgb.b;
    return vec4(y, rgb.r - y, rgb.b - y, rgb.a);
}

vec3 rgb_of(vec3 v) {
    precise float g = v.x - (0.299 * v.y + 0.114 * v.z) / 0.587;
    return vec3(v.x + v.y, g, v.x + v.z);
}

// Weights of luma and colour at a distance.
vec2 weights_at(uint away) {
    if (GAUSSIAN_RADIUS != 0u) {
        return vec2(parameter(push.slot, 4u + away), parameter(push.slot, 5u + GAUSSIAN_RADIUS + away));
    }
    return vec2(table(parameter_bits(push.slot, 1u) + away), table(parameter_bits(push.slot, 2u) + away));
}

struct Sum {
    vec3 value;
    vec2 weight;
};

void add(inout Sum sum, vec3 value, float own, uint away) {
    precise vec2 weight = weights_at(away);
    if ((MODE & SPARED) != 0u) {
        precise float difference = value.x - own;
        weight = weight * exp(-parameter(push.slot, 3u) * (difference * difference));
        precise vec2 total = sum.weight + weight;
        sum.weight = total;
    }
    precise vec3 value_sum = sum.value + weight.xyy * value;
    sum.value = value_sum;
}

// The smoothed pixel as it is stored between the passes, and behind them.
vec3 made(Sum sum) {
    vec3 value = sum.value;
    if ((MODE & SPARED) != 0u) {
        precise vec3 mean = value / sum.weight.xyy;
        value = mean;
    }
    return (MODE & 1u) == 1u ? rgb_of(value) : value;
}

void unrolled(ivec2 first, ivec2 axis) {
    Sum sums[GAUSSIAN_RUN];
    vec4 own[GAUSSIAN_RUN];
    [[unroll]] for (int j = 0; j < GAUSSIAN_RUN; ++j) {
        own[j] = luma_at(first + j * axis);
        sums[j] = Sum(vec3(0.0), vec2(0.0));
    }
    uint constant = GAUSSIAN_RADIUS;
    int radius = int(constant);
    [[unroll]] for (int k = -radius; k < GAUSSIAN_RUN + radius; ++k) {
        vec3 value = vec3(0.0);
        if (k >= 0 && k < GAUSSIAN_RUN) {
            value = own[k].xyz;
        } else {
            value = luma_at(first + k * axis).xyz;
        }
        [[unroll]] for (int j = 0; j < GAUSSIAN_RUN; ++j) {
            if (abs(k - j) <= radius) {
                add(sums[j], value, own[j].x, uint(abs(k - j)));
            }
        }
    }
    [[unroll]] for (int j = 0; j < GAUSSIAN_RUN; ++j) {
        ivec2 pixel = first + j * axis;
        if (all(lessThan(pixel, ivec2(push.size)))) {
            deliver(uvec2(pixel), vec4(made(sums[j]), own[j].a));
        }
    }
}

// Wider than what is unrolled.
void any_radius(ivec2 first, ivec2 axis) {
    int radius = int(parameter_bits(push.slot, 0u));
    for (int j = 0; j < GAUSSIAN_RUN; ++j) {
        ivec2 pixel = first + j * axis;
        if (any(greaterThanEqual(pixel, ivec2(push.size)))) {
            return;
        }
        vec4 own = luma_at(pixel);
        Sum sum = Sum(vec3(0.0), vec2(0.0));
        for (int k = -radius; k <= radius; ++k) {
            add(sum, luma_at(pixel + k * axis).xyz, own.x, uint(abs(k)));
        }
        deliver(uvec2(pixel), vec4(made(sum), own.a));
    }
}

void main() {
    ivec2 axis = ivec2(1, 0);
    if ((MODE & 1u) == 1u) {
        axis = axis.yx;
    }
    ivec2 first = gaussian_first(gl_GlobalInvocationID.xy, axis);
    if (any(greaterThanEqual(first, ivec2(push.size)))) {
        return;
    }
    if (GAUSSIAN_RADIUS != 0u) {
        unrolled(first, axis);
    } else {
        any_radius(first, axis);
    }
}
