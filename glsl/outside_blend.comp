#version 460
// A frame from several pictures: the mean of what each of them shows, by what it is worth. Twin: src/reference/outside_blend.rs.
layout(local_size_x = 16, local_size_y = 8) in;

// What one picture shows: linear RGB, and what it counts.
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D warped;
// Sums of it by weight, and the weights; after the last picture linear RGB, and 1.
layout(set = 0, binding = 1, rgba32f) uniform image2D radiance;

layout(push_constant) uniform Push {
    uvec2 size;
    // Bit 0: nothing was summed before; bit 1: nothing will be after.
    uint place;
} push;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(gl_GlobalInvocationID.xy, push.size))) {
        return;
    }
    vec4 own = imageLoad(warped, pixel);
    precise vec4 sum = vec4(own.rgb * own.a, own.a);
    if ((push.place & 1u) == 0u) {
        sum = sum + imageLoad(radiance, pixel);
    }
    if ((push.place & 2u) != 0u) {
        sum = vec4(sum.rgb / max(sum.a, 1e-12), 1.0);
    }
    imageStore(radiance, pixel, sum);
}
