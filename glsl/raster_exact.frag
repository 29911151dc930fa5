#version 460
// Rasterizes color with the number of the motion group in alpha.
#extension GL_GOOGLE_include_directive : require
#define COLOR
#define EXACT
#include "raster_frag.glsl"
