// Tiles of the supersampled picture, shared by the kernels that make and read them.
#ifndef EXACT_TILE_GLSL
#define EXACT_TILE_GLSL

// Texels a side. EXACT_TILE of src/engine/exact/blur.rs.
const int EXACT_TILE = 16;

#endif
