#version 460
// Rasterizes color and motion.
#extension GL_GOOGLE_include_directive : require
#define COLOR
#define MOTION
#include "raster_vert.glsl"
