#version 460
// Rasterizes motion.
#extension GL_GOOGLE_include_directive : require
#define MOTION
#include "raster_frag.glsl"
