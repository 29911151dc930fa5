#version 460
// Trial: a level of half the size, each of its texels the mean of four, read every fourth px of the path.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
layout(set = 0, binding = 6) uniform sampler2D color;
vec3 tap(vec2 position_px) {
    return textureLod(color, 0.5 * position_px, 0.0).rgb;
}
#include "paper_fast.glsl"
