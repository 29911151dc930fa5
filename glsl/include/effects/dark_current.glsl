// dark_current: charge that collects without light. Twin: src/effects/dark_current.rs.
#ifndef DARK_CURRENT_GLSL
#define DARK_CURRENT_GLSL

vec3 dark_current(vec3 value, uvec2 pixel, uint slot) {
    precise vec3 seen = value + parameter(slot, 0u);
    return seen;
}

#endif
