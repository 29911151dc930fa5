// Samples to what the gather reads: mean radiance of every texel of the supersampled picture, and, pixel by pixel, the
// distance of the nearest sample and the path that it takes over its line's exposure. Paths come from depth and
// matrices: no attachment is spent on them, and they are exact for whatever moves as a rigid body.
layout(local_size_x = 128, local_size_y = 1) in;
#include "resolve.glsl"
#include "rgb9e5.glsl"
layout(constant_id = 2) const bool LENS = false;
#define LENS_POSSIBLE LENS
#include "lens.glsl"
// Alpha: number of the motion group, 0 where nothing is.
layout(set = 0, binding = 0) uniform SAMPLES_2D color_samples;
// Near distance over distance; 0 where nothing was drawn.
layout(set = 0, binding = 1) uniform SAMPLES_2D depth_samples;
// Mean linear radiance of a texel and of the one to its right, as words of rgb9e5.glsl: a bilinear reading is then two
// fetches of eight bytes, which a software device does in a third of the time of four texels.
layout(set = 0, binding = 2, rg32ui) uniform writeonly uimage2D texels;
// 1/m, inverse distance of the pixel's nearest sample.
layout(set = 0, binding = 5, r32f) uniform writeonly image2D inverses;
// px from the middle of the line's exposure to its begin (xy) and to its end (zw).
layout(set = 0, binding = 3, rgba16f) uniform writeonly image2D paths;
// Two times rows x, y and w of a matrix that takes (ndc, depth, 1) at the middle of a line's exposure to clip space, at
// its begin and at its end. One row of the image a line, and in it group after group. An image, because lavapipe 22.3
// reads 24 floats of a storage buffer five times as slowly, even where all of a workgroup reads the same.
layout(set = 0, binding = 4) uniform sampler2D relatives;
// Texels of a pixel's side, samples of a texel: constants, so that loops over them unroll.
layout(constant_id = 0) const int GRID = 2;
layout(constant_id = 1) const int COUNT = 4;
layout(push_constant) uniform Push {
    // Delivered px of the attachment.
    uvec2 size;
    // Lines whose matrices there are (in the order of the picture): all, or one for all.
    uint line_count;
    // Lines are columns.
    uint columns;
    Lens lens;
    // Of the sides of `relatives`.
    vec2 share_per_row;
    float near_m;
} push;

// A texel is not fetched but sampled (nearest), because lavapipe 22.3 looks up the level of each lane for a fetch.
vec4 row_at(ivec2 row) {
    return textureLod(relatives, (vec2(row) + 0.5) * push.share_per_row, 0.0);
}

// Texels of a pixel's side take turns in how their colours are rounded, so that a pixel of one colour is as exact as
// with two bits more.
float round_up(int x, int y) {
    return 0.125 + 0.25 * float(((x & 1) ^ (y & 1)) * 2 + (y & 1));
}

// Where the matrix that begins at `row` puts a point, from where it is.
vec2 moved_px(ivec2 row, vec4 point, vec2 ndc) {
    float x = dot(row_at(row), point);
    float y = dot(row_at(row + ivec2(1, 0)), point);
    // Behind the camera at that time: the path is long, not reversed.
    float w = max(dot(row_at(row + ivec2(2, 0)), point), 0.02);
    vec4 seen = lens_sensor(push.lens, vec4(x, y, 0.0, w));
    return (seen.xy / w - ndc) * 0.5 * vec2(push.size);
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
    int last = int(push.size.x) * GRID - 1;
    for (int y = 0; y < GRID; ++y) {
        uint before = 0u;
        // One more than the pixel has: the right one of its last pair.
        for (int x = 0; x <= GRID; ++x) {
            ivec2 texel = pixel * GRID + ivec2(x, y);
            texel.x = min(texel.x, last);
            vec3 sum = vec3(0.0);
            for (int i = 0; i < COUNT; ++i) {
                vec4 color = sample_at(color_samples, texel, i);
                sum += color.rgb;
                // One sample's depth a texel is enough to find what is in front: with all of them the ladder's rows
                // stay within 0.1 dB.
                if (i == 0 && x < GRID) {
                    float d = sample_at(depth_samples, texel, i).r;
                    group = d > depth ? color.a : group;
                    depth = max(depth, d);
                }
            }
            uint word = rgb9e5(sum / float(COUNT), round_up(texel.x, texel.y));
            if (x > 0) {
                imageStore(texels, pixel * GRID + ivec2(x - 1, y), uvec4(before, word, 0u, 0u));
            }
            before = word;
        }
    }
    imageStore(inverses, pixel, vec4(depth / push.near_m));
    vec2 ndc = (vec2(pixel) + 0.5) / vec2(push.size) * 2.0 - 1.0;
    vec4 point = vec4(lens_ideal(push.lens, ndc), depth, 1.0);
    // Each pixel reads the matrices of its own group alone; where nothing is, those of what rests.
    int own = 6 * max(int(group) - 1, 0);
    ivec2 row = ivec2(own, min(across, push.line_count - 1u));
    vec4 path = vec4(moved_px(row, point, ndc), moved_px(row + ivec2(3, 0), point, ndc));
    imageStore(paths, pixel, clamp(path, -4096.0, 4096.0));
}
