// Mean of the reference picture over one px. Twin: in src/reference/fast_gather.rs. The kernel declares `color`. Needs
// fast_blur, sample, cubic.
#ifndef PIXEL_AREA_GLSL
#define PIXEL_AREA_GLSL

// Share of a texel's two neighbours where the pixel's centre is the texel's. Two texels a px, each as wide as it is,
// would give 1/2; what they hold is finer than that at edges and coarser within textures. Tried: 0.3 to 0.5.
const float NEIGHBOURS_SHARE = 0.3125;

vec3 color_at(ivec2 texel) { return texel_in(color, texel, color_texels()); }

// Mean of the picture over one px around a position: what the pixel's area saw. Three texels an axis with the position
// as their mean; at a pixel's centre the mean of its own texels, to the bit.
vec3 read_pixel_area(vec2 position_px, inout bool clamped) {
    if (color_scale() == 1) {
        return read_cubic(color, color_texels(), position_px, clamped);
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
