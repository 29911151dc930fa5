#version 460
// Several samples a texel. The other variant: accumulate.comp.
#extension GL_GOOGLE_include_directive : require
#define MULTISAMPLED
#include "accumulate.glsl"
