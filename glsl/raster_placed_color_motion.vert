#version 460
// Rasterizes placed vertices; see raster_color_motion.vert.
#extension GL_GOOGLE_include_directive : require
#define COLOR
#define MOTION
#include "raster_placed.glsl"
