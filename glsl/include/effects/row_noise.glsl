// row_noise: one value a row and frame, one a column and frame, from tables. Twin: src/effects/row_noise.rs.
#ifndef ROW_NOISE_GLSL
#define ROW_NOISE_GLSL

const uint ROW_NOISE_ROWS = 1u;
const uint ROW_NOISE_COLUMNS = 2u;

vec3 row_noise(vec3 value, uvec2 pixel, uint slot) {
    precise vec3 seen = value;
    if ((VARIANT_row_noise & ROW_NOISE_ROWS) != 0u) {
        seen = seen + table(parameter_bits(slot, 0u) + pixel.y);
    }
    if ((VARIANT_row_noise & ROW_NOISE_COLUMNS) != 0u) {
        seen = seen + table(parameter_bits(slot, 1u) + pixel.x);
    }
    return seen;
}

#endif
