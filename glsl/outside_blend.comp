#version 460
// A frame from several pictures: every line from the three that are nearest to it in time. Twin:
// src/reference/outside_blend.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

// What a picture shows of a pixel: a colour and what it counts; or, where the last number is below 0, the place in it,
// px.
layout(set = 0, binding = 0) uniform sampler2D warped_0;
layout(set = 0, binding = 1) uniform sampler2D warped_1;
layout(set = 0, binding = 2) uniform sampler2D warped_2;
// The pictures, for places.
layout(set = 0, binding = 3) uniform sampler2D color_0;
layout(set = 0, binding = 4) uniform sampler2D color_1;
layout(set = 0, binding = 5) uniform sampler2D color_2;
// Linear RGB, and 1.
layout(set = 0, binding = 6, rgba32f) uniform writeonly image2D radiance;

layout(push_constant) uniform Push {
    uvec2 size;
    // Texels of the pictures, margin included.
    ivec2 texels;
    // Pictures that there are: 2 or 3.
    uint pictures;
    uint scan_order;
    // Middle of the first line's exposure; of the lines that are made of these pictures from the first on, and before
    // the last, s.
    float middle_s;
    float readout_time_s;
    float from_s;
    float to_s;
    // The first pixel: a software device runs through pixels that leave at once.
    uvec2 first;
} push;

#include "timing.glsl"
#include "cubic.glsl"
#include "fused.glsl"

vec4 shown(sampler2D warped, uvec2 pixel) {
    return textureLod(warped, (vec2(pixel) + 0.5) / vec2(push.size), 0.0);
}

// Places in pictures of one surface are read as one picture of finer texels. (What one picture alone shows would be
// better read by a cubic, by 1 dB; a software device would take that branch for every pixel.)
vec3 of_places(vec4 a, vec4 b, vec4 c) {
    Around first = around(color_0, a.xy, a.w < 0.0);
    Around second = around(color_1, b.xy, b.w < 0.0);
    Around third = around(color_2, c.xy, c.w < 0.0);
    return fused(first, second, third);
}

void main() {
    uvec2 pixel = push.first + gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    precise float at_s = push.middle_s + push.readout_time_s * readout_fraction(pixel, push.size, push.scan_order, 0u);
    if (at_s < push.from_s || at_s >= push.to_s) {
        return;
    }
    vec4 a = shown(warped_0, pixel);
    vec4 b = shown(warped_1, pixel);
    vec4 c = push.pictures == 3u ? shown(warped_2, pixel) : vec4(0.0);
    vec3 seen;
    if (min(a.w, min(b.w, c.w)) < 0.0) {
        seen = of_places(a, b, c);
    } else {
        precise vec3 sum = a.w * a.rgb + b.w * b.rgb + c.w * c.rgb;
        precise float weights = a.w + b.w + c.w;
        seen = sum / max(weights, 1e-12);
    }
    imageStore(radiance, ivec2(pixel), vec4(seen, 1.0));
}
