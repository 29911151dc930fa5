#version 460
// `--method fast`, first half: every texel of the reference picture finds the line that sees it, and lays claim to the
// pixel it lands on. What is nearest keeps it. Twin: src/reference/fast_seeds.rs.
//
// Claims only start the search in fast_gather, so a curve of path images is taken as a parabola here. One that follows from
// depth is followed: a camera that shakes is nowhere near the parabola through three of its places.
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

// Most that a step may take after the one before it.
const float MOST_SLOWS = 0.7;

// The parabola through begin, reference and end of what path images say: bend t^2 + slope t, t in knots from the reference.
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

// What a texel shows, and when the lines of a slot are read: time = begin + lines fraction.
struct Traced {
    ivec2 texel;
    vec2 seen;
    vec2 at_px;
    float begin;
    float lines;
};

// Where it lands by the time of the line through a place.
vec2 next_place(Traced traced, vec2 place_px) {
    precise float t = traced.begin + traced.lines * fraction_at(place_px) + float(push.reference_knot);
    precise vec2 shown_px = traced.at_px + depth_displacement(traced.texel, traced.seen, t);
    return on_sensor(shown_px);
}

// Where it lands. A step takes it a share `slows` as far as the one before it: what all further steps would bring follows from
// the last one, as a geometric series. The path is read twice for the first slot and once for each of the others.
vec2 lands_by_depth(Traced traced, bool first, vec2 from_px, inout float slows) {
    precise vec2 before_px = from_px;
    if (first) {
        before_px = next_place(traced, from_px);
    }
    vec2 place_px = next_place(traced, before_px);
    bool lines_are_rows = push.scan_order <= BOTTOM_TO_TOP;
    precise vec2 step_px = place_px - before_px;
    if (first) {
        precise vec2 longer_px = before_px - from_px;
        float of = lines_are_rows ? longer_px.y : longer_px.x;
        precise float share = (lines_are_rows ? step_px.y : step_px.x) / (of == 0.0 ? 1.0 : of);
        slows = clamp(share, -MOST_SLOWS, MOST_SLOWS);
    }
    precise vec2 lands_px = place_px + step_px * (slows / (1.0 - slows));
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
    float slows = 0.0;
    for (uint slot = 0u; slot < push.slots; ++slot) {
        precise float begin = (push.start_s + slot_fraction(slot) * push.exposure_time_s) / push.knot_step_s;
        precise float lines = push.readout_time_s / push.knot_step_s;
        if (from_depth()) {
            lands_px = lands_by_depth(Traced(texel, seen, at_px, begin, lines), slot == 0u, lands_px, slows);
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
