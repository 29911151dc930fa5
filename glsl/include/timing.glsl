// When each line is exposed (the paper's eq. 1, 5, 6, in seconds). Twin: src/reference/timing.rs.
#ifndef TIMING_GLSL
#define TIMING_GLSL

// The values of ScanOrder.
const uint TOP_TO_BOTTOM = 0u;
const uint BOTTOM_TO_TOP = 1u;
const uint LEFT_TO_RIGHT = 2u;
const uint RIGHT_TO_LEFT = 3u;

// Fraction of the readout after which the line of `pixel` starts: i/N (eq. 6). With `pixel_time` 1 the pixel's place
// within its line counts too: + k/(N K) (eq. 1, 5). Pixels of a line come in the order of growing x or y.
float readout_fraction(uvec2 pixel, uvec2 size, uint scan_order, uint pixel_time) {
    bool lines_are_rows = scan_order <= BOTTOM_TO_TOP;
    uvec2 place = lines_are_rows ? pixel.yx : pixel.xy;
    uvec2 count = lines_are_rows ? size.yx : size.xy;
    bool backwards = scan_order == BOTTOM_TO_TOP || scan_order == RIGHT_TO_LEFT;
    uint line = backwards ? count.x - 1u - place.x : place.x;
    precise float fraction = float(line) / float(count.x);
    if (pixel_time != 0u) {
        precise float within = float(place.y) / (float(count.x) * float(count.y));
        fraction = fraction + within;
    }
    return fraction;
}

#endif
