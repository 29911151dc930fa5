// gamma: encoded = srgb(L)^exponent; clips. Part of every chain: without it the exponent is 1. Twin:
// src/effects/gamma.rs.
#ifndef GAMMA_GLSL
#define GAMMA_GLSL

const uint GAMMA_POWER = 2u;

vec3 gamma(vec3 value, uvec2 pixel, uint slot) {
    vec3 encoded = vec3(srgb_encode(value.r), srgb_encode(value.g), srgb_encode(value.b));
    if ((VARIANT_gamma & GAMMA_POWER) != 0u) {
        vec3 power = pow(max(encoded, vec3(0.0)), vec3(parameter(slot, 0u)));
        // pow(0, e) is undefined where e is 0, and 0 else.
        encoded = vec3(encoded.r > 0.0 ? power.r : 0.0, encoded.g > 0.0 ? power.g : 0.0,
                       encoded.b > 0.0 ? power.b : 0.0);
    }
    return encoded;
}

#endif
