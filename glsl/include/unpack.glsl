// Pictures as callers have them: any row stride, 8-bit, half or float values. Twin: src/reference/unpack.rs.
#ifndef UNPACK_GLSL
#define UNPACK_GLSL

// The caller's bytes, as little-endian words.
layout(set = 0, binding = 0, std430) readonly buffer Source {
    uint words[];
};

uint byte_at(uint offset) {
    return (words[offset >> 2u] >> ((offset & 3u) * 8u)) & 255u;
}

// `offset` is even.
float half_at(uint offset) {
    return unpackHalf2x16((words[offset >> 2u] >> ((offset & 2u) * 8u)) & 0xffffu).x;
}

// `offset` is a multiple of 4.
float float_at(uint offset) {
    return uintBitsToFloat(words[offset >> 2u]);
}

// Neither infinite nor NaN, decided by the bits: drivers may assume that NaN does not occur.
bool is_number(float value) {
    return (floatBitsToUint(value) & 0x7f800000u) != 0x7f800000u;
}

#endif
