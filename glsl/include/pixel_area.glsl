// Mean of the reference picture over one px. Twin: src/reference/pixel_area.rs. The kernel declares `color`. Needs fast_blur.
#ifndef PIXEL_AREA_GLSL
#define PIXEL_AREA_GLSL

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

#endif
