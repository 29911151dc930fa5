#version 460
// A caller's picture of ids to numbers of bodies, beside the depth that is there. Twin: src/reference/unpack.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

layout(set = 0, binding = 1, rg32f) uniform image2D inverse_depth;
// Ids in rising order, then the number of each.
layout(set = 0, binding = 2, std430) readonly buffer BodyIds {
    uint body_ids[];
};

layout(push_constant) uniform Push {
    uvec2 size;
    uint first_byte;
    uint stride_bytes;
    // Bytes of an id: 1, 2 or 4.
    uint id_bytes;
    uint count;
} push;

#include "unpack.glsl"

uint id_at(uint offset) {
    uint word = words[offset >> 2u] >> ((offset & 3u) * 8u);
    return push.id_bytes == 4u ? word : (push.id_bytes == 2u ? word & 0xffffu : word & 0xffu);
}

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    uint id = id_at(push.first_byte + pixel.y * push.stride_bytes + pixel.x * push.id_bytes);
    // The first that is not below it.
    uint low = 0u;
    uint high = push.count;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (body_ids[middle] < id) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    // What is nobody's rests.
    bool known = low < push.count && body_ids[min(low, push.count - 1u)] == id;
    float body = known ? float(body_ids[push.count + low]) : 0.0;
    float depth = imageLoad(inverse_depth, ivec2(pixel)).r;
    imageStore(inverse_depth, ivec2(pixel), vec4(depth, body, 0.0, 0.0));
}
