// response_curve: from the values ahead of it to the delivered ones, by a table. Twin: src/effects/response_curve.rs.
#ifndef RESPONSE_CURVE_GLSL
#define RESPONSE_CURVE_GLSL

#include "response.glsl"

vec3 response_curve(vec3 value, uvec2 pixel, uint slot) {
    uint first = parameter_bits(slot, 0u);
    uint side = RESPONSE_PIECES + 1u;
    return vec3(response_from_sensor(value.r, first), response_from_sensor(value.g, first + side),
                response_from_sensor(value.b, first + 2u * side));
}

#endif
