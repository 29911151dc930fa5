#version 460
// Rasterizes placed vertices; see raster_color.vert.
#extension GL_GOOGLE_include_directive : require
#define COLOR
#include "raster_placed.glsl"
