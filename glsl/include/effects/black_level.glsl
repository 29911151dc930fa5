// black_level: offset + (1 - offset) L. Twin: src/effects/black_level.rs.
#ifndef BLACK_LEVEL_GLSL
#define BLACK_LEVEL_GLSL

vec3 black_level(vec3 value, uvec2 pixel, uint slot) {
    precise vec3 seen = parameter(slot, 0u) + parameter(slot, 1u) * value;
    return seen;
}

#endif
