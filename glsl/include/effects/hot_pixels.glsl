// hot_pixels: stuck at white, by a mask with one bit a pixel. Twin: src/effects/hot_pixels.rs.
#ifndef HOT_PIXELS_GLSL
#define HOT_PIXELS_GLSL

vec3 hot_pixels(vec3 value, uvec2 pixel, uint slot) {
    uint place = pixel.y * push.size.x + pixel.x;
    uint word = table_bits(parameter_bits(slot, 0u) + (place >> 5u));
    return (word & (1u << (place & 31u))) != 0u ? max(value, vec3(1.0)) : value;
}

#endif
