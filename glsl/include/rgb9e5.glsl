// Colours as words: nine bits a channel, and five of an exponent for all three (as VK_FORMAT_E5B9G9R9_UFLOAT_PACK32 has
// them).
#ifndef RGB9E5_GLSL
#define RGB9E5_GLSL

// The largest number, and the smallest of which the exponent takes notice.
const float RGB9E5_MOST = 65408.0;
const float RGB9E5_LEAST = 1.0 / 65536.0;

// Rounded down after `up` (from 0 to 1) is added to the nine bits: 0.5 rounds to the nearest.
uint rgb9e5(vec3 color, float up) {
    vec3 inside = clamp(color, vec3(0.0), vec3(RGB9E5_MOST));
    float largest = max(max(inside.r, inside.g), max(inside.b, RGB9E5_LEAST));
    // The largest channel's exponent, or one more where its nine bits might be rounded up to ten.
    uint exponent = (floatBitsToUint(largest) + 0x7fffu) >> 23;
    // 2^(8 - (exponent - 127)) as a float's bits.
    ivec3 nine = ivec3(inside * uintBitsToFloat((262u - exponent) << 23) + up);
    return uint(nine.r | nine.g << 9 | nine.b << 18) | (exponent - 111u) << 27;
}

// The colour of a word, times a weight.
vec3 rgb9e5_weighed(uint word, float weight) {
    // 2^(exponent - 24) as a float's bits.
    float unit = uintBitsToFloat((word >> 4 & 0xf800000u) + (103u << 23));
    return unit * weight * vec3(ivec3(int(word & 511u), int(word >> 9 & 511u), int(word >> 18 & 511u)));
}

#endif
