// motion_blur as published (section 3.3, Fig. 4): the mean along the path through the motion images. Twin:
// src/reference/motion_blur.rs. Needs motion.glsl and sample.glsl.
#ifndef MOTION_BLUR_GLSL
#define MOTION_BLUR_GLSL

// Samples for a path: one a px, at least one. A thousandth of a px is let go, so that a path of a whole number of px
// does not depend on rounding.
int motion_blur_samples(float path_px, int max_samples) {
    return max(1, int(min(ceil(path_px - 0.001), float(max_samples))));
}

// Mean of `picture` over the exposure that begins at knot `from` and ends at knot `to`, at the middles of equal spans
// of time; `x_px` is the position that is seen at `from`, `knot_frames` the time between knots in frame intervals.
// Alpha: the number of samples, negative where one was clamped to the picture.
vec4 motion_blur(sampler2D picture, vec2 x_px, float from, float to, float knot_frames, int motion_count,
                 int max_samples) {
    vec2 history[MAX_MOTION_IMAGES];
    motion_history(motion_texel(x_px, textureSize(picture, 0)), motion_count, history);
    precise float path_px = motion_path_length(history, from, to, motion_count) * knot_frames;
    int count = motion_blur_samples(path_px, max_samples);
    precise vec2 begin = motion_integral(history, from, motion_count);
    precise float span = (to - from) / float(count);
    precise vec3 sum = vec3(0.0);
    bool clamped = false;
    for (int i = 0; i < count; ++i) {
        precise float knot = from + (float(i) + 0.5) * span;
        precise vec2 moved = (motion_integral(history, knot, motion_count) - begin) * knot_frames;
        precise vec2 position = x_px - moved;
        vec3 value = sample_bilinear(picture, position, clamped).rgb;
        // One sample is passed on as it is, so that neutral parameters return the input's bits.
        if (count == 1) {
            return vec4(value, clamped ? -1.0 : 1.0);
        }
        sum = sum + value;
    }
    precise vec3 mean = sum / float(count);
    return vec4(mean, clamped ? -float(count) : float(count));
}

#endif
