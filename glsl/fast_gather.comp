#version 460
// `--method fast`, second part: rolling shutter and motion blur from one picture and the paths of what it shows. Every
// pixel finds the place in the picture that its line sees, along the path (implicitly: p + displacement(p) = x), and
// reads the colour there once. Pixels where several surfaces come by are listed for fast_silhouettes. Twin:
// src/reference/fast_gather.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

#include "fast_push.glsl"
// Displacements (px) from the reference instant to knots, two an image; PATH_SCALE texels a px, with the margin.
layout(set = 0, binding = 1) uniform sampler2D path_0;
layout(set = 0, binding = 2) uniform sampler2D path_1;
layout(set = 0, binding = 3) uniform sampler2D path_2;
// Size of the path images; grows towards the camera; 0: infinitely far.
layout(set = 0, binding = 7) uniform sampler2D inverse_depth;
// Linear radiance at the reference instant, COLOR_SCALE texels a px, with `margin_px` more on every side.
layout(set = 0, binding = 4) uniform sampler2D color;
// RGB: linear radiance. A: number of samples, negative where one left `color` (the margin was too small).
layout(set = 0, binding = 5, rgba32f) uniform writeonly image2D radiance;
layout(set = 0, binding = 6, std430) buffer Listed {
    // Size of fast_silhouettes' dispatch.
    uvec3 groups;
    uint count;
    uint pixels[];
} listed;

#include "timing.glsl"
#include "path.glsl"
#include "fast_lens.glsl"
#include "fast_claims.glsl"
#include "sample.glsl"
#include "fast_blur.glsl"
#include "fast_weight.glsl"
#include "cubic.glsl"
#include "pixel_area.glsl"
#include "fast_gather.glsl"

void main() {
    uvec2 pixel = push.first + gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    float fraction = readout_fraction(pixel, push.size, push.scan_order, 0u);
    precise float from = (push.start_s + push.readout_time_s * fraction) / push.knot_step_s
        + float(push.reference_knot);
    // Another picture's lines.
    float near = nearness_of(fraction);
    if (near <= 0.0) {
        imageStore(radiance, ivec2(pixel), vec4(0.0));
        return;
    }
    vec2 x_px = looks_at(ivec2(pixel));
    Sources sources;
    if (!sources_over_exposure(ivec2(pixel), x_px, from, sources)) {
        uint place = atomicAdd(listed.count, 1u);
        listed.pixels[place] = pixel.y * push.size.x + pixel.x;
        // Beyond the number of groups that every device allows, each invocation takes several pixels.
        if (place % SILHOUETTE_GROUP == 0u && place / SILHOUETTE_GROUP < 65535u) {
            atomicAdd(listed.groups.x, 1u);
        }
        return;
    }
    vec4 seen = blur_one_surface(sources);
    seen.a *= near;
    imageStore(radiance, ivec2(pixel), seen);
}
