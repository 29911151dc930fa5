#version 460
// Radiance to the delivered picture: paper_noise on linear values, sRGB, 8 bits. Twin: src/reference/develop.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

// Linear radiance; alpha as written by paper_gather.
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D radiance;
// Row by row, red in the lowest byte, alpha 255.
layout(set = 0, binding = 1, std430) writeonly buffer Pixels {
    uint pixels[];
};

layout(push_constant) uniform Push {
    uvec2 size;
    uvec2 seed;
    uint frame;
    uint flags;
    uvec2 padding;
    vec4 static_sigma;
    vec4 color_sigma;
    vec4 edge_sigma;
} push;

// Alpha 0 instead of 255 where the radiance's alpha is negative (a sample left the rendered picture).
const uint FLAG_MARK_CLAMPED = 1u;

#include "rng.glsl"
#include "paper_noise.glsl"
#include "srgb.glsl"

vec3 radiance_at(ivec2 pixel) {
    return imageLoad(radiance, clamp(pixel, ivec2(0), ivec2(push.size) - 1)).rgb;
}

// Magnitude of the central-difference gradient, per channel and px; the border repeats outwards.
vec3 gradient_magnitude(ivec2 pixel) {
    precise vec3 x = 0.5 * (radiance_at(pixel + ivec2(1, 0)) - radiance_at(pixel - ivec2(1, 0)));
    precise vec3 y = 0.5 * (radiance_at(pixel + ivec2(0, 1)) - radiance_at(pixel - ivec2(0, 1)));
    precise vec3 square = x * x + y * y;
    return sqrt(square);
}

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    vec4 seen = imageLoad(radiance, ivec2(pixel));
    vec3 gradient = vec3(0.0);
    if (paper_noise_has(PAPER_NOISE_EDGE, push.edge_sigma.rgb)) {
        gradient = gradient_magnitude(ivec2(pixel));
    }
    vec3 noisy = paper_noise(seen.rgb, gradient, pixel, push.frame, push.seed, push.static_sigma.rgb,
                             push.color_sigma.rgb, push.edge_sigma.rgb);
    bool marked = (push.flags & FLAG_MARK_CLAMPED) != 0u && seen.a < 0.0;
    uint alpha = marked ? 0u : 255u;
    pixels[pixel.y * push.size.x + pixel.x] =
        srgb8(noisy.r) | (srgb8(noisy.g) << 8u) | (srgb8(noisy.b) << 16u) | (alpha << 24u);
}
