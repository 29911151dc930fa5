// sensor_color: the light that white_balance, color_matrix, response_curve and saturation turn back into the scene's.
// Twin: src/effects/sensor_color.rs.
#ifndef SENSOR_COLOR_GLSL
#define SENSOR_COLOR_GLSL

#include "response.glsl"

const uint SENSOR_COLOR_MATRIX = 1u;
const uint SENSOR_COLOR_CURVE = 2u;
const uint SENSOR_COLOR_SATURATION = 4u;

vec3 sensor_color(vec3 value, uvec2 pixel, uint slot) {
    vec3 seen = value;
    if ((VARIANT_sensor_color & (SENSOR_COLOR_CURVE | SENSOR_COLOR_SATURATION)) != 0u) {
        vec3 encoded = vec3(srgb_encode(value.r), srgb_encode(value.g), srgb_encode(value.b));
        if ((VARIANT_sensor_color & SENSOR_COLOR_SATURATION) != 0u) {
            precise float y = 0.299 * encoded.r + 0.587 * encoded.g + 0.114 * encoded.b;
            precise vec3 vivid = y + parameter(slot, 10u) * (encoded - y);
            encoded = clamp(vivid, 0.0, 1.0);
        }
        if ((VARIANT_sensor_color & SENSOR_COLOR_CURVE) != 0u) {
            encoded = response_to_sensor(encoded, parameter_bits(slot, 9u));
        }
        seen = vec3(srgb_decode(encoded.r), srgb_decode(encoded.g), srgb_decode(encoded.b));
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
