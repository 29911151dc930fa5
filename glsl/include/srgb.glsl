// Linear radiance to 8 bits (IEC 61966-2-1). Twin: plane::srgb8.
#ifndef SRGB_GLSL
#define SRGB_GLSL

// Written so that NaN becomes black.
uint srgb8(float linear) {
    float l = linear > 0.0 ? min(linear, 1.0) : 0.0;
    float v = l <= 0.0031308 ? 12.92 * l : 1.055 * pow(l, 1.0 / 2.4) - 0.055;
    return uint(255.0 * v + 0.5);
}

#endif
