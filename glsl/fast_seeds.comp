#version 460
// `--method fast`, first half: every texel of the reference picture finds the line that sees it, and lays claim to the
// pixel it lands on. What is nearest keeps it. Twin: src/reference/fast_seeds.rs.
//
// Claims only start the search in fast_gather, so a curve of path images is taken as a parabola here. One that follows
// from depth is followed: a camera that shakes is nowhere near the parabola through three of its places.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

#define MAKES_CLAIMS
#include "fast_push.glsl"
// Displacements (px) from the reference instant to knots, two an image.
layout(set = 0, binding = 1) uniform sampler2D path_0;
layout(set = 0, binding = 2) uniform sampler2D path_1;
layout(set = 0, binding = 3) uniform sampler2D path_2;
// Grows towards the camera; 0: infinitely far.
layout(set = 0, binding = 4) uniform sampler2D inverse_depth;
// Cleared; fast_gather fills it.
layout(set = 0, binding = 5, std430) buffer Listed {
    uvec3 groups;
    uint count;
    uint pixels[];
} listed;

#include "timing.glsl"
#include "path.glsl"
#include "fast_lens.glsl"

// Fraction of the readout at which the line through a position is read, continuous and limited to the picture.
float fraction_at(vec2 position_px) {
    bool lines_are_rows = push.scan_order <= BOTTOM_TO_TOP;
    bool backwards = push.scan_order == BOTTOM_TO_TOP || push.scan_order == RIGHT_TO_LEFT;
    float place = lines_are_rows ? position_px.y : position_px.x;
    float count = float(lines_are_rows ? push.size.y : push.size.x);
    precise float line = (backwards ? count - place : place) - 0.5;
    precise float fraction = clamp(line, 0.0, count - 1.0) / count;
    return fraction;
}

// What moves nearly as fast as the lines are read lands nowhere certain: least of 1 - its speed over theirs.
const float LEAST_APART = 0.3;

// The parabola through begin, reference and end of what path images say: bend t^2 + slope t, t in knots from the
// reference.
void parabola_of(ivec2 texel, out vec2 bend, out vec2 slope) {
    float reference = float(push.reference_knot);
    float after = float(push.last_knot) - reference;
    precise vec2 first_px = reference > 0.0 ? knot_displacement(texel, 0) : vec2(0.0);
    precise vec2 last_px = after > 0.0 ? knot_displacement(texel, int(push.last_knot) - 1) : vec2(0.0);
    precise vec2 b = vec2(0.0);
    precise vec2 s = after > 0.0 ? last_px / after : -first_px / max(reference, 1.0);
    if (reference > 0.0 && after > 0.0) {
        b = (last_px / after + first_px / reference) / (after + reference);
        s = last_px / after - b * after;
    }
    bend = b;
    slope = s;
}

// What a texel shows, how far the lens moves it where it is, and when the lines of a slot are read: time = begin +
// lines fraction.
struct Traced {
    ivec2 texel;
    vec2 seen;
    vec2 at_px;
    vec2 bent_px;
    float begin;
    float lines;
};

// Where a pinhole shows it by the time of the line that it lands on, from a place near there: the path is read at the
// time of that place's line, and followed straight on from there (a Newton step). The lens moves it by another bit
// there than where it came from: that is a fraction of the way, in the time of which nothing moves far.
vec2 lands_by_depth(Traced traced, vec2 near_px) {
    bool lines_are_rows = push.scan_order <= BOTTOM_TO_TOP;
    bool backwards = push.scan_order == BOTTOM_TO_TOP || push.scan_order == RIGHT_TO_LEFT;
    precise vec2 sensed_px = near_px + traced.bent_px;
    float fraction = fraction_at(sensed_px);
    precise float t = traced.begin + traced.lines * fraction + float(push.reference_knot);
    vec2 moved_px;
    vec2 rate_px;
    depth_motion(traced.texel, traced.seen, t, moved_px, rate_px);
    precise vec2 shown_px = traced.at_px + moved_px;
    float count = float(lines_are_rows ? push.size.y : push.size.x);
    // Fractions of the readout that it is behind its line, and that it moves by in all of the readout.
    precise vec2 off_px = shown_px - near_px;
    precise vec2 over_px = rate_px * traced.lines;
    float sign = backwards ? -1.0 : 1.0;
    precise float off = sign * (lines_are_rows ? off_px.y : off_px.x) / count;
    precise float over = sign * (lines_are_rows ? over_px.y : over_px.x) / count;
    precise float late = off / max(1.0 - over, LEAST_APART);
    // No line is read before the first and after the last.
    precise float last = (count - 1.0) / count - fraction;
    float follows = clamp(late, -fraction, last);
    precise vec2 lands_px = shown_px + over_px * follows;
    return lands_px;
}

void main() {
    ivec2 full = ivec2(push.size) + 2 * push.margin_px;
    ivec2 source = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(source, full))) {
        return;
    }
    ivec2 texel = source * PATH_SCALE;
    if (all(equal(source, ivec2(0)))) {
        listed.groups.yz = uvec2(1u);
    }
    precise vec2 at_px = (vec2(texel) + 0.5) / float(PATH_SCALE) - vec2(push.margin_px);
    precise vec2 bend = vec2(0.0);
    precise vec2 slope = vec2(0.0);
    if (!from_depth()) {
        parabola_of(texel, bend, slope);
    }
    vec2 seen = texel_of(inverse_depth, texel).rg;
    precise vec2 lands_px = on_sensor(at_px);
    precise vec2 bent_px = lands_px - at_px;
    precise vec2 shown_px = at_px;
    for (uint slot = 0u; slot < push.slots; ++slot) {
        precise float begin = (push.start_s + slot_fraction(slot) * push.exposure_time_s) / push.knot_step_s;
        precise float lines = push.readout_time_s / push.knot_step_s;
        if (from_depth()) {
            shown_px = lands_by_depth(Traced(texel, seen, at_px, bent_px, begin, lines), shown_px);
            lands_px = on_sensor(shown_px);
        } else {
            // The line moves with the point; later slots start from where the one before it landed.
            int steps = slot == 0u ? 4 : 2;
            for (int i = 0; i < steps; ++i) {
                precise float t = begin + lines * fraction_at(lands_px);
                precise vec2 moved_px = t * (slope + t * bend);
                lands_px = on_sensor(at_px + moved_px);
            }
        }
        ivec2 pixel = ivec2(floor(lands_px));
        ivec2 offset = source - push.margin_px - pixel;
        bool inside = all(greaterThanEqual(lands_px, vec2(0.0))) && all(lessThan(lands_px, vec2(push.size)));
        if (inside && all(lessThanEqual(abs(offset), ivec2(SEED_REACH_PX)))) {
            atomicMax(seeds[seed_index(slot, pixel)], seed_key(seen.x, offset));
        }
    }
}
