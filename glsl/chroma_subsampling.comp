#version 460
// chroma_subsampling: the colour difference of a block is that of its mean; brightness stays. Twin:
// src/effects/chroma_subsampling.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

// Rows of a block (its columns are 2): 2 for 4:2:0, 1 for 4:2:2.
layout(constant_id = 0) const uint BLOCK_ROWS = 2u;

#include "chain.glsl"

// ITU-R BT.601, as in JFIF.
float luma(vec3 rgb) {
    precise float y = 0.299 * rgb.r + 0.587 * rgb.g + 0.114 * rgb.b;
    return y;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), push.size))) {
        return;
    }
    ivec2 first = ivec2(pixel.x & ~1, pixel.y);
    if (BLOCK_ROWS == 2u) {
        first.y = pixel.y & ~1;
    }
    precise vec3 sum = source_at(first).rgb + source_at(first + ivec2(1, 0)).rgb;
    precise vec3 mean = 0.5 * sum;
    if (BLOCK_ROWS == 2u) {
        sum = sum + (source_at(first + ivec2(0, 1)).rgb + source_at(first + ivec2(1, 1)).rgb);
        mean = 0.25 * sum;
    }
    vec4 seen = source_at(pixel);
    precise vec3 value = luma(seen.rgb) + (mean - luma(mean));
    imageStore(target, pixel, vec4(value, seen.a));
}
