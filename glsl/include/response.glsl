// A monotone curve per channel on encoded values, both ways. Twin: src/effects/response.rs. Needs chain.glsl.
#ifndef RESPONSE_GLSL
#define RESPONSE_GLSL

// Knots are chosen by comparing with each, never looked up: on a software device a look-up by a computed place costs
// more than all of the comparisons together.
const uint RESPONSE_KNOTS = 17u;
const float RESPONSE_PIECES = 16.0;

// Of red, green and blue: one over the steepness at a knot. `first`: the slot's parameter with red's first.
vec3 response_density(uint slot, uint first, uint knot) {
    uint place = first + knot;
    return vec3(parameter(slot, place), parameter(slot, place + RESPONSE_KNOTS),
                parameter(slot, place + 2u * RESPONSE_KNOTS));
}

// A piece of the curve of each channel: number, value ahead of the curve where it begins, density at both ends.
struct ResponsePiece {
    vec3 number;
    vec3 start;
    vec3 low;
    vec3 high;
};

// The last piece that begins at or below `value`, which counts pieces or is ahead of the curve.
ResponsePiece response_piece(vec3 value, bool counts, uint slot, uint first) {
    vec3 density = response_density(slot, first, 0u);
    vec3 next = response_density(slot, first, 1u);
    ResponsePiece piece = ResponsePiece(vec3(0.0), vec3(0.0), density, next);
    precise vec3 sum = vec3(0.0);
    [[unroll]] for (uint k = 1u; k < RESPONSE_KNOTS - 1u; ++k) {
        sum = sum + (density + next) * (0.5 / RESPONSE_PIECES);
        density = next;
        next = response_density(slot, first, k + 1u);
        bvec3 past = greaterThanEqual(value, counts ? vec3(float(k)) : sum);
        piece.number = mix(piece.number, vec3(float(k)), past);
        piece.start = mix(piece.start, sum, past);
        piece.low = mix(piece.low, density, past);
        piece.high = mix(piece.high, next, past);
    }
    return piece;
}

vec3 response_outer(vec3 value, uint slot, uint first) {
    return mix(response_density(slot, first, RESPONSE_KNOTS - 1u), response_density(slot, first, 0u),
               lessThan(value, vec3(0.0)));
}

// From delivered values to those ahead of the curve.
vec3 response_to_sensor(vec3 delivered, uint slot, uint first) {
    vec3 inside = clamp(delivered, 0.0, 1.0);
    precise vec3 place = inside * RESPONSE_PIECES;
    ResponsePiece p = response_piece(place, true, slot, first);
    precise vec3 t = place - p.number;
    precise vec3 value = p.start + t * (p.low + 0.5 * (p.high - p.low) * t) * (1.0 / RESPONSE_PIECES);
    value = value + (delivered - inside) * response_outer(delivered, slot, first);
    return value;
}

vec3 response_from_sensor(vec3 sensor, uint slot, uint first) {
    vec3 inside = clamp(sensor, 0.0, 1.0);
    ResponsePiece p = response_piece(inside, false, slot, first);
    precise vec3 rise = (inside - p.start) * RESPONSE_PIECES;
    precise vec3 square = p.low * p.low + 2.0 * (p.high - p.low) * rise;
    precise vec3 t = 2.0 * rise / (p.low + sqrt(max(square, vec3(0.0))));
    precise vec3 value = (p.number + t) * (1.0 / RESPONSE_PIECES);
    value = value + (sensor - inside) / response_outer(sensor, slot, first);
    return value;
}

#endif
