#version 460
// One sample a texel. The other variant: fast_depth_ms.comp. Twin: src/reference/fast_depth.rs.
#extension GL_GOOGLE_include_directive : require
#include "fast_depth.glsl"
