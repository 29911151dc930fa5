#version 460
// One sample a texel, kept as floats. The other variant: resolve_color_fine_ms.comp.
#extension GL_GOOGLE_include_directive : require
#define FINE
#include "resolve_color.glsl"
