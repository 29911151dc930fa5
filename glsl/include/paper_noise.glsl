// paper_noise (section 3.4): static, colour and edge parts with one sigma a channel, on linear radiance. The static part
// belongs to the sensor and never changes; the others are new in every frame. Twin: src/effects/paper_noise.rs. Needs
// rng.glsl.
#ifndef PAPER_NOISE_GLSL
#define PAPER_NOISE_GLSL

// `gradient`: magnitude of the noise-free picture's gradient, per channel and px. A part without sigma costs nothing and
// changes no bit.
vec3 paper_noise(vec3 linear, vec3 gradient, uvec2 pixel, uint frame, uvec2 seed, vec3 static_sigma, vec3 color_sigma,
                 vec3 edge_sigma) {
    precise vec3 noisy = linear;
    if (static_sigma != vec3(0.0)) {
        noisy = noisy + static_sigma * random_normal(pixel, FIXED_FRAME, STREAM_PAPER_NOISE_STATIC, seed).xyz;
    }
    if (color_sigma != vec3(0.0)) {
        noisy = noisy + color_sigma * random_normal(pixel, frame, STREAM_PAPER_NOISE_COLOR, seed).xyz;
    }
    if (edge_sigma != vec3(0.0)) {
        precise vec3 sigma = edge_sigma * gradient;
        noisy = noisy + sigma * random_normal(pixel, frame, STREAM_PAPER_NOISE_EDGE, seed).xyz;
    }
    return noisy;
}

#endif
