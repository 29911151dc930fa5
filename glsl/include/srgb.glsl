// Linear radiance to sRGB (IEC 61966-2-1) and to 8 bits. Twin: plane::{srgb_encode, srgb8}.
#ifndef SRGB_GLSL
#define SRGB_GLSL

// Both curves are polynomials in roots of the value, within 1e-6 of the standard's powers, white exactly: sums,
// products and square roots cost half of a power on a software device, and round more nearly alike everywhere.
// Coefficients: plane/srgb.rs.

// Clips; written so that NaN becomes black.
float srgb_encode(float linear) {
    float l = linear > 0.0 ? min(linear, 1.0) : 0.0;
    float q = sqrt(sqrt(l));
    precise float p = -0.07620811;
    p = p * q + 0.39470392;
    p = p * q - 0.89839625;
    p = p * q + 1.2091342;
    p = p * q - 1.1558868;
    p = p * q + 1.4615228;
    p = p * q + 0.12357638;
    p = p * q - 0.05844615;
    precise float dark = 12.92 * l;
    return l <= 0.0031308 ? dark : p;
}

// Of an encoded value between 0 and 1.
float srgb_decode(float encoded) {
    precise float u = encoded * 0.9478673 + 0.0521327;
    float s = sqrt(max(u, 0.0));
    precise float p = -0.035358537;
    p = p * s + 0.8079142;
    p = p * s + 0.31224257;
    p = p * s - 0.11127973;
    p = p * s + 0.03133366;
    p = p * s - 0.005231237;
    p = p * s + 3.7909285e-4;
    precise float dark = encoded * 0.07739938;
    return encoded <= 0.04045 ? dark : p;
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
