#version 460
// `--method fast`, second half: rolling shutter and motion blur from one picture and the paths of what it shows. Every
// pixel finds the place in the picture that its line sees, along the path (implicitly: p + displacement(p) = x), and
// reads the colour there once. Twin: src/reference/fast_gather.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

#define SEEDS_ACCESS readonly
#include "fast_push.glsl"
// Displacements (px) from the reference instant to knots, two an image; PATH_SCALE texels a px, with the margin.
layout(set = 0, binding = 1) uniform sampler2D path_0;
layout(set = 0, binding = 2) uniform sampler2D path_1;
layout(set = 0, binding = 3) uniform sampler2D path_2;
// Same size; grows towards the camera; 0: infinitely far.
layout(set = 0, binding = 4) uniform sampler2D inverse_depth;
// Linear radiance at the reference instant, COLOR_SCALE texels a px, with `margin_px` more on every side.
layout(set = 0, binding = 5) uniform sampler2D color;
// RGB: linear radiance. A: number of samples, negative where one left `color` (the margin was too small).
layout(set = 0, binding = 6, rgba32f) uniform writeonly image2D radiance;

#include "timing.glsl"
#include "path.glsl"
#include "sample.glsl"
#include "fast_warp.glsl"

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    float fraction = readout_fraction(pixel, push.size, push.scan_order, 0u);
    precise float from = (push.start_s + push.readout_time_s * fraction) / push.knot_step_s + float(push.reference_knot);
    precise float span = push.exposure_time_s / push.knot_step_s;
    precise vec2 x_px = vec2(pixel) + 0.5 + vec2(push.margin_px);

    Claims claims = claims_around(ivec2(pixel));
    vec4 seen;
    Sources sources;
    if (claims.one_surface && sources_over_exposure(x_px, claims, from, span, sources)) {
        seen = blur_one_surface(sources);
    } else {
        seen = blur_many_surfaces(x_px, claims, from, span);
    }
    imageStore(radiance, ivec2(pixel), seen);
}
