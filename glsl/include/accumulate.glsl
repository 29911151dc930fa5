// Adds one rendered instant to the lines that see it, each with its own weight.
layout(local_size_x = 16, local_size_y = 8) in;
#include "resolve.glsl"
layout(set = 0, binding = 0) uniform SAMPLES_2D color_samples;
layout(set = 0, binding = 1, rgba32f) uniform image2D radiance;
layout(set = 0, binding = 2, std430) readonly buffer Weights {
    float weights[];
};
layout(push_constant) uniform Push {
    // The rectangle of pixels whose lines have a weight.
    uvec2 origin;
    uvec2 size;
    // All of the picture.
    uvec2 picture;
    ivec2 grid;
    uint scan_order;
    // Line (in scan order) of the first weight, and that weight's place.
    uint first_line;
    uint first_weight;
} push;
#include "timing.glsl"

void main() {
    if (any(greaterThanEqual(gl_GlobalInvocationID.xy, push.size))) {
        return;
    }
    uvec2 pixel = push.origin + gl_GlobalInvocationID.xy;
    uint line = line_of(pixel, push.picture, push.scan_order);
    float weight = weights[push.first_weight + line - push.first_line];
    vec4 seen = mean_of_pixel(color_samples, ivec2(pixel), grid_of(push.grid));
    vec4 sum = imageLoad(radiance, ivec2(pixel));
    imageStore(radiance, ivec2(pixel), sum + weight * seen);
}
