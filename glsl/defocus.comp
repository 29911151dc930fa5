#version 460
// defocus: a Gaussian along the rows, then along the columns, or a disc, or by depth. Twin: src/effects/defocus.rs.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 16, local_size_y = 8) in;

// 0: Gaussian along a row, 1: along a column, 2: disc; by depth, 3: discs, 4: Gaussians.
layout(constant_id = 50) const uint MODE = 0u;

#include "chain.glsl"
#include "deliver.glsl"
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

// What a pixel whose disc has that radius gives to another one so many px away; not normalised.
float share(float radius_px, float away_px) {
    if (MODE == 4u) {
        float sigma = max(0.5 * radius_px, 0.05);
        precise float weight = exp(-0.5 * away_px * away_px / (sigma * sigma)) / (sigma * sigma);
        return weight;
    }
    float radius = max(radius_px, 0.5);
    precise float weight = clamp(radius + 0.5 - away_px, 0.0, 1.0) / (radius * radius);
    return weight;
}

// Alpha: one over the distance. The table: aperture times focal length, 1 / focus, largest radius.
vec3 by_depth(ivec2 pixel, uint numbers) {
    float scale = table(numbers);
    float focus = table(numbers + 1u);
    float most = table(numbers + 2u);
    float own = source_at(pixel).a;
    precise float own_px = min(0.5 * scale * abs(own - focus), most);
    int reach = int(ceil(most));
    precise vec3 sum = vec3(0.0);
    precise float total = 0.0;
    for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) {
            vec4 p = source_at(pixel + ivec2(x, y));
            precise float radius = min(0.5 * scale * abs(p.a - focus), most);
            if (p.a < own) {
                radius = min(radius, own_px);
            }
            float weight = share(radius, sqrt(float(x * x + y * y)));
            sum = sum + weight * p.rgb;
            total = total + weight;
        }
    }
    return sum / total;
}

void main() {
    // A variable, because the build's reflection does not evaluate comparisons of constants.
    uint mode = MODE;
    if (mode >= 2u) {
        ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
        if (all(lessThan(pixel, ivec2(push.size)))) {
            vec3 value = vec3(0.0);
            if (MODE == 2u) {
                value = disc(pixel, int(parameter_bits(push.slot, 0u)), parameter_bits(push.slot, 1u));
            } else {
                value = by_depth(pixel, parameter_bits(push.slot, 2u));
            }
            deliver(uvec2(pixel), vec4(value, source_at(pixel).a));
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
    vec4 sums[GAUSSIAN_RUN];
    gaussian(first, axis, 3u, sums);
    [[unroll]] for (int j = 0; j < GAUSSIAN_RUN; ++j) {
        ivec2 pixel = first + j * axis;
        if (all(lessThan(pixel, ivec2(push.size)))) {
            deliver(uvec2(pixel), sums[j]);
        }
    }
}
