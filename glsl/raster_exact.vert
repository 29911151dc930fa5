#version 460
// Rasterizes color, each vertex at the time of the line that it lands on.
#extension GL_GOOGLE_include_directive : require
#include "exact_vert.glsl"
