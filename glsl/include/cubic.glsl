// A picture read between its texels by a cubic. Twin: src/reference/cubic.rs.
#ifndef CUBIC_GLSL
#define CUBIC_GLSL

// Weights of four texels in a row for a place `f` behind the second: the cubic of Keys with slope -1/2, the only one
// that leaves a ramp where it is.
vec4 cubic_weights(float f) {
    precise float square = f * f;
    precise float first = f * (-0.5 + f * (1.0 - 0.5 * f));
    precise float second = 1.0 + square * (-2.5 + 1.5 * f);
    precise float third = f * (0.5 + f * (2.0 - 1.5 * f));
    precise float fourth = square * (-0.5 + 0.5 * f);
    return vec4(first, second, third, fourth);
}

// A texel of a picture of so many. Sampled (nearest), because lavapipe 22.3 looks up the level of each lane for a
// fetch.
vec3 texel_in(sampler2D picture, ivec2 texel, ivec2 texels) {
    return textureLod(picture, (vec2(texel) + 0.5) / vec2(texels), 0.0).rgb;
}

// One texel a px: a cubic through 4x4 texels, which keeps edges that a bilinear reading would widen by a px. It goes
// beyond none of the four texels around the place, so that nothing rings. At a texel's centre its bits.
vec3 read_cubic(sampler2D picture, ivec2 texels, vec2 position_px, inout bool clamped) {
    ivec2 last = texels - 1;
    precise vec2 wanted = position_px - 0.5;
    vec2 inside = clamp(wanted, vec2(0.0), vec2(last));
    clamped = clamped || inside != wanted;
    ivec2 near = clamp(ivec2(inside), ivec2(0), last);
    precise vec2 f = inside - vec2(near);
    vec4 across = cubic_weights(f.x);
    vec4 down = cubic_weights(f.y);
    vec3 least = vec3(3e38);
    vec3 most = vec3(-3e38);
    precise vec3 sum = vec3(0.0);
    for (int y = 0; y < 4; ++y) {
        int row = clamp(near.y + y - 1, 0, last.y);
        precise vec3 along = across.x * texel_in(picture, ivec2(max(near.x - 1, 0), row), texels);
        vec3 left = texel_in(picture, ivec2(near.x, row), texels);
        vec3 right = texel_in(picture, ivec2(min(near.x + 1, last.x), row), texels);
        along = along + across.y * left;
        along = along + across.z * right;
        along = along + across.w * texel_in(picture, ivec2(min(near.x + 2, last.x), row), texels);
        sum = sum + down[y] * along;
        if (y == 1 || y == 2) {
            least = min(least, min(left, right));
            most = max(most, max(left, right));
        }
    }
    return clamp(sum, least, most);
}

#endif
