// read_noise: white over pixels; over frames white too, or an autoregression cut off where its weights have died away.
// Twin: src/effects/read_noise.rs.
#ifndef READ_NOISE_GLSL
#define READ_NOISE_GLSL

const uint READ_NOISE_CORRELATED = 2u;
const uint STREAM_READ_NOISE = 0x5245u;

vec3 read_noise(vec3 value, uvec2 pixel, uint slot) {
    precise float weight = parameter(slot, 0u);
    precise vec3 seen = value + weight * random_normal(pixel, push.frame, STREAM_READ_NOISE, push.seed).xyz;
    if ((VARIANT_read_noise & READ_NOISE_CORRELATED) != 0u) {
        uint terms = parameter_bits(slot, 2u);
        for (uint k = 1u; k < terms; ++k) {
            weight = weight * parameter(slot, 1u);
            seen = seen + weight * random_normal(pixel, push.frame - k, STREAM_READ_NOISE, push.seed).xyz;
        }
    }
    return seen;
}

#endif
