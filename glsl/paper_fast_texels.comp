#version 460
// `paper_fast`, bilinear by four texels.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
layout(set = 0, binding = 6) uniform sampler2D color;
vec3 tap(vec2 position_px) {
    vec2 corner = position_px - 0.5;
    ivec2 texel = ivec2(corner);
    vec2 weight = corner - vec2(texel);
    vec3 upper = mix(texelFetch(color, texel, 0).rgb, texelFetch(color, texel + ivec2(1, 0), 0).rgb, weight.x);
    vec3 lower = mix(texelFetch(color, texel + ivec2(0, 1), 0).rgb, texelFetch(color, texel + 1, 0).rgb, weight.x);
    return mix(upper, lower, weight.y);
}
#include "paper_fast.glsl"
