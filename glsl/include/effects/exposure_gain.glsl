// exposure_gain: gain L. Twin: src/effects/exposure_gain.rs.
#ifndef EXPOSURE_GAIN_GLSL
#define EXPOSURE_GAIN_GLSL

vec3 exposure_gain(vec3 value, uvec2 pixel, uint slot) {
    precise vec3 seen = parameter(slot, 0u) * value;
    return seen;
}

#endif
