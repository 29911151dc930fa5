// Where one surface is seen all the exposure long. Twin: src/reference/fast_gather.rs. Needs fast_push, fast_claims,
// path, pixel_area, fast_lens, fast_weight.
#ifndef FAST_GATHER_GLSL
#define FAST_GATHER_GLSL

// Pixels of a workgroup of fast_silhouettes.
const uint SILHOUETTE_GROUP = 64u;

// Whether all of the picture moves as one surface does, as for a camera that only turns: there are no claims then.
layout(constant_id = 4) const uint ONE_SURFACE = 0u;

bool one_surface() { return ONE_SURFACE != 0u; }

// Where the reference picture shows what a pixel sees at begin, middle and end of its exposure, px.
struct Sources {
    vec2 begin_px;
    vec2 middle_px;
    vec2 end_px;
};

// Whether a claim's whole px, and the px by which its parabola may be off, explain where a source lies.
bool is_claimed(uint key, vec2 pixel_px, vec2 source_px) {
    vec2 off = abs(pixel_px + vec2(seed_offset(key)) - source_px);
    return max(off.x, off.y) < 2.5;
}

// Sources by one block of displacements for the whole exposure; false where it holds several surfaces.
bool sources_of_block(ivec2 block, vec2 x_px, float from, out Sources s) {
    int reference = int(push.reference_knot);
    int last = int(push.last_knot);
    precise float half_span = 0.5 * push.exposure_time_s / push.knot_step_s;
    precise float at = from + half_span;
    PathBlock model = block_displacement(block, path_weights(at, reference, last));
    s.middle_px = block_source(model, x_px);
    s.begin_px = s.middle_px;
    s.end_px = s.middle_px;
    if (blurs()) {
        at = from + 2.0 * half_span;
        s.begin_px = block_source(block_displacement(block, path_weights(from, reference, last)), x_px);
        s.end_px = block_source(block_displacement(block, path_weights(at, reference, last)), x_px);
    }
    return model.one_surface;
}

// Where all of the picture moves as one surface does: two fixed-point steps lead near enough.
void sources_without_claims(vec2 x_px, float from, out Sources s) {
    precise float at = from + 0.5 * push.exposure_time_s / push.knot_step_s;
    PathWeights w = path_weights(at, int(push.reference_knot), int(push.last_knot));
    precise vec2 p = x_px;
    for (int i = 0; i < 2; ++i) {
        p = x_px - nearest_displacement(p, w);
    }
    sources_of_block(path_block(p), x_px, from, s);
}

// Sources on one surface, that of the middle's claim; false where several come by.
bool sources_over_exposure(ivec2 pixel, vec2 x_px, float from, out Sources s) {
    if (one_surface()) {
        sources_without_claims(x_px, from, s);
        return true;
    }
    Claims claimed = claims_around(pixel);
    SlotClaims middle = slot_claims(BLUR, claimed);
    // Claims count from the pixel, wherever a lens lets it look.
    precise vec2 pixel_px = vec2(pixel) + 0.5 + vec2(push.margin_px);
    ivec2 block = path_block(pixel_px + vec2(seed_offset(middle.nearest)));
    bool agree = sources_of_block(block, x_px, from, s) && middle.agree;
    if (!blurs()) {
        return agree;
    }
    SlotClaims begin = slot_claims(0u, claimed);
    SlotClaims end = slot_claims(2u, claimed);
    return agree && begin.agree && end.agree && is_claimed(begin.nearest, pixel_px, s.begin_px) &&
           is_claimed(end.nearest, pixel_px, s.end_px);
}

// Mean over the exposure along the parabola through three sources: no motion is read for it. Two samples a step of a
// px, opposite each other, as in exact_gather.comp, which says why.
vec4 blur_one_surface(Sources s) {
    bool clamped = false;
    if (!blurs()) {
        // The pictures are read together.
        if (one_of_several() && !is_beyond(s.middle_px)) {
            return vec4(s.middle_px, 0.0, -1.0);
        }
        vec3 seen = read_pixel_area(s.middle_px, clamped);
        return result_of(seen, 1.0, clamped, 1.0);
    }
    vec2 chord = s.end_px - s.begin_px;
    vec2 bend = 2.0 * (s.begin_px + s.end_px - 2.0 * s.middle_px);
    int pairs = blur_pairs(length(s.middle_px - s.begin_px) + length(s.end_px - s.middle_px));
    vec2 way = abs(chord);
    vec2 side = spread_px() * (way.x > way.y ? vec2(0.0, 1.0) : vec2(1.0, 0.0));
    vec2 ahead = spread_px() - side;
    vec2 even = side + ahead, odd = side - ahead;
    // Moved apart until they vary as much as the exposure is wide.
    float count = 2.0 * float(pairs);
    float apart = pairs == 2 ? 1.0 : inversesqrt(1.0 - 1.0 / (count * count));
    float step_t = apart / count;
    vec3 sum = vec3(0.0);
    for (int i = 0; i < pairs; ++i) {
        float t = (2.0 * float(i) + 0.5) * step_t - 0.5 * apart;
        float next = t + step_t;
        vec2 first = s.middle_px + t * (chord + t * bend);
        vec2 second = s.middle_px + next * (chord + next * bend);
        if (color_scale() == 2) {
            sum += read_between(first + even) + read_between(first - even) + read_between(second + odd) +
                   read_between(second - odd);
        } else {
            // Both of two are at one place.
            sum += 2.0 * (read_between(first) + read_between(second));
        }
    }
    clamped = is_beyond(s.begin_px) || is_beyond(s.end_px);
    return result_of(sum / (2.0 * count), count, clamped, sharpness(s.middle_px, way));
}

#endif
