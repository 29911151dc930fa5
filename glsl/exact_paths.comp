#version 460
// One sample a texel. The other variant: exact_paths_ms.comp.
#extension GL_GOOGLE_include_directive : require
#include "exact_paths.glsl"
