// color_matrix: from the sensor's colours to the picture's. Twin: src/effects/color_matrix.rs.
#ifndef COLOR_MATRIX_GLSL
#define COLOR_MATRIX_GLSL

vec3 color_matrix(vec3 value, uvec2 pixel, uint slot) {
    precise vec3 seen;
    for (uint row = 0u; row < 3u; ++row) {
        precise float sum = parameter(slot, 3u * row) * value.r + parameter(slot, 3u * row + 1u) * value.g +
                            parameter(slot, 3u * row + 2u) * value.b;
        seen[row] = sum;
    }
    return seen;
}

#endif
