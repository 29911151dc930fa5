#version 460
// Rasterizes color.
#extension GL_GOOGLE_include_directive : require
#define COLOR
#include "raster_vert.glsl"
