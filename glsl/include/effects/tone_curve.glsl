// tone_curve: v + contrast (3 v^2 - 2 v^3 - v). Twin: src/effects/tone_curve.rs.
#ifndef TONE_CURVE_GLSL
#define TONE_CURVE_GLSL

vec3 tone_curve(vec3 value, uvec2 pixel, uint slot) {
    vec3 v = clamp(value, 0.0, 1.0);
    precise vec3 curve = v * v * (3.0 - 2.0 * v);
    precise vec3 seen = v + parameter(slot, 0u) * (curve - v);
    return seen;
}

#endif
