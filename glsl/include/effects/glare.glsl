// glare: (1 - veil) L + veil level. Twin: src/effects/glare.rs.
#ifndef GLARE_GLSL
#define GLARE_GLSL

vec3 glare(vec3 value, uvec2 pixel, uint slot) {
    precise vec3 seen = parameter(slot, 0u) * value + parameter(slot, 1u);
    return seen;
}

#endif
