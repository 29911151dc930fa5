#version 460
// `paper_fast`, bilinear by the sampler, with positions in texels.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
layout(set = 0, binding = 6) uniform sampler2D color;
vec3 tap(vec2 position_px) {
    return textureLod(color, position_px, 0.0).rgb;
}
#include "paper_fast.glsl"
