// Gaussian of the source along one axis: weights of distance 0 to radius stand in a table. Twin: src/effects/gaussian.rs.
// Needs chain.glsl.
#ifndef GAUSSIAN_GLSL
#define GAUSSIAN_GLSL

vec3 gaussian(ivec2 pixel, ivec2 axis, uint radius, uint weights) {
    precise vec3 sum = table(weights) * source_at(pixel).rgb;
    for (int k = 1; k <= int(radius); ++k) {
        precise vec3 pair = source_at(pixel - k * axis).rgb + source_at(pixel + k * axis).rgb;
        sum = sum + table(weights + uint(k)) * pair;
    }
    return sum;
}

#endif
