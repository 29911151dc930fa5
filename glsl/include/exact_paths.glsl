// Samples to what the gather reads: mean radiance of every texel of the supersampled picture, and, pixel by pixel, the
// distance of the nearest sample and the path that it takes over its line's exposure. Paths come from depth and
// matrices: no attachment is spent on them, and they are exact for whatever moves as a rigid body.
layout(local_size_x = 128, local_size_y = 1) in;
#include "resolve.glsl"
// Alpha: number of the motion group, 0 where nothing is.
layout(set = 0, binding = 0) uniform SAMPLES_2D color_samples;
// Near distance over distance; 0 where nothing was drawn.
layout(set = 0, binding = 1) uniform SAMPLES_2D depth_samples;
// RGB: mean linear radiance. A: 1/m, inverse distance of the texel's nearest sample.
layout(set = 0, binding = 2, rgba16f) uniform writeonly image2D texels;
// px from the middle of the line's exposure to its begin (xy) and to its end (zw).
layout(set = 0, binding = 3, rgba16f) uniform writeonly image2D paths;
// Rows x, y and w of a matrix that takes (ndc, depth, 1) at the middle of a line's exposure to clip space.
struct Relative {
    vec4 begin[3];
    vec4 end[3];
};
// Line by line, and within a line group by group.
layout(set = 0, binding = 4, std430) readonly buffer Relatives {
    Relative relatives[];
};
// Texels of a pixel's side, samples of a texel: constants, so that loops over them unroll.
layout(constant_id = 0) const int GRID = 2;
layout(constant_id = 1) const int COUNT = 4;
layout(constant_id = 2) const int DEPTHS = 2;
layout(push_constant) uniform Push {
    // Delivered px of the attachment.
    uvec2 size;
    // Lines whose matrices there are (in the order of the picture): all, or one for all.
    uint line_count;
    uint group_count;
    // Lines are columns.
    uint columns;
    float near_m;
} push;

// Where the matrix puts a point, from where it is.
vec2 moved_px(vec4 rows[3], vec4 point) {
    // Behind the camera at that time: the path is long, not reversed.
    float w = max(dot(rows[2], point), 0.02);
    return (vec2(dot(rows[0], point), dot(rows[1], point)) / w - point.xy) * 0.5 * vec2(push.size);
}

void main() {
    // A workgroup stays in one line: what it reads of the matrices is the same for all of it.
    uint across = gl_WorkGroupID.y;
    uint place = gl_GlobalInvocationID.x;
    ivec2 pixel = push.columns != 0u ? ivec2(across, place) : ivec2(place, across);
    if (any(greaterThanEqual(uvec2(pixel), push.size))) {
        return;
    }
    float depth = 0.0;
    float group = 0.0;
    for (int y = 0; y < GRID; ++y) {
        for (int x = 0; x < GRID; ++x) {
            ivec2 texel = pixel * GRID + ivec2(x, y);
            vec3 sum = vec3(0.0);
            float nearest = 0.0;
            for (int i = 0; i < COUNT; ++i) {
                vec4 color = sample_at(color_samples, texel, i);
                sum += color.rgb;
                // Every other sample's depth is enough to find what is in front.
                if (i % (COUNT / DEPTHS) == 0) {
                    float d = sample_at(depth_samples, texel, i).r;
                    group = d > depth ? color.a : group;
                    depth = max(depth, d);
                    nearest = max(nearest, d);
                }
            }
            imageStore(texels, texel, vec4(sum / float(COUNT), nearest / push.near_m));
        }
    }
    vec4 point = vec4((vec2(pixel) + 0.5) / vec2(push.size) * 2.0 - 1.0, depth, 1.0);
    uint first = min(across, push.line_count - 1u) * push.group_count;
    vec4 path = vec4(moved_px(relatives[first].begin, point), moved_px(relatives[first].end, point));
    // What moves by itself. One group after the other: reading matrices by a number that differs from pixel to pixel
    // costs lavapipe twenty times as much.
    for (uint g = 1u; g < push.group_count; ++g) {
        vec4 other = vec4(moved_px(relatives[first + g].begin, point), moved_px(relatives[first + g].end, point));
        path = uint(group) == g + 1u ? other : path;
    }
    imageStore(paths, pixel, clamp(path, -4096.0, 4096.0));
}
