// paper_noise (section 3.4): static, colour and edge parts with one sigma a channel, on linear radiance. The static part
// belongs to the sensor and never changes; the others are new in every frame. Twin: src/effects/paper_noise.rs. Needs
// rng.glsl.
#ifndef PAPER_NOISE_GLSL
#define PAPER_NOISE_GLSL

// Parts that this pipeline can add: 1 static, 2 colour, 4 edge. A software device runs both sides of a branch, so a part
// that only a push constant switches off still costs there (4 of 6 ms at 640x480 for all three).
layout(constant_id = 0) const uint PAPER_NOISE_PARTS = 7u;
const uint PAPER_NOISE_STATIC = 1u;
const uint PAPER_NOISE_COLOR = 2u;
const uint PAPER_NOISE_EDGE = 4u;

bool paper_noise_has(uint part, vec3 sigma) {
    return (PAPER_NOISE_PARTS & part) != 0u && sigma != vec3(0.0);
}

// `gradient`: magnitude of the noise-free picture's gradient, per channel and px. A part without sigma
// changes no bit.
vec3 paper_noise(vec3 linear, vec3 gradient, uvec2 pixel, uint frame, uvec2 seed, vec3 static_sigma, vec3 color_sigma,
                 vec3 edge_sigma) {
    precise vec3 noisy = linear;
    if (paper_noise_has(PAPER_NOISE_STATIC, static_sigma)) {
        noisy = noisy + static_sigma * random_normal(pixel, FIXED_FRAME, STREAM_PAPER_NOISE_STATIC, seed).xyz;
    }
    if (paper_noise_has(PAPER_NOISE_COLOR, color_sigma)) {
        noisy = noisy + color_sigma * random_normal(pixel, frame, STREAM_PAPER_NOISE_COLOR, seed).xyz;
    }
    if (paper_noise_has(PAPER_NOISE_EDGE, edge_sigma)) {
        precise vec3 sigma = edge_sigma * gradient;
        noisy = noisy + sigma * random_normal(pixel, frame, STREAM_PAPER_NOISE_EDGE, seed).xyz;
    }
    return noisy;
}

#endif
