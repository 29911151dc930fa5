// Samples to delivered pixels where no line is exposed for longer than an instant: the box mean, as `accumulate` takes
// it for a single render.
layout(local_size_x = 16, local_size_y = 8) in;
#include "resolve.glsl"
// Alpha: number of the motion group, 0 where nothing is.
layout(set = 0, binding = 0) uniform SAMPLES_2D color_samples;
layout(set = 0, binding = 1, rgba32f) uniform writeonly image2D radiance;
layout(push_constant) uniform Push {
    uvec2 size;
    // Pixels of the attachment beyond the picture.
    ivec2 margin_px;
    ivec2 grid;
} push;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    vec4 seen = mean_of_pixel(color_samples, ivec2(pixel) + push.margin_px, grid_of(push.grid));
    // One sample read; statistics are told so.
    imageStore(radiance, ivec2(pixel), vec4(seen.rgb, 1.0));
}
