#version 460
// defocus by depth, first: one over the distance into the radiance's alpha, where the chain's kernels find it.
layout(local_size_x = 16, local_size_y = 8) in;
// Distance along the optical axis, m; infinite where nothing is.
layout(set = 0, binding = 0, r32f) uniform readonly image2D depth;
layout(set = 0, binding = 1, rgba32f) uniform image2D radiance;
layout(push_constant) uniform Push {
    uvec2 size;
} push;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), push.size))) {
        return;
    }
    float distance_m = imageLoad(depth, pixel).r;
    float nearness = distance_m < 1e30 ? 1.0 / distance_m : 0.0;
    imageStore(radiance, pixel, vec4(imageLoad(radiance, pixel).rgb, nearness));
}
