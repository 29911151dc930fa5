// Samples to pixels: linear radiance and coverage, kept as floats, so that a mean of texels rounds no differently from
// a mean of samples.
layout(local_size_x = 16, local_size_y = 8) in;
#include "resolve.glsl"
#ifdef HALF
#include "half.glsl"
#define COLOR_FORMAT rgba16f
#else
#define COLOR_FORMAT rgba32f
#endif
layout(set = 0, binding = 0) uniform SAMPLES_2D color_samples;
layout(set = 0, binding = 1, COLOR_FORMAT) uniform writeonly image2D color;
layout(push_constant) uniform Push {
    uvec2 size;
    ivec2 grid;
} push;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    vec4 mean = mean_of_pixel(color_samples, ivec2(pixel), grid_of(push.grid));
#ifdef HALF
    mean.rgb = nearest_half(mean.rgb);
#endif
    imageStore(color, ivec2(pixel), mean);
}
