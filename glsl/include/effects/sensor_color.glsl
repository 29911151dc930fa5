// sensor_color: the light that white_balance, color_matrix and response_curve turn back into the scene's. Twin:
// src/effects/sensor_color.rs.
#ifndef SENSOR_COLOR_GLSL
#define SENSOR_COLOR_GLSL

#include "response.glsl"

const uint SENSOR_COLOR_MATRIX = 1u;
const uint SENSOR_COLOR_CURVE = 2u;

float sensor_color_bent(float linear, uint first) {
    float v = response_to_sensor(srgb_encode(linear), first);
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

vec3 sensor_color(vec3 value, uvec2 pixel, uint slot) {
    vec3 seen = value;
    if ((VARIANT_sensor_color & SENSOR_COLOR_CURVE) != 0u) {
        uint first = parameter_bits(slot, 9u);
        uint side = RESPONSE_PIECES + 1u;
        seen = vec3(sensor_color_bent(value.r, first), sensor_color_bent(value.g, first + side),
                    sensor_color_bent(value.b, first + 2u * side));
    }
    if ((VARIANT_sensor_color & SENSOR_COLOR_MATRIX) != 0u) {
        precise vec3 mixed = vec3(parameter(slot, 0u), parameter(slot, 3u), parameter(slot, 6u)) * seen.r +
                             vec3(parameter(slot, 1u), parameter(slot, 4u), parameter(slot, 7u)) * seen.g +
                             vec3(parameter(slot, 2u), parameter(slot, 5u), parameter(slot, 8u)) * seen.b;
        seen = mixed;
    }
    return max(seen, vec3(0.0));
}

#endif
