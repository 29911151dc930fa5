// Where several surfaces are seen during the exposure. Twin: src/reference/fast_silhouettes.rs. Needs fast_push,
// fast_claims, path, sample, fast_lens, fast_weight.
#ifndef FAST_SILHOUETTES_GLSL
#define FAST_SILHOUETTES_GLSL

// Steps that lead from a claim to what it shows, and the last one's length, px, if it really lands there.
const int FOLLOW_STEPS = 3;
const float LANDED_PX = 0.5;
const int BISECTIONS = 3;
// Ratio of depths between which a silhouette lies; how far from it texels hold both surfaces, and how far that is given
// way, px.
const float OTHER_DEPTH = 1.15;
const float SILHOUETTE_REACH_PX = 0.5;
const float GIVE_WAY_PX = 0.5;
// Most samples of a pixel.
const int MAX_SILHOUETTE_SAMPLES = 64;

// What a claim shows at a place and instant.
struct Followed {
    vec2 source_px;
    float inverse_depth;
    bool lands;
};

float inverse_depth_at(vec2 position_px) {
    return texel_of(inverse_depth, path_texel(position_px)).r;
}

// Between a place on the nearer surface and one on the farther: the first beyond the silhouette, by bisection, and
// half a px more, because the texels at the edge hold both.
vec2 beside_silhouette(vec2 near_px, vec2 far_px, float threshold) {
    precise vec2 a = near_px;
    precise vec2 b = far_px;
    for (int i = 0; i < BISECTIONS; ++i) {
        precise vec2 middle = 0.5 * (a + b);
        if (inverse_depth_at(middle) > threshold) {
            a = middle;
        } else {
            b = middle;
        }
    }
    precise vec2 way = far_px - near_px;
    precise vec2 inwards = way * min(1.0, 0.5 / sqrt(max(squared(way), 1e-6)));
    precise vec2 beside = b + inwards;
    return beside;
}

// The claimed surface's source by fixed-point iteration. What does not land on `x_px` is hidden in the picture: the
// iteration then swings between the surface that hides it and what is visible of its own, and the visible place closest
// to the hidden one is taken.
Followed follow(vec2 x_px, vec2 from_px, PathWeights w) {
    precise vec2 p = from_px;
    vec2 before = p;
    for (int i = 0; i < FOLLOW_STEPS; ++i) {
        before = p;
        p = x_px - nearest_displacement(p, w);
    }
    float depth = inverse_depth_at(p);
    if (squared(p - before) < LANDED_PX * LANDED_PX) {
        return Followed(p, depth, true);
    }
    float depth_before = inverse_depth_at(before);
    bool swap = depth_before > depth;
    float far_depth = min(depth, depth_before);
    precise float threshold = 0.5 * (depth + depth_before);
    return Followed(beside_silhouette(swap ? before : p, swap ? p : before, threshold), far_depth, false);
}

// How far a place gives way in a direction, px: texels at a silhouette hold both surfaces, and where the nearer one has
// moved off they would show a seam of it. Not further than it has moved.
float give_way(vec2 position_px, vec2 towards, float own_depth, vec2 own_px, PathWeights w) {
    vec2 beside = position_px + SILHOUETTE_REACH_PX * towards;
    precise vec2 moved = nearest_displacement(beside, w) - own_px;
    precise float off = moved.x * towards.x + moved.y * towards.y;
    return inverse_depth_at(beside) > OTHER_DEPTH * own_depth ? clamp(off, 0.0, GIVE_WAY_PX) : 0.0;
}

// Path images of one texel a px do not know the silhouette well enough for that.
vec2 clear_of_seams(vec2 position_px, PathWeights w) {
    if (path_scale() == 1) {
        return position_px;
    }
    float own = inverse_depth_at(position_px);
    vec2 own_px = nearest_displacement(position_px, w);
    precise vec2 away = vec2(give_way(position_px, vec2(-1.0, 0.0), own, own_px, w) -
                                 give_way(position_px, vec2(1.0, 0.0), own, own_px, w),
                             give_way(position_px, vec2(0.0, -1.0), own, own_px, w) -
                                 give_way(position_px, vec2(0.0, 1.0), own, own_px, w));
    precise vec2 clear = position_px + away;
    return clear;
}

