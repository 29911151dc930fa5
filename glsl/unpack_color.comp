#version 460
// Colour as floats. The other variant: unpack_color_half.comp.
#extension GL_GOOGLE_include_directive : require
#include "unpack_color.glsl"
