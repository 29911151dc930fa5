#version 460
// chroma_subsampling: the colour difference of a block is that of its mean; brightness stays. One invocation makes a
// block. Twin: src/effects/chroma_subsampling.rs.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 16, local_size_y = 8) in;

// Rows of a block (its columns are 2): 2 for 4:2:0, 1 for 4:2:2.
layout(constant_id = 50) const uint BLOCK_ROWS = 2u;

#include "chain.glsl"
#include "deliver.glsl"

// ITU-R BT.601, as in JFIF.
float luma(vec3 rgb) {
    precise float y = 0.299 * rgb.r + 0.587 * rgb.g + 0.114 * rgb.b;
    return y;
}

void main() {
    uint rows = BLOCK_ROWS;
    ivec2 first = ivec2(gl_GlobalInvocationID.xy * uvec2(2u, rows));
    if (any(greaterThanEqual(first, ivec2(push.size)))) {
        return;
    }
    vec4 block[4];
    block[0] = source_at(first);
    block[1] = source_at(first + ivec2(1, 0));
    precise vec3 sum = block[0].rgb + block[1].rgb;
    precise vec3 mean = 0.5 * sum;
    if (BLOCK_ROWS == 2u) {
        block[2] = source_at(first + ivec2(0, 1));
        block[3] = source_at(first + ivec2(1, 1));
        sum = sum + (block[2].rgb + block[3].rgb);
        mean = 0.25 * sum;
    }
    vec3 difference = mean - luma(mean);
    [[unroll]] for (uint i = 0u; i < 2u * rows; ++i) {
        ivec2 pixel = first + ivec2(i & 1u, i >> 1u);
        if (all(lessThan(pixel, ivec2(push.size)))) {
            precise vec3 value = luma(block[i].rgb) + difference;
            deliver(uvec2(pixel), vec4(value, block[i].a));
        }
    }
}
