#version 460
// Blur of `--method exact`: the mean, over a line's exposure, of what passes each pixel. The supersampled picture shows
// every line at the middle of its exposure; for each instant tau of the exposure (-0.5 to 0.5) the place is sought
// whose path leads it to the pixel then, and its radiance taken.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "exact_tile.glsl"
#include "rgb9e5.glsl"
// What lists the tiles: 0 at rest, 1 one surface, 2 several.
layout(constant_id = 0) const int WAY = 1;
// There are pictures of the begin and the end of the exposure.
layout(constant_id = 1) const bool UNCOVER = false;
// Texels of a pixel's side.
layout(constant_id = 2) const int GRID = 2;
// Behind a function, because the build's reflection does not evaluate comparisons of constants.
int grid() { return GRID; }
// Linear radiance, as words of a texel and of the one to its right.
layout(set = 0, binding = 0) uniform usampler2D texels;
// 1/m, inverse distance.
layout(set = 0, binding = 6) uniform sampler2D inverses;
layout(set = 0, binding = 1) uniform sampler2D paths;
layout(set = 0, binding = 2) uniform sampler2D around_near;
layout(set = 0, binding = 3) uniform sampler2D around_far;
// RGB: linear radiance by pixel, at the begin and at the end of each line's exposure; bilinear.
layout(set = 0, binding = 8) uniform sampler2D early;
layout(set = 0, binding = 9) uniform sampler2D late;
// RGB: linear radiance. A: number of samples, negative where one lay beyond the rendered picture.
layout(set = 0, binding = 5, rgba32f) uniform writeonly image2D radiance;
// Four words a texel: the size of the dispatch and the number of tiles, then the tiles. Not a storage buffer, which a
// software device reads lane by lane.
layout(set = 0, binding = 7) uniform usamplerBuffer listed;
layout(push_constant) uniform Push {
    uvec2 size;
    // px rendered beyond each side, and all with them.
    vec2 margin_px;
    vec2 picture_px;
    // Of the picture's sides.
    vec2 share_per_px;
    // tau per line in scan order, as a vector over the picture: what a line later is seen later by.
    vec2 tau_per_px;
    // Where `early` and `late` were drawn, as far as they can be read between pixels.
    vec2 drawn_from_px;
    vec2 drawn_to_px;
    // Most samples.
    int most;
    uint tiles_across;
} push;

// A place belongs to the pixel at an instant if its path leads it this near, px.
const float HIT_PX = 0.75;
// Half the distance of two bilinear samples that stand for a pixel's width of texels of half a px, px. The pixel's box
// has a variance of 1/12 px^2 an axis. A texel is a box itself, 1/48, and reading it bilinearly at any phase adds 1/24:
// the samples may add 1/48, the square of this. Quarters, which would be right without these two, lose 1 to 2 dB.
const float SPREAD_PX = 0.14434;

// A px of a path has a sample; of what is longer than this, px, every second one has.
const float DENSE_PX = 12.0;

float samples_of(float length_px) {
    return min(length_px, 0.5 * (length_px + DENSE_PX));
}

// A pixel that is one texel is not spread.
float spread_px() {
    return grid() == 1 ? 0.0 : SPREAD_PX;
}

// Displacement at tau: the parabola through the three known points.
vec2 along(vec4 path, float tau) {
    return tau * (path.zw - path.xy) + 2.0 * tau * tau * (path.zw + path.xy);
}

bool beyond = false;

void note_beyond(vec2 at) {
    beyond = beyond || any(lessThan(at, vec2(0.0))) || any(greaterThan(at, push.picture_px));
}

// Of the pixel there, or of the nearest in the picture. Pixels and texels are not fetched but sampled (nearest),
// because lavapipe 22.3 looks up the level of each lane for a fetch.
vec4 path_at(vec2 at) {
    return textureLod(paths, at * push.share_per_px, 0.0);
}

// Bilinear between texels.
vec3 radiance_at(vec2 at) {
    vec2 from = max(at * float(grid()) - 0.5, 0.0);
    vec2 first = floor(from);
    vec2 away = from - first;
    vec2 per_texel = push.share_per_px / float(grid());
    vec2 share = (first + 0.5) * per_texel;
    uvec2 upper = textureLod(texels, share, 0.0).xy;
    uvec2 lower = textureLod(texels, vec2(share.x, share.y + per_texel.y), 0.0).xy;
    float across = away.x * away.y;
    return rgb9e5_weighed(upper.x, 1.0 - away.x - away.y + across) + rgb9e5_weighed(upper.y, away.x - across) +
           rgb9e5_weighed(lower.x, away.y - across) + rgb9e5_weighed(lower.y, across);
}

// Where what is at `pixel` at tau was in the picture, following `path` and correcting it by what is found there.
vec2 origin_of(vec2 pixel, float line, vec4 path, float tau) {
    // One step: a second one brings less than 0.1 dB, where paths vary as smoothly as here.
    vec2 at = pixel - along(path, tau);
    return pixel - along(path_at(at), tau + line - dot(push.tau_per_px, at));
}

