// Linear radiance to sRGB (IEC 61966-2-1) and to 8 bits. Twin: plane::{srgb_encode, srgb8}.
#ifndef SRGB_GLSL
#define SRGB_GLSL

// Clips; written so that NaN becomes black.
float srgb_encode(float linear) {
    float l = linear > 0.0 ? min(linear, 1.0) : 0.0;
    return l <= 0.0031308 ? 12.92 * l : 1.055 * pow(l, 1.0 / 2.4) - 0.055;
}

// Encoded value, clipped to 0..1, to 8 bits.
uint quantize8(float encoded) {
    float v = encoded > 0.0 ? min(encoded, 1.0) : 0.0;
    return uint(255.0 * v + 0.5);
}

uint srgb8(float linear) {
    return quantize8(srgb_encode(linear));
}

#endif
