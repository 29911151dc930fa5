#version 460
// bayer_mosaic: of each pixel only the colour of its filter is read, the others are made from its neighbours. Twin:
// src/effects/bayer_mosaic.rs.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 16, local_size_y = 8) in;

// Column (bit 0) and row (bit 1) of the red pixel in each block of 2x2.
layout(constant_id = 50) const uint RED = 0u;
// 0: bilinear, 1: Malvar-He-Cutler.
layout(constant_id = 51) const uint DEMOSAIC = 0u;

#include "chain.glsl"
#include "deliver.glsl"

// x even: a column with red; y even: a row with red.
ivec2 filter_place(ivec2 pixel) {
    uint red = RED;
    return (pixel + ivec2(red & 1u, red >> 1u)) & 1;
}

// Mirrored about the outermost pixels, which keeps the colours of the filter in place.
float mosaic(ivec2 pixel) {
    ivec2 last = ivec2(push.size) - 1;
    pixel = abs(pixel);
    pixel = last - abs(last - pixel);
    pixel = clamp(pixel, ivec2(0), last);
    vec3 rgb = imageLoad(source, pixel).rgb;
    ivec2 place = filter_place(pixel);
    return place.x != place.y ? rgb.g : (place.x == 0 ? rgb.r : rgb.b);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), push.size))) {
        return;
    }
    float own = mosaic(pixel);
    precise float row = mosaic(pixel + ivec2(-1, 0)) + mosaic(pixel + ivec2(1, 0));
    precise float column = mosaic(pixel + ivec2(0, -1)) + mosaic(pixel + ivec2(0, 1));
    precise float diagonal = (mosaic(pixel + ivec2(-1, -1)) + mosaic(pixel + ivec2(1, -1))) +
                             (mosaic(pixel + ivec2(-1, 1)) + mosaic(pixel + ivec2(1, 1)));
    // What a filter of 3x3 gives: the mean of the neighbours of a colour.
    precise float cross_mean = 0.25 * (row + column);
    precise float diagonal_mean = 0.25 * diagonal;
    precise float row_mean = 0.5 * row;
    precise float column_mean = 0.5 * column;
    if (DEMOSAIC == 1u) {
        precise float far_row = mosaic(pixel + ivec2(-2, 0)) + mosaic(pixel + ivec2(2, 0));
        precise float far_column = mosaic(pixel + ivec2(0, -2)) + mosaic(pixel + ivec2(0, 2));
        precise float far = far_row + far_column;
        cross_mean = 0.125 * (4.0 * own + 2.0 * (row + column) - far);
        diagonal_mean = 0.125 * (6.0 * own + 2.0 * diagonal - 1.5 * far);
        row_mean = 0.125 * (5.0 * own + 4.0 * row - far_row - diagonal + 0.5 * far_column);
        column_mean = 0.125 * (5.0 * own + 4.0 * column - far_column - diagonal + 0.5 * far_row);
    }
    ivec2 place = filter_place(pixel);
    vec3 rgb;
    if (place.x == place.y) {
        rgb = place.x == 0 ? vec3(own, cross_mean, diagonal_mean) : vec3(diagonal_mean, cross_mean, own);
    } else {
        rgb = place.y == 0 ? vec3(row_mean, own, column_mean) : vec3(column_mean, own, row_mean);
    }
    deliver(uvec2(pixel), vec4(rgb, imageLoad(source, pixel).a));
}