// Mean of the pixel's box around its centre: samples at the centres of texels.
vec3 box_at(vec2 at) {
    if (grid() == 2) {
        uvec2 upper = textureLod(texels, (at - 0.25) * push.share_per_px, 0.0).xy;
        uvec2 lower = textureLod(texels, (at + vec2(-0.25, 0.25)) * push.share_per_px, 0.0).xy;
        return rgb9e5_weighed(upper.x, 0.25) + rgb9e5_weighed(upper.y, 0.25) + rgb9e5_weighed(lower.x, 0.25) +
               rgb9e5_weighed(lower.y, 0.25);
    }
    float q = grid() == 1 ? 0.0 : 0.25;
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
    // Two samples a step of a px, opposite each other, so that none is early or late on average. Across the path they
    // make up the pixel's box; along it they take turns, and the path itself is the wider filter. Unrolled by two
    // steps.
    vec2 way = abs(end - begin);
    vec2 side = spread_px() * (way.x > way.y ? vec2(0.0, 1.0) : vec2(1.0, 0.0));
    vec2 ahead = spread_px() - side;
    vec2 even = side + ahead, odd = side - ahead;
    int pairs = clamp(int(ceil(0.5 * samples_of(length(begin) + length(end)))), 1, push.most / 2);
    // The middles of n equal steps vary by less than what they stand for, by a factor of 1 - 1/n^2: they are moved
    // apart until they vary as much. Two are then Gauss's, and the mean over a parabola is exact. Not four: there it
    // would cost textures finer than 3 px half a decibel and gain edges a fifth.
    float count = 2.0 * float(pairs);
    float apart = pairs == 2 ? 1.0 : inversesqrt(1.0 - 1.0 / (count * count));
    float step_tau = apart / count;
    vec2 linear = end - begin, square = 2.0 * (end + begin);
    vec3 sum = vec3(0.0);
    for (int i = 0; i < pairs; ++i) {
        float tau = (2.0 * float(i) + 0.5) * step_tau - 0.5 * apart;
        float next = tau + step_tau;
        vec2 first = pixel + tau * (linear + tau * square);
        vec2 second = pixel + next * (linear + next * square);
        sum += radiance_at(first + even) + radiance_at(first - even)
            + radiance_at(second + odd) + radiance_at(second - odd);
    }
    return vec4(sum / float(4 * pairs), float(2 * pairs));
}

// Several surfaces: at every instant, the nearest place whose path leads here, and what is on both sides of it.
vec4 gather_layers(vec2 pixel, float line, vec4 seeds[3], float length_px) {
    int count = 2 * clamp(int(ceil(0.5 * samples_of(length_px))), 2, push.most / 2);
    vec3 sum = vec3(0.0);
    // The pixel's own path stands for that of the two which it is nearer to: a third candidate costs a third more and
    // brings less than 0.1 dB.
    vec4 to_near = seeds[1] - seeds[0], to_far = seeds[2] - seeds[0];
    vec4 candidates[2] = vec4[2](seeds[0], dot(to_near, to_near) > dot(to_far, to_far) ? seeds[1] : seeds[2]);
    for (int i = 0; i < count; ++i) {
        float tau = (float(i) + 0.5) / float(count) - 0.5;
        float nearest = -1.0;
        vec2 found = pixel - along(seeds[1], tau);
        for (int s = 0; s < 2; ++s) {
            vec2 at = pixel - along(candidates[s], tau);
            at = pixel - along(path_at(at), tau + line - dot(push.tau_per_px, at));
            vec2 off = at + along(path_at(at), tau + line - dot(push.tau_per_px, at)) - pixel;
            float inverse = textureLod(inverses, at * push.share_per_px, 0.0).r;
            if (dot(off, off) < HIT_PX * HIT_PX && inverse > nearest) {
                nearest = inverse;
                found = at;
            }
        }
        note_beyond(found);
        // The diagonals of the pixel take turns.
        vec2 aside = spread_px() * vec2((i & 1) == 0 ? -1.0 : 1.0, 1.0);
        vec3 seen = radiance_at(found + aside) + radiance_at(found - aside);
        if (UNCOVER) {
            // What is hidden at the middle and not now is what lies farthest, and is in view until the end, or from the
            // begin on.
            vec4 path = seeds[2];
            vec2 place = pixel - along(path, tau) + (tau < 0.0 ? path.xy : path.zw);
            bool drawn = all(greaterThanEqual(place, push.drawn_from_px))
                && all(lessThanEqual(place, push.drawn_to_px));
            vec3 uncovered = tau < 0.0 ? textureLod(early, place * push.share_per_px, 0.0).rgb
                                       : textureLod(late, place * push.share_per_px, 0.0).rgb;
            seen = nearest < 0.0 && drawn ? 2.0 * uncovered : seen;
        }
        sum += seen;
    }
    return vec4(sum / float(2 * count), float(count));
}

vec4 gather(vec2 pixel, ivec2 tile) {
    if (WAY == 0) {
        return vec4(box_at(pixel), 1.0);
    }
    vec4 own = path_at(pixel);
    float line = dot(push.tau_per_px, pixel);
    if (WAY == 1) {
        return gather_smooth(pixel, line, own);
    }
    vec4 seeds[3] = vec4[3](own, texelFetch(around_near, tile, 0), texelFetch(around_far, tile, 0));
    float longest = 0.0;
    for (int s = 0; s < 3; ++s) {
        longest = max(longest, length(seeds[s].xy) + length(seeds[s].zw));
    }
    return gather_layers(pixel, line, seeds, longest);
}

void main() {
    uint count = texelFetch(listed, 0).w;
    for (uint i = gl_WorkGroupID.x; i < count; i += gl_NumWorkGroups.x) {
        uint number = texelFetch(listed, 1 + int(i >> 2))[i & 3u];
        ivec2 tile = ivec2(number % push.tiles_across, number / push.tiles_across);
        ivec2 place = tile * EXACT_TILE + ivec2(gl_LocalInvocationID.xy) - ivec2(push.margin_px);
        if (any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, ivec2(push.size)))) {
            continue;
        }
        beyond = false;
        vec4 seen = gather(vec2(place) + 0.5 + push.margin_px, tile);
        imageStore(radiance, place, vec4(seen.rgb, beyond ? -seen.a : seen.a));
    }
}
