#version 460
// A summary of every tile: the paths of its nearest and its farthest pixel, how far paths reach, whether they jump, and
// its colours.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "exact_tile.glsl"
#include "rgb9e5.glsl"
// Words of a texel and of the one to its right.
layout(set = 0, binding = 0) uniform usampler2D texels;
layout(set = 0, binding = 1) uniform sampler2D paths;
layout(set = 0, binding = 6) uniform sampler2D inverses;
layout(set = 0, binding = 2, rgba16f) uniform writeonly image2D tile_near;
layout(set = 0, binding = 3, rgba16f) uniform writeonly image2D tile_far;
// 1/m of nearest and farthest; reach in x and in y, px, EXACT_JUMPS more in y where paths jump from one px to the next.
layout(set = 0, binding = 4, rgba32f) uniform writeonly image2D tile_facts;
// RGB: radiance half way between the least and the most. A: largest distance of a channel from it.
layout(set = 0, binding = 5, rgba16f) uniform writeonly image2D tile_colors;
layout(push_constant) uniform Push {
    // Tiles.
    uvec2 size;
    // Of the picture's sides.
    vec2 share_per_px;
    float grid;
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
    // Beyond the border the last pixel is repeated. Texels are not fetched but sampled (nearest), because lavapipe 22.3
    // looks up the level of each lane for a fetch.
    vec2 right_px = vec2(push.share_per_px.x, 0.0), down_px = vec2(0.0, push.share_per_px.y);
    vec2 corner = (vec2(ivec2(tile) * EXACT_TILE) + 0.5) * push.share_per_px;
    // From a pixel's centre to that of its last texel on a diagonal.
    vec2 aside = (0.5 - 0.5 / push.grid) * push.share_per_px;
    for (int y = 0; y < EXACT_TILE; ++y) {
        vec4 path = textureLod(paths, corner + float(y) * down_px, 0.0);
        for (int x = 0; x < EXACT_TILE; ++x) {
            vec2 at = min(corner + vec2(x, y) * push.share_per_px, 1.0 - 0.5 * push.share_per_px);
            // Two texels on a diagonal: a line as thin as a texel passes through one of them somewhere in the tile.
            vec3 first = rgb9e5_weighed(textureLod(texels, at - aside, 0.0).x, 1.0);
            vec3 last = rgb9e5_weighed(textureLod(texels, at + aside, 0.0).x, 1.0);
            least = min(least, min(first, last));
            most = max(most, max(first, last));
            float inverse = textureLod(inverses, at, 0.0).r;
            vec4 right = textureLod(paths, at + right_px, 0.0);
            vec4 below = textureLod(paths, at + down_px, 0.0);
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
            path = right;
        }
    }
    imageStore(tile_near, ivec2(tile), near);
    imageStore(tile_far, ivec2(tile), far);
    vec3 away = 0.5 * (most - least);
    imageStore(tile_colors, ivec2(tile), vec4(0.5 * (least + most), max(away.r, max(away.g, away.b))));
    float jumps = jump < EXACT_SMOOTH_PX ? 0.0 : EXACT_JUMPS;
    imageStore(tile_facts, ivec2(tile), vec4(near_inverse, far_inverse, reach.x, reach.y + jumps));
}
