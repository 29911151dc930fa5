#version 460
// One sample a texel. The other variant: accumulate_ms.comp.
#extension GL_GOOGLE_include_directive : require
#include "accumulate.glsl"
