#version 460
// Trial: what trial_prefix.comp reads. An invocation a row.
layout(local_size_x = 8, local_size_y = 1) in;
layout(set = 0, binding = 0) uniform sampler2D color;
layout(set = 0, binding = 1, rgba32f) uniform writeonly image2D level;

void main() {
    int row = int(gl_GlobalInvocationID.x);
    ivec2 size = imageSize(level);
    if (row >= size.y) {
        return;
    }
    vec4 sum = vec4(0.0);
    for (int x = 0; x < size.x; ++x) {
        imageStore(level, ivec2(x, row), sum);
        sum += texelFetch(color, ivec2(x, row), 0);
    }
}
