#version 460
// Puts a frame together whose colours were drawn one after another, each through a lens of its own magnification: red
// and blue are kept as they come, and put beside the green of the last picture.
layout(local_size_x = 16, local_size_y = 8) in;
layout(set = 0, binding = 0, rgba32f) uniform image2D radiance;
layout(set = 0, binding = 1, rgba32f) uniform image2D kept;
layout(push_constant) uniform Push {
    uvec2 size;
    // 0: keep red, 2: keep blue, 1: the last, green.
    uint channel;
} push;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(gl_GlobalInvocationID.xy, push.size))) {
        return;
    }
    vec4 seen = imageLoad(radiance, pixel);
    vec4 before = imageLoad(kept, pixel);
    if (push.channel == 0u) {
        imageStore(kept, pixel, vec4(seen.r, 0.0, 0.0, 0.0));
    } else if (push.channel == 2u) {
        imageStore(kept, pixel, vec4(before.r, 0.0, seen.b, 0.0));
    } else {
        imageStore(radiance, pixel, vec4(before.r, seen.g, before.b, seen.a));
    }
}
