// Reading a picture between its pixels. Twin: src/reference/sample.rs. Pixel (0, 0) has its centre at (0.5, 0.5).
#ifndef SAMPLE_GLSL
#define SAMPLE_GLSL

// Bilinear value at a position, clamped to the outermost pixel centres; `clamped` is set (never cleared) where that
// changed the position. The weights are computed here: samplers round them to 8 bits. At a pixel's centre: its bits.
vec4 sample_bilinear(sampler2D picture, vec2 position_px, inout bool clamped) {
    ivec2 size = textureSize(picture, 0);
    precise vec2 wanted = position_px - 0.5;
    vec2 inside = clamp(wanted, vec2(0.0), vec2(size - 1));
    clamped = clamped || inside != wanted;
    ivec2 near = clamp(ivec2(inside), ivec2(0), size - 1);
    ivec2 far = min(near + 1, size - 1);
    precise vec2 weight = inside - vec2(near);
    precise vec4 value = texelFetch(picture, near, 0);
    if (weight.x != 0.0) {
        value = value + weight.x * (texelFetch(picture, ivec2(far.x, near.y), 0) - value);
    }
    if (weight.y != 0.0) {
        precise vec4 below = texelFetch(picture, ivec2(near.x, far.y), 0);
        if (weight.x != 0.0) {
            below = below + weight.x * (texelFetch(picture, far, 0) - below);
        }
        value = value + weight.y * (below - value);
    }
    return value;
}

#endif
