// fixed_pattern_noise: gain and offset of every pixel, seeded by the sensor. Twin: src/effects/fixed_pattern_noise.rs.
#ifndef FIXED_PATTERN_NOISE_GLSL
#define FIXED_PATTERN_NOISE_GLSL

const uint FIXED_PATTERN_NOISE_DSNU = 1u;
const uint FIXED_PATTERN_NOISE_PRNU = 2u;
const uint STREAM_FIXED_PATTERN_DSNU = 0x4453u;
const uint STREAM_FIXED_PATTERN_PRNU = 0x5052u;

vec3 fixed_pattern_noise(vec3 value, uvec2 pixel, uint slot) {
    uvec2 sensor = uvec2(parameter_bits(slot, 2u), parameter_bits(slot, 3u));
    precise vec3 seen = value;
    if ((VARIANT_fixed_pattern_noise & FIXED_PATTERN_NOISE_PRNU) != 0u) {
        vec3 n = random_normal(pixel, FIXED_FRAME, STREAM_FIXED_PATTERN_PRNU, sensor).xyz;
        // Dark current is no response to light.
        seen = seen + (seen - parameter(slot, 4u)) * (parameter(slot, 1u) * n);
    }
    if ((VARIANT_fixed_pattern_noise & FIXED_PATTERN_NOISE_DSNU) != 0u) {
        vec3 n = random_normal(pixel, FIXED_FRAME, STREAM_FIXED_PATTERN_DSNU, sensor).xyz;
        seen = seen + parameter(slot, 0u) * n;
    }
    return seen;
}

#endif
