// quantization: what the converter can hold, rounded to its steps. Twin: src/effects/quantization.rs.
#ifndef QUANTIZATION_GLSL
#define QUANTIZATION_GLSL

vec3 quantization(vec3 value, uvec2 pixel, uint slot) {
    precise vec3 dn = floor(clamp(value, 0.0, 1.0) * parameter(slot, 0u) + 0.5);
    precise vec3 seen = dn * parameter(slot, 1u);
    return seen;
}

#endif
