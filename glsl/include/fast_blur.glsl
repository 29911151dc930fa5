// What fast_gather and fast_silhouettes share: reading the picture between its texels. The kernel declares `color`.
// Needs fast_push, sample.
#ifndef FAST_BLUR_GLSL
#define FAST_BLUR_GLSL

// Texels of the colour a px: 1 or 2.
layout(constant_id = 2) const int COLOR_SCALE = 2;
// Whether lines integrate: `color` then has a sampler that is linear, else one that is not.
layout(constant_id = 3) const uint BLUR = 1u;

// Half the distance of two bilinear samples that stand for a pixel's width of texels of half a px, px:
// exact_gather.comp says why.
const float SPREAD_PX = 0.14434;

// Texels of `color`, margin included.
ivec2 color_texels() { return (ivec2(push.size) + 2 * push.margin_px) * COLOR_SCALE; }

bool blurs() { return BLUR != 0u; }

// Behind a function, because the build's reflection does not evaluate comparisons of constants.
int color_scale() { return COLOR_SCALE; }

// A pixel that is one texel is not spread.
float spread_px() { return color_scale() == 2 ? SPREAD_PX : 0.0; }

// Bilinear. Alpha is nobody's.
vec3 read_between(vec2 position_px) {
    if (blurs()) {
        return textureLod(color, position_px / vec2(ivec2(push.size) + 2 * push.margin_px), 0.0).rgb;
    }
    bool clamped = false;
    return sample_bilinear(color, position_px * float(COLOR_SCALE), clamped).rgb;
}

// Whether a place lies beyond the centres of the outermost texels.
bool is_beyond(vec2 position_px) {
    vec2 texel = position_px * float(COLOR_SCALE);
    return any(lessThan(texel, vec2(0.5))) || any(greaterThan(texel, vec2(color_texels()) - 0.5));
}

// Samples for a path, px: one a px, in pairs.
int blur_pairs(float path_px) {
    return clamp(int(ceil(0.5 * path_px)), 1, max(int(push.max_samples) / 2, 1));
}

#endif
