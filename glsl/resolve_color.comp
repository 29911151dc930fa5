#version 460
// One sample a texel. The other variant: resolve_color_ms.comp.
#extension GL_GOOGLE_include_directive : require
#include "resolve_color.glsl"
