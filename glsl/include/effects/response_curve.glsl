// response_curve: from the values ahead of it to the delivered ones. Twin: src/effects/response_curve.rs.
#ifndef RESPONSE_CURVE_GLSL
#define RESPONSE_CURVE_GLSL

#include "response.glsl"

vec3 response_curve(vec3 value, uvec2 pixel, uint slot) {
    return response_from_sensor(value, slot, 1u, parameter_bits(slot, 0u));
}

#endif
