#version 460
// Several samples a texel. The other variant: resolve_color.comp.
#extension GL_GOOGLE_include_directive : require
#define MULTISAMPLED
#include "resolve_color.glsl"
