// The depth of what the picture shows by texel of it, for `--method fast` where paths follow from depth.
layout(local_size_x = 64, local_size_y = 1) in;
#include "resolve.glsl"
// Near distance over distance; 0 where nothing was drawn.
layout(set = 0, binding = 0) uniform SAMPLES_2D depth_samples;
layout(set = 0, binding = 1, r32f) uniform writeonly image2D inverse_depth;
layout(push_constant) uniform Push {
    uvec2 size;
    // Texels of the depth to a texel's side.
    uint depth_texels;
} push;

void main() {
    uvec2 texel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(texel, push.size))) {
        return;
    }
    // One sample is enough to find what is in front.
    imageStore(inverse_depth, ivec2(texel), vec4(sample_at(depth_samples, ivec2(texel * push.depth_texels), 0).r));
}
