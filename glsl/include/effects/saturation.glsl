// saturation: colours nearer to or further from their luma. Twin: src/effects/saturation.rs.
#ifndef SATURATION_GLSL
#define SATURATION_GLSL

vec3 saturation(vec3 value, uvec2 pixel, uint slot) {
    precise float y = 0.299 * value.r + 0.587 * value.g + 0.114 * value.b;
    precise vec3 seen = y + parameter(slot, 0u) * (value - y);
    return seen;
}

#endif
