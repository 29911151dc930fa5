#version 460
// Input in storage buffers. The other variant: exact_place.comp.
#extension GL_GOOGLE_include_directive : require
#include "exact_place.glsl"
