// What fast_gather and fast_silhouettes share. Needs fast_push.
#ifndef FAST_BLUR_GLSL
#define FAST_BLUR_GLSL

// Texels of the colour a px: 1 or 2.
layout(constant_id = 2) const int COLOR_SCALE = 2;
// Whether lines integrate: `color` then holds the means over a px at every texel (fast_areas), else the picture itself.
layout(constant_id = 3) const uint BLUR = 1u;

bool blurs() { return BLUR != 0u; }

// Samples for a path, px: steps of at most a px, both ends included.
int blur_samples(float path_px) {
    return path_px < 0.02 ? 1 : int(min(ceil(path_px - 0.001) + 1.0, float(push.max_samples)));
}

#endif
