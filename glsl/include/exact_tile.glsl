// Tiles of the picture, shared by the kernels that make and read them.
#ifndef EXACT_TILE_GLSL
#define EXACT_TILE_GLSL

// Pixels a side. TILE of src/engine/exact/blur.rs.
const int EXACT_TILE = 8;
// Shorter paths are not seen, px.
const float EXACT_SHORTEST_PX = 0.02;
// Paths that jump by less from one px to the next are those of one surface.
const float EXACT_SMOOTH_PX = 0.35;
// More than any reach, px: it marks a tile whose paths jump.
const float EXACT_JUMPS = 8192.0;
// What differs by less, as a share of the brightest channel and by itself, is one colour:
// less than half a level of 255.
const float EXACT_FLAT_SHARE = 1.0 / 256.0;
const float EXACT_FLAT = 1.0 / 8192.0;

#endif