const vec2 QUARTERS[4] = vec2[4](vec2(-0.25), vec2(0.25), vec2(0.25, -0.25), vec2(-0.25, 0.25));

// With blur one for every px that the nearest surface moves, but two a quarter at least, else one.
int silhouette_samples(SlotClaims begin, SlotClaims end) {
    float path_px = length(vec2(seed_offset(begin.nearest) - seed_offset(end.nearest)));
    return blurs() ? clamp(2 * blur_pairs(path_px), 8, MAX_SILHOUETTE_SAMPLES) : 4;
}

// Mean over the exposure: every sample, at a quarter of the pixel in turn, asks the claims of the exposure's middle and
// of the end that is closer in time, and takes the nearest that lands there, else the farthest that almost does.
vec4 blur_many_surfaces(uvec2 pixel) {
    float fraction = readout_fraction(pixel, push.size, push.scan_order, 0u);
    precise float from = (push.start_s + push.readout_time_s * fraction) / push.knot_step_s
        + float(push.reference_knot);
    precise float span = push.exposure_time_s / push.knot_step_s;
    vec2 x_px = looks_at(ivec2(pixel));
    // How far the lens lets it look beside itself.
    precise vec2 aside_px = x_px - (vec2(pixel) + 0.5 + vec2(push.margin_px));
    Claims claimed = claims_around(ivec2(pixel));
    SlotClaims begin = slot_claims(0u, claimed);
    SlotClaims middle = slot_claims(BLUR, claimed);
    SlotClaims end = slot_claims(2u * BLUR, claimed);
    int count = silhouette_samples(begin, end);
    // In a gap too wide for any claim the search starts from the place itself.
    bool gap = max(middle.nearest, max(begin.nearest, end.nearest)) == 0u;
    middle.nearest = gap ? seed_key(0.0, ivec2(floor(aside_px + 0.5))) : middle.nearest;
    precise vec3 sum = vec3(0.0);
    bool clamped = false;
    int landed = 0;
    for (int i = 0; i < count; ++i) {
        precise float t = (float(i) + 0.5) / float(count);
        precise float at = from + t * span;
        PathWeights w = path_weights(at, int(push.reference_knot), int(push.last_knot));
        precise vec2 at_px = x_px + QUARTERS[i & 3];
        SlotClaims around = t < 0.5 ? begin : end;
        float nearest = -1.0;
        float farthest = 3e38;
        vec2 source_px = at_px;
        vec2 beside_px = at_px;
        for (int k = 0; k < 4; ++k) {
            SlotClaims from_slot = k < 2 ? middle : around;
            uint key = (k & 1) == 0 ? from_slot.nearest : from_slot.farthest;
            if (key != 0u && key != NO_CLAIM) {
                Followed f = follow(at_px, at_px - aside_px + vec2(seed_offset(key)), w);
                if (f.lands && f.inverse_depth > nearest) {
                    nearest = f.inverse_depth;
                    source_px = f.source_px;
                }
                if (!f.lands && f.inverse_depth < farthest) {
                    farthest = f.inverse_depth;
                    beside_px = f.source_px;
                }
            }
        }
        landed += nearest >= 0.0 ? 1 : 0;
        precise vec2 position = clear_of_seams(nearest >= 0.0 ? source_px : beside_px, w);
        // The quarter decides who is seen. What is read is narrower, as bilinear texels have a width of their own; with
        // blur it stands for the whole pixel, because each quarter comes by too seldom to be a picture of its own.
        vec2 centre_px = position - QUARTERS[i & 3];
        vec2 aside = 4.0 * spread_px() * QUARTERS[i & 3];
        clamped = clamped || is_beyond(centre_px);
        if (blurs() && color_scale() == 2) {
            sum = sum + 0.5 * (read_between(centre_px + aside) + read_between(centre_px - aside));
        } else {
            sum = sum + read_between(color_scale() == 2 ? centre_px + aside : (blurs() ? centre_px : position));
        }
    }
    precise vec3 mean = sum / float(count);
    float seen = float(landed) / float(count);
    return result_of(mean, float(count), clamped, seen * seen * seen * seen);
}

#endif
