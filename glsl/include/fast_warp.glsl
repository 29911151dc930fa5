// The gather of `--method fast`. Twin: src/reference/fast_warp.rs. Needs fast_push, path, sample.
#ifndef FAST_WARP_GLSL
#define FAST_WARP_GLSL

// Texels of the colour a px: 1 or 2.
layout(constant_id = 2) const int COLOR_SCALE = 2;

// Claims of one slot in the neighbourhood of a pixel.
struct SlotClaims {
    uint nearest;
    uint farthest;
    // Whether all of them can be of one surface.
    bool agree;
};

struct Claims {
    SlotClaims slot[3];
    bool one_surface;
};

SlotClaims slot_claims(uint slot, ivec2 pixel) {
    SlotClaims c = SlotClaims(0u, 0xffffffffu, false);
    ivec2 low = ivec2(1 << 20);
    ivec2 high = -low;
    int count = 0;
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 at = clamp(pixel + ivec2(x, y), ivec2(0), ivec2(push.size) - 1);
            uint key = seeds[seed_index(slot, at)];
            if (key != 0u) {
                c.nearest = max(c.nearest, key);
                c.farthest = min(c.farthest, key);
                low = min(low, seed_offset(key));
                high = max(high, seed_offset(key));
                ++count;
            }
        }
    }
    c.agree = count >= 4 && all(lessThanEqual(high - low, ivec2(1)));
    return c;
}

Claims claims_around(ivec2 pixel) {
    Claims c;
    c.slot[0] = slot_claims(0u, pixel);
    c.slot[1] = c.slot[0];
    c.slot[2] = c.slot[0];
    c.one_surface = c.slot[0].agree;
    if (push.slots > 1u) {
        c.slot[1] = slot_claims(1u, pixel);
        c.slot[2] = slot_claims(2u, pixel);
        c.one_surface = c.one_surface && c.slot[1].agree && c.slot[2].agree;
    }
    return c;
}

// Where the reference picture shows what a pixel sees at begin, middle and end of its exposure, px.
struct Sources {
    vec2 begin_px;
    vec2 middle_px;
    vec2 end_px;
};

// Sources on one surface; false where the surfaces that land at begin, middle and end are not the same one.
bool sources_over_exposure(vec2 x_px, Claims claims, float from, float span, out Sources s) {
    int reference = int(push.reference_knot);
    int last = int(push.last_knot);
    vec2 guess = x_px + vec2(seed_offset(claims.slot[1].nearest));
    precise float middle = from + 0.5 * span;
    s.middle_px = source_of(x_px, guess, path_weights(middle, reference, last));
    s.begin_px = s.middle_px;
    s.end_px = s.middle_px;
    if (push.slots == 1u) {
        return true;
    }
    s.begin_px = source_of(x_px, s.middle_px, path_weights(from, reference, last));
    s.end_px = source_of(x_px, s.middle_px, path_weights(from + span, reference, last));
    // A claim is whole px, and its parabola may be off by one more.
    vec2 begin_off = abs(x_px + vec2(seed_offset(claims.slot[0].nearest)) - s.begin_px);
    vec2 end_off = abs(x_px + vec2(seed_offset(claims.slot[2].nearest)) - s.end_px);
    return max(max(begin_off.x, begin_off.y), max(end_off.x, end_off.y)) < 3.0;
}

// Mean of the picture over one px around a position: what the pixel's area saw. At a pixel's centre the mean of its
// texels, to the bit.
vec3 read_pixel_area(vec2 position_px, inout bool clamped) {
    ivec2 size = textureSize(color, 0);
    precise vec2 wanted = (position_px - 0.5) * float(COLOR_SCALE);
    vec2 inside = clamp(wanted, vec2(0.0), vec2(size - COLOR_SCALE));
    clamped = clamped || inside != wanted;
    ivec2 near = clamp(ivec2(inside), ivec2(0), size - COLOR_SCALE);
    precise vec2 f = inside - vec2(near);
    precise vec3 sum = vec3(0.0);
    for (int y = 0; y <= COLOR_SCALE; ++y) {
        int row = min(near.y + y, size.y - 1);
        precise vec3 along = (1.0 - f.x) * texelFetch(color, ivec2(near.x, row), 0).rgb;
        for (int x = 1; x < COLOR_SCALE; ++x) {
            along = along + texelFetch(color, ivec2(near.x + x, row), 0).rgb;
        }
        along = along + f.x * texelFetch(color, ivec2(min(near.x + COLOR_SCALE, size.x - 1), row), 0).rgb;
        float weight = y == 0 ? 1.0 - f.y : (y == COLOR_SCALE ? f.y : 1.0);
        sum = sum + weight * along;
    }
    precise vec3 mean = sum / (float(COLOR_SCALE) * float(COLOR_SCALE));
    return mean;
}

