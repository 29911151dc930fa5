#version 460
// What may come into a tile during the exposure: nearest, farthest, reach and jumps over all tiles around that are
// within reach of it. It decides how the tile is gathered: each way has a list, and a dispatch of its own, because a
// software device runs every side of a branch.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "exact_tile.glsl"
layout(set = 0, binding = 0) uniform sampler2D tile_near;
layout(set = 0, binding = 1) uniform sampler2D tile_far;
layout(set = 0, binding = 2) uniform sampler2D tile_facts;
layout(set = 0, binding = 9) uniform sampler2D tile_colors;
layout(set = 0, binding = 3, rgba16f) uniform writeonly image2D around_near;
layout(set = 0, binding = 4, rgba16f) uniform writeonly image2D around_far;
struct List {
    // Size of the gather's dispatch.
    uvec3 groups;
    uint count;
};
layout(set = 0, binding = 6, std430) buffer Resting {
    List list;
    uint tiles[];
} resting;
layout(set = 0, binding = 7, std430) buffer Smooth {
    List list;
    uint tiles[];
} smooth_tiles;
layout(set = 0, binding = 8, std430) buffer Layered {
    List list;
    uint tiles[];
} layered;
layout(push_constant) uniform Push {
    // Tiles.
    uvec2 size;
    // First tile and first tile not that hold delivered pixels.
    uvec2 first;
    uvec2 end;
    // Tiles to look at on every side.
    int radius;
    // Side of a tile, px.
    float tile_px;
} push;

// Beyond the number of workgroups that every device allows, each takes several tiles.
const uint MOST_GROUPS = 65535u;

// The order of a list changes from run to run, and nothing depends on it: tiles share no output.
#define PUT(to, tile) \
    { \
        uint place = atomicAdd(to.list.count, 1u); \
        to.tiles[place] = tile; \
        if (place < MOST_GROUPS) { \
            atomicAdd(to.list.groups.x, 1u); \
        } \
        if (place == 0u) { \
            to.list.groups.yz = uvec2(1u); \
        } \
    }

vec2 reach_of(vec4 facts) {
    return vec2(facts.z, facts.w < EXACT_JUMPS ? facts.w : facts.w - EXACT_JUMPS);
}

void main() {
    ivec2 tile = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(tile), push.size))) {
        return;
    }
    vec4 own = texelFetch(tile_facts, tile, 0);
    vec2 own_reach = reach_of(own);
    ivec2 nearest = tile, farthest = tile;
    float near_inverse = own.x, far_inverse = own.y;
    vec2 reach = own_reach;
    bool jumps = own.w >= EXACT_JUMPS;
    vec3 color = texelFetch(tile_colors, tile, 0).rgb;
    float differs = 0.0;
    ivec2 low = max(tile - push.radius, ivec2(0));
    ivec2 high = min(tile + push.radius, ivec2(push.size) - 1);
    for (int y = low.y; y <= high.y; ++y) {
        for (int x = low.x; x <= high.x; ++x) {
            vec4 other = texelFetch(tile_facts, ivec2(x, y), 0);
            vec2 other_reach = reach_of(other);
            vec2 steps = vec2(max(abs(ivec2(x, y) - tile) - 1, ivec2(0)));
            // What rests here may be read from as far as this tile's own content moves, and what moves there may come
            // here.
            if (any(greaterThan(steps * push.tile_px, max(other_reach, own_reach)))) {
                continue;
            }
            if (other.x > near_inverse) {
                nearest = ivec2(x, y);
                near_inverse = other.x;
            }
            if (other.y < far_inverse) {
                farthest = ivec2(x, y);
                far_inverse = other.y;
            }
            reach = max(reach, other_reach);
            vec4 other_color = texelFetch(tile_colors, ivec2(x, y), 0);
            vec3 away = abs(other_color.rgb - color) + other_color.a;
            differs = max(differs, max(away.r, max(away.g, away.b)));
            jumps = jumps || other.w >= EXACT_JUMPS;
        }
    }
    imageStore(around_near, tile, texelFetch(tile_near, nearest, 0));
    imageStore(around_far, tile, texelFetch(tile_far, farthest, 0));
    if (any(lessThan(uvec2(tile), push.first)) || any(greaterThanEqual(uvec2(tile), push.end))) {
        return;
    }
    uint number = uint(tile.y) * push.size.x + uint(tile.x);
    // Where all that may come has one colour, nothing that moves is seen to. Not so near a silhouette: what it hides
    // may have any colour.
    bool flat_color = !jumps && differs <= EXACT_FLAT_SHARE * max(color.r, max(color.g, color.b)) + EXACT_FLAT;
    if (flat_color || max(reach.x, reach.y) < EXACT_SHORTEST_PX) {
        PUT(resting, number)
    } else if (!jumps) {
        PUT(smooth_tiles, number)
    } else {
        PUT(layered, number)
    }
}
