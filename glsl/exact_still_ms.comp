#version 460
// Several samples a texel. The other variant: exact_still.comp.
#extension GL_GOOGLE_include_directive : require
#define MULTISAMPLED
#include "exact_still.glsl"
