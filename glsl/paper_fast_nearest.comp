#version 460
// `paper_fast`, the texel that holds the position: the fast mode. One tap a px of path is then needed.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
layout(set = 0, binding = 6) uniform sampler2D color;
vec3 tap(vec2 position_px) {
    return texelFetch(color, ivec2(position_px), 0).rgb;
}
#include "paper_fast.glsl"
