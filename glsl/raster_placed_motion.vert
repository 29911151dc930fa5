#version 460
// Rasterizes placed vertices; see raster_motion.vert.
#extension GL_GOOGLE_include_directive : require
#define MOTION
#include "raster_placed.glsl"
