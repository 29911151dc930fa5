// Samples to pixels: motion and depth of the NEAREST sample. An average over a silhouette would be the motion of
// nothing that is there.
layout(local_size_x = 16, local_size_y = 8) in;
#include "resolve.glsl"
layout(set = 0, binding = 0) uniform SAMPLES_2D motion_samples;
// Near distance over distance; 0 where nothing was drawn.
layout(set = 0, binding = 1) uniform SAMPLES_2D depth_samples;
layout(set = 0, binding = 2, rg32f) uniform writeonly image2DArray motion;
layout(set = 0, binding = 3, r32f) uniform writeonly image2D depth;
layout(push_constant) uniform Push {
    uvec2 size;
    ivec2 grid;
    uint layer;
    float near_m;
} push;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    int count = sample_count(motion_samples);
    ivec2 grid = grid_of(push.grid);
    float nearest = 0.0;
    ivec2 nearest_texel = ivec2(pixel) * grid;
    int nearest_index = 0;
    for (int y = 0; y < grid.y; ++y) {
        for (int x = 0; x < grid.x; ++x) {
            for (int i = 0; i < count; ++i) {
                ivec2 texel = ivec2(pixel) * grid + ivec2(x, y);
                float inverse_depth = sample_at(depth_samples, texel, i).r;
                if (inverse_depth > nearest) {
                    nearest = inverse_depth;
                    nearest_texel = texel;
                    nearest_index = i;
                }
            }
        }
    }
    vec2 motion_px = sample_at(motion_samples, nearest_texel, nearest_index).rg;
    imageStore(motion, ivec3(pixel, push.layer), vec4(motion_px, 0.0, 0.0));
    // Infinity where nothing was drawn; spelled out, because Vulkan leaves a division by zero undefined.
    float depth_m = nearest > 0.0 ? push.near_m / nearest : uintBitsToFloat(0x7f800000u);
    imageStore(depth, ivec2(pixel), vec4(depth_m, 0.0, 0.0, 0.0));
}
