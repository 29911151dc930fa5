// Tiles of the picture, shared by the kernels that make and read them.
#ifndef EXACT_TILE_GLSL
#define EXACT_TILE_GLSL

// Pixels a side. TILE of src/engine/exact/blur.rs.
const int EXACT_TILE = 8;

#endif
