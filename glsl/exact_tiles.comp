#version 460
// A summary of every tile: the paths of its nearest and its farthest pixel, how far paths reach, whether they jump, and
// its colours.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "exact_tile.glsl"
layout(set = 0, binding = 0) uniform sampler2D texels;
layout(set = 0, binding = 1) uniform sampler2D paths;
layout(set = 0, binding = 2, rgba16f) uniform writeonly image2D tile_near;
layout(set = 0, binding = 3, rgba16f) uniform writeonly image2D tile_far;
// 1/m of nearest and farthest; reach in x and in y, px, EXACT_JUMPS more in y where paths jump from one px to the next.
layout(set = 0, binding = 4, rgba32f) uniform writeonly image2D tile_facts;
// RGB: radiance half way between the least and the most. A: largest distance of a channel from it.
layout(set = 0, binding = 5, rgba16f) uniform writeonly image2D tile_colors;
layout(push_constant) uniform Push {
    // Tiles.
    uvec2 size;
    // Delivered px of the attachment.
    ivec2 picture;
    int grid;
} push;

float larger(vec4 v) {
    return max(max(abs(v.x), abs(v.y)), max(abs(v.z), abs(v.w)));
}

void main() {
    uvec2 tile = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(tile, push.size))) {
        return;
    }
    vec4 near = vec4(0.0), far = vec4(0.0);
    float near_inverse = -1.0, far_inverse = 1e30, jump = 0.0;
    vec2 reach = vec2(0.0);
    vec3 least = vec3(1e30), most = vec3(-1e30);
    ivec2 last = push.picture - 1;
    for (int y = 0; y < EXACT_TILE; ++y) {
        for (int x = 0; x < EXACT_TILE; ++x) {
            ivec2 at = min(ivec2(tile) * EXACT_TILE + ivec2(x, y), last);
            vec4 path = texelFetch(paths, at, 0);
            // Two texels on a diagonal: a line as thin as a texel passes through one of them somewhere in the tile.
            vec4 first = texelFetch(texels, at * push.grid, 0);
            vec3 last_color = texelFetch(texels, at * push.grid + push.grid - 1, 0).rgb;
            least = min(least, min(first.rgb, last_color));
            most = max(most, max(first.rgb, last_color));
            float inverse = first.a;
            vec4 right = texelFetch(paths, min(at + ivec2(1, 0), last), 0);
            vec4 below = texelFetch(paths, min(at + ivec2(0, 1), last), 0);
            jump = max(jump, max(larger(right - path), larger(below - path)));
            reach = max(reach, max(abs(path.xy), abs(path.zw)));
            if (inverse > near_inverse) {
                near_inverse = inverse;
                near = path;
            }
            if (inverse < far_inverse) {
                far_inverse = inverse;
                far = path;
            }
        }
    }
    imageStore(tile_near, ivec2(tile), near);
    imageStore(tile_far, ivec2(tile), far);
    vec3 away = 0.5 * (most - least);
    imageStore(tile_colors, ivec2(tile), vec4(0.5 * (least + most), max(away.r, max(away.g, away.b))));
    float jumps = jump < EXACT_SMOOTH_PX ? 0.0 : EXACT_JUMPS;
    imageStore(tile_facts, ivec2(tile), vec4(near_inverse, far_inverse, reach.x, reach.y + jumps));
}
