#version 460
// Rasterizes placed vertices; see raster_path.vert.
#extension GL_GOOGLE_include_directive : require
#define MOTION
#define PATH
#include "raster_placed.glsl"
