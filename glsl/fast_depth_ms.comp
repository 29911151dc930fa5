#version 460
// Several samples a texel. The other variant: fast_depth.comp.
#extension GL_GOOGLE_include_directive : require
#define MULTISAMPLED
#include "fast_depth.glsl"
