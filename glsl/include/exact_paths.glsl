// Samples to texels of the supersampled picture: mean radiance, and for the nearest sample its distance and the path
// that it takes over its line's exposure. Paths come from depth and matrices: no attachment is spent on them, and they
// are exact for whatever moves as a rigid body.
layout(local_size_x = 16, local_size_y = 8) in;
#include "resolve.glsl"
#include "lens.glsl"
// Alpha: number of the motion group, 0 where nothing is.
layout(set = 0, binding = 0) uniform SAMPLES_2D color_samples;
// Near distance over distance; 0 where nothing was drawn.
layout(set = 0, binding = 1) uniform SAMPLES_2D depth_samples;
// RGB: mean linear radiance. A: 1/m, inverse distance of the nearest sample.
layout(set = 0, binding = 2, rgba16f) uniform writeonly image2D texels;
// px from the middle of the line's exposure to its begin (xy) and to its end (zw).
layout(set = 0, binding = 3, rgba16f) uniform writeonly image2D paths;
// Begin and end of a line's exposure from its middle, in turn; `line_count` pairs a group, equally spaced lines.
layout(set = 0, binding = 4, std430) readonly buffer Relative {
    mat4 relative[];
};
layout(push_constant) uniform Push {
    // Texels of the attachment.
    uvec2 size;
    // Half of the attachment in delivered px.
    vec2 half_px;
    // Place among the pairs: dot(place_from_ndc, ndc) + place_offset.
    vec2 place_from_ndc;
    float place_offset;
    uint line_count;
    float near_m;
    float padding;
    Lens lens;
} push;

// Where the matrix and the lens put a point, from where it is: the ideal point of `ndc`.
vec2 moved_px(mat4 matrix, vec2 ideal, vec2 ndc, float depth) {
    vec4 clip = lens_sensor(push.lens, matrix * vec4(ideal, depth, 1.0));
    // Behind the camera at that time: the path is long, not reversed.
    return (clip.xy / max(clip.w, 0.02) - ndc) * push.half_px;
}

mat4 between(uint pair, uint which, float weight) {
    mat4 before = relative[2 * pair + which];
    return push.line_count > 1 ? before + weight * (relative[2 * pair + 2 + which] - before) : before;
}

void main() {
    uvec2 texel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(texel, push.size))) {
        return;
    }
    int count = sample_count(color_samples);
    vec3 sum = vec3(0.0);
    float depth = 0.0;
    float group = 0.0;
    for (int i = 0; i < count; ++i) {
        vec4 color = sample_at(color_samples, ivec2(texel), i);
        float d = sample_at(depth_samples, ivec2(texel), i).r;
        sum += color.rgb;
        group = d > depth ? color.a : group;
        depth = max(depth, d);
    }
    imageStore(texels, ivec2(texel), vec4(sum / float(count), depth / push.near_m));
    vec2 ndc = (vec2(texel) + 0.5) / vec2(push.size) * 2.0 - 1.0;
    float place = clamp(dot(push.place_from_ndc, ndc) + push.place_offset, 0.0, float(push.line_count - 1));
    uint pair = min(uint(place), max(push.line_count, 2u) - 2u);
    float weight = place - float(pair);
    // Where nothing is, the world rests infinitely far away.
    pair += push.line_count * uint(max(group - 1.0, 0.0));
    vec2 ideal = lens_ideal(push.lens, ndc);
    vec4 path = vec4(moved_px(between(pair, 0, weight), ideal, ndc, depth),
                     moved_px(between(pair, 1, weight), ideal, ndc, depth));
    imageStore(paths, ivec2(texel), clamp(path, -4096.0, 4096.0));
}
