#version 460
// Several samples a texel. The other variant: exact_paths.comp.
#extension GL_GOOGLE_include_directive : require
#define MULTISAMPLED
#include "exact_paths.glsl"
