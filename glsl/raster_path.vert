#version 460
// Rasterizes displacements to two other instants.
#extension GL_GOOGLE_include_directive : require
#define MOTION
#define PATH
#include "raster_vert.glsl"
