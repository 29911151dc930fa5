// flicker: the light's brightness at the time of the line, from a table with one factor a line. Twin:
// src/effects/flicker.rs.
#ifndef FLICKER_GLSL
#define FLICKER_GLSL

vec3 flicker(vec3 value, uvec2 pixel, uint slot) {
    uint line = line_of(pixel, push.size, parameter_bits(slot, 1u));
    precise vec3 seen = table(parameter_bits(slot, 0u) + line) * value;
    return seen;
}

#endif
