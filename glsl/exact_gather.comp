#version 460
// Blur of `--method exact`: the mean, over a line's exposure, of what passes each pixel. The supersampled picture shows
// every line at the middle of its exposure; for each instant tau of the exposure (-0.5 to 0.5) the place is sought whose
// path leads it to the pixel then, and its radiance taken.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 16, local_size_y = 8) in;
#include "exact_tile.glsl"
// RGB: linear radiance; its sampler counts in texels.
layout(set = 0, binding = 0) uniform sampler2D texels;
// The same image by texel. A: 1/m, inverse distance.
layout(set = 0, binding = 6) uniform sampler2D inverses;
layout(set = 0, binding = 1) uniform sampler2D paths;
layout(set = 0, binding = 2) uniform sampler2D around_near;
layout(set = 0, binding = 3) uniform sampler2D around_far;
layout(set = 0, binding = 4) uniform sampler2D around_facts;
// RGB: linear radiance. A: number of samples, negative where one lay beyond the rendered picture.
layout(set = 0, binding = 5, rgba32f) uniform writeonly image2D radiance;
layout(push_constant) uniform Push {
    uvec2 size;
    // px rendered beyond each side, and all with them.
    vec2 margin_px;
    vec2 picture_px;
    // tau per line in scan order, as a vector over the picture: what a line later is seen later by.
    vec2 tau_per_px;
    // Most samples.
    int most;
    float grid;
} push;

// Paths that jump by less from one px to the next are those of one surface.
const float SMOOTH_PX = 0.35;
// A place belongs to the pixel at an instant if its path leads it this near, px.
const float HIT_PX = 0.75;
// Shorter paths are not seen.
const float RATE = 0.5;
const float QOFF = 0.1443;
const float SHORTEST_PX = 0.02;

// Centres of the pixel's quarters, from its middle; a pixel that is one texel has no quarters.
float quarter_px() {
    return push.grid > 1.5 ? QOFF : 0.0;
}

// Displacement at tau: the parabola through the three known points.
vec2 along(vec4 path, float tau) {
    return tau * (path.zw - path.xy) + 2.0 * tau * tau * (path.zw + path.xy);
}

bool beyond = false;

void note_beyond(vec2 at) {
    beyond = beyond || any(lessThan(at, vec2(0.0))) || any(greaterThan(at, push.picture_px));
}

ivec2 inside(vec2 at) {
    return ivec2(clamp(at, vec2(0.0), push.picture_px - 1.0));
}

vec4 path_at(vec2 at) {
    return texelFetch(paths, inside(at), 0);
}

// Bilinear between texels.
vec3 radiance_at(vec2 at) {
    return textureLod(texels, at * push.grid, 0.0).rgb;
}

// Where what is at `pixel` at tau was in the picture, following `path` and correcting it by what is found there.
vec2 origin_of(vec2 pixel, float line, vec4 path, float tau) {
    vec2 at = pixel - along(path, tau);
    for (int i = 0; i < 2; ++i) {
        at = pixel - along(path_at(at), tau + line - dot(push.tau_per_px, at));
    }
    return at;
}

// Mean of the pixel's box around a place: bilinear samples at the centres of its quarters.
vec3 box_at(vec2 at) {
    float q = push.grid > 1.5 ? 0.25 : 0.0;
    return 0.25 * (radiance_at(at + vec2(-q, -q)) + radiance_at(at + vec2(q, -q)) + radiance_at(at + vec2(-q, q)) +
                   radiance_at(at + vec2(q, q)));
}

// One surface all around: the path backwards is smooth, so three of its points give the rest.
vec4 gather_smooth(vec2 pixel, float line, vec4 path) {
    vec2 begin = origin_of(pixel, line, path, -0.5) - pixel;
    vec2 end = origin_of(pixel, line, path, 0.5) - pixel;
    vec4 back = vec4(begin, end);
    note_beyond(pixel + begin);
    note_beyond(pixel + end);
    // Two samples a step of a px. Across the path they make up the pixel's box; along it they take turns, so that steps
    // are half as long, and the path itself is the wider filter.
    vec2 way = abs(end - begin);
    float q = quarter_px();
    int count = 4 * clamp(int(ceil(RATE * (length(begin) + length(end)))), 1, push.most / 4);
    vec3 sum = vec3(0.0);
    float tau = 0.5 / float(count) - 0.5, step_tau = 1.0 / float(count);
    for (int i = 0; i < count; i += 4) {
        sum += radiance_at(pixel + along(back, tau) + vec2(-q, -q));
        sum += radiance_at(pixel + along(back, tau + step_tau) + vec2(q, q));
        sum += radiance_at(pixel + along(back, tau + 2.0 * step_tau) + vec2(q, -q));
        sum += radiance_at(pixel + along(back, tau + 3.0 * step_tau) + vec2(-q, q));
        tau += 4.0 * step_tau;
    }
    return vec4(sum / float(count), float(count));
}

// Several surfaces: at every instant, the nearest place whose path leads here.
vec4 gather_layers(vec2 pixel, float line, vec4 seeds[3], float length_px) {
    int count = 4 * clamp(int(ceil(0.75 * length_px)), 4, push.most / 4);
    vec3 sum = vec3(0.0);
    for (int i = 0; i < count; ++i) {
        float tau = (float(i) + 0.5) / float(count) - 0.5;
        // The quarters of the pixel take turns.
        vec2 turn = vec2((i & 1) == 0 ? -1.0 : 1.0, ((i ^ (i >> 1)) & 1) == 0 ? -1.0 : 1.0);
        vec2 x = pixel + quarter_px() * turn;
        float nearest = -1.0;
        vec2 found = x - along(seeds[1], tau);
        for (int s = 0; s < 3; ++s) {
            vec2 at = x - along(seeds[s], tau);
            at = x - along(path_at(at), tau + line - dot(push.tau_per_px, at));
            vec2 off = at + along(path_at(at), tau + line - dot(push.tau_per_px, at)) - x;
            float inverse = texelFetch(inverses, ivec2(clamp(at, vec2(0.0), push.picture_px - 0.01) * push.grid), 0).a;
            if (dot(off, off) < HIT_PX * HIT_PX && inverse > nearest) {
                nearest = inverse;
                found = at;
            }
        }
        note_beyond(found);
        sum += radiance_at(found);
    }
    return vec4(sum / float(count), float(count));
}

void main() {
    uvec2 place = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(place, push.size))) {
        return;
    }
    vec2 pixel = vec2(place) + 0.5 + push.margin_px;
    vec4 own = path_at(pixel);
    ivec2 tile = ivec2(pixel) / EXACT_TILE;
    vec4 facts = texelFetch(around_facts, tile, 0);
    float line = dot(push.tau_per_px, pixel);
    vec4 seen;
    if (facts.z < SHORTEST_PX) {
        seen = vec4(box_at(pixel), 1.0);
    } else if (facts.w < SMOOTH_PX) {
        seen = gather_smooth(pixel, line, own);
    } else {
        vec4 seeds[3] = vec4[3](own, texelFetch(around_near, tile, 0), texelFetch(around_far, tile, 0));
        float longest = 0.0;
        for (int s = 0; s < 3; ++s) {
            longest = max(longest, length(seeds[s].xy) + length(seeds[s].zw));
        }
        seen = gather_layers(pixel, line, seeds, longest);
    }
    imageStore(radiance, ivec2(place), vec4(seen.rgb, beyond ? -seen.a : seen.a));
}
