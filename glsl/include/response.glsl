// A monotone curve per channel on encoded values, both ways. Twin: src/effects/response.rs. Needs chain.glsl.
#ifndef RESPONSE_GLSL
#define RESPONSE_GLSL

const int RESPONSE_PIECES = 16;
// Of a channel in the table: the pieces, and a straight one beyond either end.
const uint RESPONSE_ROWS = 18u;

// A row of the table: number of the piece, value ahead of the curve where it begins, density (one over the steepness)
// at both ends.
float response_to_sensor(float delivered, uint row) {
    precise float place = delivered * float(RESPONSE_PIECES);
    int piece = clamp(int(floor(place)), -1, RESPONSE_PIECES);
    vec4 p = table_row(row + uint(piece + 1));
    precise float t = place - p.x;
    precise float value = p.y + t * (p.z + 0.5 * (p.w - p.z) * t) * (1.0 / float(RESPONSE_PIECES));
    return value;
}

float response_from_sensor(float sensor, vec4 p) {
    precise float rise = (sensor - p.y) * float(RESPONSE_PIECES);
    precise float square = p.z * p.z + 2.0 * (p.w - p.z) * rise;
    precise float t = 2.0 * rise / (p.z + sqrt(max(square, 0.0)));
    precise float value = (p.x + t) * (1.0 / float(RESPONSE_PIECES));
    return value;
}

// From delivered values to those ahead of the curve. `row`: of red's first piece.
vec3 response_to_sensor(vec3 delivered, uint row) {
    return vec3(response_to_sensor(delivered.r, row), response_to_sensor(delivered.g, row + RESPONSE_ROWS),
                response_to_sensor(delivered.b, row + 2u * RESPONSE_ROWS));
}

// And back. `starts`: of the slot: where the second piece of red, of green, of blue begins, then where the third does.
// The pieces are found by comparing with each: on a software device a look-up costs as much as twenty comparisons.
vec3 response_from_sensor(vec3 sensor, uint slot, uint starts, uint row) {
    uvec3 piece = uvec3(greaterThanEqual(sensor, vec3(0.0))) + uvec3(greaterThanEqual(sensor, vec3(1.0)));
    [[unroll]] for (uint k = 0u; k < uint(RESPONSE_PIECES) - 1u; ++k) {
        uint i = starts + 3u * k;
        vec3 start = vec3(parameter(slot, i), parameter(slot, i + 1u), parameter(slot, i + 2u));
        piece += uvec3(greaterThanEqual(sensor, start));
    }
    return vec3(response_from_sensor(sensor.r, table_row(row + piece.r)),
                response_from_sensor(sensor.g, table_row(row + RESPONSE_ROWS + piece.g)),
                response_from_sensor(sensor.b, table_row(row + 2u * RESPONSE_ROWS + piece.b)));
}

#endif
