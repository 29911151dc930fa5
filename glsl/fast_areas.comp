#version 460
// `--method fast`: the mean of the picture over one px at every half px, so that blur reads a pixel's area by four texels
// instead of nine. Twin: src/reference/fast_areas.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

// Two texels a px.
layout(set = 0, binding = 0) uniform sampler2D color;
// Texel (x, y) is the mean of the 2x2 texels from (x, y) on.
layout(set = 0, binding = 1, rgba32f) uniform writeonly image2D areas;

layout(push_constant) uniform Push {
    uvec2 size;
} push;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, ivec2(push.size)))) {
        return;
    }
    ivec2 far = min(texel + 1, ivec2(push.size) - 1);
    precise vec4 above = texelFetch(color, texel, 0) + texelFetch(color, ivec2(far.x, texel.y), 0);
    precise vec4 below = texelFetch(color, ivec2(texel.x, far.y), 0) + texelFetch(color, far, 0);
    precise vec4 mean = 0.25 * (above + below);
    imageStore(areas, texel, mean);
}
