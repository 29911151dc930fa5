#version 460
// Several samples a texel, kept as floats. The other variant: resolve_color_fine.comp.
#extension GL_GOOGLE_include_directive : require
#define FINE
#define MULTISAMPLED
#include "resolve_color.glsl"
