// paper_noise (section 3.4): static, colour and edge parts with one sigma a channel, on linear radiance. The static
// part belongs to the sensor and never changes; the others are new in every frame. Twin: src/effects/paper_noise.rs.
#ifndef PAPER_NOISE_GLSL
#define PAPER_NOISE_GLSL

// Parts of VARIANT_paper_noise. A software device runs both sides of a branch, so a part that only a parameter switches
// off still costs there (4 of 6 ms at 640x480 for all three).
const uint PAPER_NOISE_STATIC = 1u;
const uint PAPER_NOISE_COLOR = 2u;
const uint PAPER_NOISE_EDGE = 4u;
const uint STREAM_PAPER_NOISE_STATIC = 0x5354u;
const uint STREAM_PAPER_NOISE_COLOR = 0x434fu;
const uint STREAM_PAPER_NOISE_EDGE = 0x4544u;

vec3 paper_noise_sigma(uint slot, uint part) {
    return vec3(parameter(slot, 3u * part), parameter(slot, 3u * part + 1u), parameter(slot, 3u * part + 2u));
}

// Magnitude of the central-difference gradient of the noise-free picture, per channel and px.
vec3 paper_noise_gradient(ivec2 pixel) {
    precise vec3 x = 0.5 * (source_at(pixel + ivec2(1, 0)).rgb - source_at(pixel - ivec2(1, 0)).rgb);
    precise vec3 y = 0.5 * (source_at(pixel + ivec2(0, 1)).rgb - source_at(pixel - ivec2(0, 1)).rgb);
    precise vec3 square = x * x + y * y;
    return sqrt(square);
}

vec3 paper_noise(vec3 value, uvec2 pixel, uint slot) {
    precise vec3 noisy = value;
    if ((VARIANT_paper_noise & PAPER_NOISE_STATIC) != 0u) {
        vec3 sigma = paper_noise_sigma(slot, 0u);
        noisy = noisy + sigma * random_normal(pixel, FIXED_FRAME, STREAM_PAPER_NOISE_STATIC, push.seed).xyz;
    }
    if ((VARIANT_paper_noise & PAPER_NOISE_COLOR) != 0u) {
        vec3 sigma = paper_noise_sigma(slot, 1u);
        noisy = noisy + sigma * random_normal(pixel, push.frame, STREAM_PAPER_NOISE_COLOR, push.seed).xyz;
    }
    if ((VARIANT_paper_noise & PAPER_NOISE_EDGE) != 0u) {
        precise vec3 sigma = paper_noise_sigma(slot, 2u) * paper_noise_gradient(ivec2(pixel));
        noisy = noisy + sigma * random_normal(pixel, push.frame, STREAM_PAPER_NOISE_EDGE, push.seed).xyz;
    }
    return noisy;
}

#endif
