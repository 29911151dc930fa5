// Mean of the reference picture over one px. Twin: in src/reference/fast_gather.rs. The kernel declares `color`. Needs
// fast_blur, sample.
#ifndef PIXEL_AREA_GLSL
#define PIXEL_AREA_GLSL

// Share of a texel's two neighbours where the pixel's centre is the texel's. Two texels a px, each as wide as it is, would
// give 1/2; what they hold is finer than that at edges and coarser within textures. Tried: 0.3 to 0.5.
const float NEIGHBOURS_SHARE = 0.3125;

// Sampled (nearest), because lavapipe 22.3 looks up the level of each lane for a fetch.
vec3 color_at(ivec2 texel) {
    return textureLod(color, (vec2(texel) + 0.5) / vec2(color_texels()), 0.0).rgb;
}

// Weights of four texels in a row for a place `f` behind the second: the cubic of Keys with slope -1/2, the only one that
// leaves a ramp where it is.
vec4 cubic_weights(float f) {
    precise float square = f * f;
    precise float first = f * (-0.5 + f * (1.0 - 0.5 * f));
    precise float second = 1.0 + square * (-2.5 + 1.5 * f);
    precise float third = f * (0.5 + f * (2.0 - 1.5 * f));
    precise float fourth = square * (-0.5 + 0.5 * f);
    return vec4(first, second, third, fourth);
}

// One texel a px: a cubic through 4x4 texels, which keeps edges that a bilinear reading would widen by a px. It goes beyond
// none of the four texels around the place, so that nothing rings. At a texel's centre its bits.
vec3 read_cubic(vec2 position_px, inout bool clamped) {
    ivec2 last = color_texels() - 1;
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
        precise vec3 along = across.x * color_at(ivec2(max(near.x - 1, 0), row));
        vec3 left = color_at(ivec2(near.x, row));
        vec3 right = color_at(ivec2(min(near.x + 1, last.x), row));
        along = along + across.y * left;
        along = along + across.z * right;
        along = along + across.w * color_at(ivec2(min(near.x + 2, last.x), row));
        sum = sum + down[y] * along;
        if (y == 1 || y == 2) {
            least = min(least, min(left, right));
            most = max(most, max(left, right));
        }
    }
    return clamp(sum, least, most);
}

// Mean of the picture over one px around a position: what the pixel's area saw. Three texels an axis with the position as
// their mean; at a pixel's centre the mean of its own texels, to the bit.
vec3 read_pixel_area(vec2 position_px, inout bool clamped) {
    if (color_scale() == 1) {
        return read_cubic(position_px, clamped);
    }
    ivec2 last = color_texels() - 1;
    precise vec2 wanted = position_px * 2.0 - 0.5;
    vec2 inside = clamp(wanted, vec2(0.5), vec2(last) - 0.5);
    clamped = clamped || inside != wanted;
    ivec2 middle = clamp(ivec2(inside + 0.5), ivec2(0), last);
    precise vec2 v = inside - vec2(middle);
    precise vec2 share = NEIGHBOURS_SHARE + (2.0 - 4.0 * NEIGHBOURS_SHARE) * (v * v);
    precise vec2 before = 0.5 * (share - v);
    precise vec2 own = 1.0 - share;
    precise vec2 after = 0.5 * (share + v);
    ivec2 low = max(middle - 1, ivec2(0));
    ivec2 high = min(middle + 1, last);
    precise vec3 sum = vec3(0.0);
    for (int y = 0; y < 3; ++y) {
        int row = y == 0 ? low.y : (y == 1 ? middle.y : high.y);
        float weight = y == 0 ? before.y : (y == 1 ? own.y : after.y);
        precise vec3 along = before.x * color_at(ivec2(low.x, row));
        along = along + own.x * color_at(ivec2(middle.x, row));
        along = along + after.x * color_at(ivec2(high.x, row));
        sum = sum + weight * along;
    }
    return sum;
}

#endif