// Samples for a path, px: steps of at most a px, both ends included.
int blur_samples(float path_px) {
    return path_px < 0.02 ? 1 : int(min(ceil(path_px - 0.001) + 1.0, float(push.max_samples)));
}

// Mean over the exposure along the parabola through three sources: no motion is read for it.
vec4 blur_one_surface(Sources s) {
    precise vec2 chord = s.end_px - s.begin_px;
    precise vec2 bend = 2.0 * (s.begin_px + s.end_px - 2.0 * s.middle_px);
    float path_px = sqrt(squared(s.middle_px - s.begin_px)) + sqrt(squared(s.end_px - s.middle_px));
    int count = blur_samples(path_px);
    precise vec3 sum = vec3(0.0);
    bool clamped = false;
    for (int i = 0; i < count; ++i) {
        precise float t = (float(i) + 0.5) / float(count) - 0.5;
        precise vec2 position = s.middle_px + t * (chord + t * bend);
        vec3 value = read_pixel_area(position, clamped);
        if (count == 1) {
            return vec4(value, clamped ? -1.0 : 1.0);
        }
        sum = sum + value;
    }
    precise vec3 mean = sum / float(count);
    return vec4(mean, clamped ? -float(count) : float(count));
}

// Follows one claim to what it shows at `x_px`: the source, and its inverse depth. False where it does not land there:
// then what is farther of the last two places, which is what lies beside a hidden one.
bool follow(vec2 x_px, uint key, PathWeights w, out vec2 source_px, out float depth) {
    precise vec2 p = x_px + vec2(seed_offset(key));
    vec2 before = p;
    for (int i = 0; i < 3; ++i) {
        before = p;
        p = x_px - nearest_displacement(p, w);
    }
    depth = texelFetch(inverse_depth, path_texel(p), 0).r;
    source_px = p;
    if (squared(p - before) < 0.25) {
        return true;
    }
    float depth_before = texelFetch(inverse_depth, path_texel(before), 0).r;
    if (depth_before < depth) {
        depth = depth_before;
        source_px = before;
    }
    return false;
}

const vec2 QUARTERS[4] = vec2[4](vec2(-0.25), vec2(0.25), vec2(0.25, -0.25), vec2(-0.25, 0.25));

// Mean over the exposure where several surfaces come by: every sample, at a quarter of the pixel in turn, asks all
// claims and takes the nearest that really lands there, or else the farthest that almost does.
vec4 blur_many_surfaces(vec2 x_px, Claims claims, float from, float span) {
    float reach_px = 0.0;
    for (int k = 0; k < 3; k += 2) {
        vec2 travelled = vec2(seed_offset(claims.slot[k].nearest) - seed_offset(claims.slot[1].nearest));
        reach_px = reach_px + sqrt(squared(travelled));
    }
    int count = 4 * ((min(blur_samples(reach_px), 64) + 3) / 4);
    precise vec3 sum = vec3(0.0);
    bool clamped = false;
    for (int i = 0; i < count; ++i) {
        precise float t = (float(i) + 0.5) / float(count);
        PathWeights w = path_weights(from + t * span, int(push.reference_knot), int(push.last_knot));
        precise vec2 at_px = x_px + QUARTERS[i & 3];
        float nearest = -1.0;
        float farthest = 3e38;
        vec2 source_px = at_px;
        vec2 beside_px = at_px;
        SlotClaims around = t < 0.5 ? claims.slot[0] : claims.slot[2];
        for (int k = 0; k < 4; ++k) {
            uint key = k == 0 ? claims.slot[1].nearest
                              : (k == 1 ? claims.slot[1].farthest : (k == 2 ? around.nearest : around.farthest));
            if (key == 0u || key == 0xffffffffu) {
                continue;
            }
            vec2 p;
            float depth;
            bool lands = follow(at_px, key, w, p, depth);
            if (lands && depth > nearest) {
                nearest = depth;
                source_px = p;
            }
            if (!lands && depth < farthest) {
                farthest = depth;
                beside_px = p;
            }
        }
        vec2 position = nearest >= 0.0 ? source_px : beside_px;
        sum = sum + sample_bilinear(color, position * float(COLOR_SCALE), clamped).rgb;
    }
    precise vec3 mean = sum / float(count);
    return vec4(mean, clamped ? -float(count) : float(count));
}

#endif
