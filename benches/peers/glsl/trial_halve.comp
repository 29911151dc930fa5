#version 460
// Trial: the level that trial_prefiltered.comp reads.
layout(local_size_x = 64, local_size_y = 1) in;
layout(set = 0, binding = 0) uniform sampler2D color;
layout(set = 0, binding = 1, rgba8) uniform writeonly image2D level;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, imageSize(level)))) {
        return;
    }
    vec4 upper = texelFetch(color, 2 * texel, 0) + texelFetch(color, 2 * texel + ivec2(1, 0), 0);
    vec4 lower = texelFetch(color, 2 * texel + ivec2(0, 1), 0) + texelFetch(color, 2 * texel + 1, 0);
    imageStore(level, texel, 0.25 * (upper + lower));
}
