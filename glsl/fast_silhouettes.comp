#version 460
// `--method fast`, last part: the pixels where several surfaces come by during the exposure. Every sample asks all
// claims around and takes the nearest that really lands on it. Twin: src/reference/fast_silhouettes.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;

#include "fast_push.glsl"
layout(set = 0, binding = 1) uniform sampler2D path_0;
layout(set = 0, binding = 2) uniform sampler2D path_1;
layout(set = 0, binding = 3) uniform sampler2D path_2;
// Size of the path images; grows towards the camera; 0: infinitely far.
layout(set = 0, binding = 4) uniform sampler2D inverse_depth;
layout(set = 0, binding = 5) uniform sampler2D color;
layout(set = 0, binding = 6, rgba32f) uniform writeonly image2D radiance;
layout(set = 0, binding = 7, std430) readonly buffer Listed {
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
#include "fast_silhouettes.glsl"

void main() {
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = gl_GlobalInvocationID.x; i < listed.count; i += stride) {
        uvec2 pixel = uvec2(listed.pixels[i] % push.size.x, listed.pixels[i] / push.size.x);
        vec4 seen = blur_many_surfaces(pixel);
        seen.a *= nearness_of(readout_fraction(pixel, push.size, push.scan_order, 0u));
        imageStore(radiance, ivec2(pixel), seen);
    }
}
