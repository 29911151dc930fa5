#version 460
// One sample a texel, to half floats. The other variants: resolve_color_half_ms.comp, resolve_color.comp.
#extension GL_GOOGLE_include_directive : require
#define HALF
#include "resolve_color.glsl"
