#version 460
// Colour as half floats, which every device filters. The other variant: unpack_color.comp.
#extension GL_GOOGLE_include_directive : require
#define HALF
#include "unpack_color.glsl"
