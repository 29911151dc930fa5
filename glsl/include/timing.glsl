// When each line is exposed (the paper's eq. 1, 5, 6, in seconds). Twin: src/reference/timing.rs.
#ifndef TIMING_GLSL
#define TIMING_GLSL

// The values of ScanOrder.
const uint TOP_TO_BOTTOM = 0u;
const uint BOTTOM_TO_TOP = 1u;
const uint LEFT_TO_RIGHT = 2u;
const uint RIGHT_TO_LEFT = 3u;

// Place in scan order of the line that holds `pixel`.
uint line_of(uvec2 pixel, uvec2 size, uint scan_order) {
    bool lines_are_rows = scan_order <= BOTTOM_TO_TOP;
    uint place = lines_are_rows ? pixel.y : pixel.x;
    uint count = lines_are_rows ? size.y : size.x;
    bool backwards = scan_order == BOTTOM_TO_TOP || scan_order == RIGHT_TO_LEFT;
    return backwards ? count - 1u - place : place;
}

// Fraction of the readout after which the line of `pixel` starts: i/N (eq. 6). With `pixel_time` 1 the pixel's place
// within its line counts too: + k/(N K) (eq. 1, 5). Pixels of a line come in the order of growing x or y.
float readout_fraction(uvec2 pixel, uvec2 size, uint scan_order, uint pixel_time) {
    bool lines_are_rows = scan_order <= BOTTOM_TO_TOP;
    uint count = lines_are_rows ? size.y : size.x;
    precise float fraction = float(line_of(pixel, size, scan_order)) / float(count);
    if (pixel_time != 0u) {
        uvec2 within_and_length = lines_are_rows ? uvec2(pixel.x, size.x) : uvec2(pixel.y, size.y);
        precise float within = float(within_and_length.x) / (float(count) * float(within_and_length.y));
        fraction = fraction + within;
    }
    return fraction;
}

#endif
