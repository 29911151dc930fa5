// Mean of the reference picture over one px. Twin: src/reference/pixel_area.rs. The kernel declares `color`.
#ifndef PIXEL_AREA_GLSL
#define PIXEL_AREA_GLSL

// Texels of the colour a px: 1 or 2.
layout(constant_id = 2) const int COLOR_SCALE = 2;

// Mean of the picture over one px around a position: what the pixel's area saw. Texels are means over their own area, so
// their running sum is known exactly at their edges; between them it is taken as linear. At a pixel's centre: the mean of
// its texels, to the bit.
vec3 read_pixel_area(vec2 position_px, inout bool clamped) {
    ivec2 size = textureSize(color, 0);
    precise vec2 wanted = (position_px - 0.5) * float(COLOR_SCALE);
    vec2 inside = clamp(wanted, vec2(0.0), vec2(size - COLOR_SCALE));
    clamped = clamped || inside != wanted;
    ivec2 near = clamp(ivec2(inside), ivec2(0), size - COLOR_SCALE);
    precise vec2 f = inside - vec2(near);
    precise vec3 sum = vec3(0.0);
    for (int y = 0; y <= COLOR_SCALE; ++y) {
        int row = min(near.y + y, size.y - 1);
        precise vec3 along = (1.0 - f.x) * texelFetch(color, ivec2(near.x, row), 0).rgb;
        for (int x = 1; x < COLOR_SCALE; ++x) {
            along = along + texelFetch(color, ivec2(near.x + x, row), 0).rgb;
        }
        along = along + f.x * texelFetch(color, ivec2(min(near.x + COLOR_SCALE, size.x - 1), row), 0).rgb;
        float weight = y == 0 ? 1.0 - f.y : (y == COLOR_SCALE ? f.y : 1.0);
        sum = sum + weight * along;
    }
    precise vec3 mean = sum / (float(COLOR_SCALE) * float(COLOR_SCALE));
    return mean;
}

// Share of the texel `offset` texels from that in which an edge of the pixel's area lies, in the running sum at `f` beyond
// that texel's own edge: the cubic through the sums at texel edges with their central differences as slopes.
float running_sum_weight(float f, int offset) {
    precise float rise = 0.5 * f * (1.0 - f) * (1.0 - f);
    precise float fall = -0.5 * f * f * (1.0 - f);
    precise float own = rise + fall + f * f * (3.0 - 2.0 * f);
    return offset == -1 ? rise : (offset == 0 ? own : (offset == 1 ? fall : 0.0));
}

float area_weight(float f, int k) {
    float whole = k >= 0 && k < COLOR_SCALE ? 1.0 : 0.0;
    precise float weight = whole + running_sum_weight(f, k - COLOR_SCALE) - running_sum_weight(f, k);
    return weight;
}

// The same with a smooth running sum: sharper, with two texels more a side.
vec3 read_pixel_area_sharp(vec2 position_px, inout bool clamped) {
    ivec2 size = textureSize(color, 0);
    precise vec2 wanted = (position_px - 0.5) * float(COLOR_SCALE);
    vec2 inside = clamp(wanted, vec2(0.0), vec2(size - COLOR_SCALE));
    clamped = clamped || inside != wanted;
    ivec2 near = clamp(ivec2(inside), ivec2(0), size - COLOR_SCALE);
    precise vec2 f = inside - vec2(near);
    precise vec3 sum = vec3(0.0);
    for (int y = -1; y <= COLOR_SCALE + 1; ++y) {
        int row = clamp(near.y + y, 0, size.y - 1);
        precise vec3 along = vec3(0.0);
        for (int x = -1; x <= COLOR_SCALE + 1; ++x) {
            int column = clamp(near.x + x, 0, size.x - 1);
            along = along + area_weight(f.x, x) * texelFetch(color, ivec2(column, row), 0).rgb;
        }
        sum = sum + area_weight(f.y, y) * along;
    }
    precise vec3 mean = sum / (float(COLOR_SCALE) * float(COLOR_SCALE));
    return mean;
}

#endif
