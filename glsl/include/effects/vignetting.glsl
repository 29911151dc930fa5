// vignetting: L (1 + a1 q + a2 q^2). Twin: src/effects/vignetting.rs.
#ifndef VIGNETTING_GLSL
#define VIGNETTING_GLSL

vec3 vignetting(vec3 value, uvec2 pixel, uint slot) {
    precise vec2 off = vec2(pixel) + 0.5 - vec2(parameter(slot, 0u), parameter(slot, 1u));
    precise float square = off.x * off.x + off.y * off.y;
    precise float q = square * parameter(slot, 2u);
    precise float fall_off = 1.0 + q * (parameter(slot, 3u) + q * parameter(slot, 4u));
    precise vec3 seen = value * max(fall_off, 0.0);
    return seen;
}

#endif
