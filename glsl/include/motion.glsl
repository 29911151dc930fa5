// Motion images and what lies between them in time (the paper's eq. 4, for up to six). Twin: src/reference/motion.rs.
// The kernel declares `motion`, an image2DArray of px per frame interval. Place k on the time axis ("knot") is image k;
// before the first and after the last one the motion stays as it is there.
#ifndef MOTION_GLSL
#define MOTION_GLSL

const int MAX_MOTION_IMAGES = 6;

// The texel that holds a position. Motion is never averaged in space: between two objects' motions lies nobody's.
ivec2 motion_texel(vec2 position_px, ivec2 image_size) {
    vec2 inside = clamp(floor(position_px), vec2(0.0), vec2(image_size - 1));
    return clamp(ivec2(inside), ivec2(0), image_size - 1);
}

// Motion of one texel at place `knot` of the time axis: eq. 4 between the two neighbouring images.
vec2 motion_at(ivec2 texel, float knot, int motion_count) {
    float inside = clamp(knot, 0.0, float(motion_count - 1));
    int before = clamp(int(inside), 0, motion_count - 1);
    int after = min(before + 1, motion_count - 1);
    precise float weight = inside - float(before);
    precise vec2 a = imageLoad(motion, ivec3(texel, before)).xy;
    precise vec2 b = imageLoad(motion, ivec3(texel, after)).xy;
    precise vec2 interpolated = a + weight * (b - a);
    return interpolated;
}

// The motion of one texel in all images; the last one fills the rest.
void motion_history(ivec2 texel, int motion_count, out vec2 history[MAX_MOTION_IMAGES]) {
    vec2 latest = imageLoad(motion, ivec3(texel, 0)).xy;
    for (int k = 0; k < MAX_MOTION_IMAGES; ++k) {
        if (k > 0 && k < motion_count) {
            latest = imageLoad(motion, ivec3(texel, k)).xy;
        }
        history[k] = latest;
    }
}

// Integral of the motion from knot 0 to `knot`: the closed form of a piecewise linear velocity.
vec2 motion_integral(vec2 history[MAX_MOTION_IMAGES], float knot, int motion_count) {
    precise vec2 sum = min(knot, 0.0) * history[0];
    for (int k = 0; k + 1 < MAX_MOTION_IMAGES; ++k) {
        if (k + 1 < motion_count) {
            precise float h = clamp(knot - float(k), 0.0, 1.0);
            sum = sum + h * (history[k] + 0.5 * h * (history[k + 1] - history[k]));
        }
    }
    precise vec2 rest = max(knot - float(motion_count - 1), 0.0) * history[MAX_MOTION_IMAGES - 1];
    sum = sum + rest;
    return sum;
}

float motion_length(vec2 v) {
    precise float square = v.x * v.x + v.y * v.y;
    return sqrt(square);
}

// Length of the path from knot `from` to knot `to`. Between two images the speed is taken as linear; it is convex, so
// this is never less than the true length, and equal to it where the motion keeps its direction.
float motion_path_length(vec2 history[MAX_MOTION_IMAGES], float from, float to, int motion_count) {
    float last = float(motion_count - 1);
    precise float sum = max(min(to, 0.0) - from, 0.0) * motion_length(history[0]);
    for (int k = 0; k + 1 < MAX_MOTION_IMAGES; ++k) {
        if (k + 1 < motion_count) {
            precise float a = clamp(from - float(k), 0.0, 1.0);
            precise float b = clamp(to - float(k), 0.0, 1.0);
            precise vec2 slope = history[k + 1] - history[k];
            precise vec2 va = history[k] + a * slope;
            precise vec2 vb = history[k] + b * slope;
            sum = sum + (b - a) * (0.5 * (motion_length(va) + motion_length(vb)));
        }
    }
    precise float rest = max(to - max(from, last), 0.0) * motion_length(history[MAX_MOTION_IMAGES - 1]);
    sum = sum + rest;
    return sum;
}

#endif
