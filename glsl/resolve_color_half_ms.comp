#version 460
// Several samples a texel, to half floats. The other variants: resolve_color_half.comp, resolve_color_ms.comp.
#extension GL_GOOGLE_include_directive : require
#define MULTISAMPLED
#define HALF
#include "resolve_color.glsl"
