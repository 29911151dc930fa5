#version 460
// Motion of a resting scene from depth and the camera's movement (the reconstruction method of the paper's section
// 2.3), for frames that bring depth but no motion. Twin: src/reference/motion_from_depth.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

// Metres along the optical axis; infinite, not a number or not above 0 = infinitely far: only rotation moves it.
layout(set = 0, binding = 0, r32f) uniform readonly image2D depth;
// px per frame interval.
layout(set = 0, binding = 1, rg32f) uniform writeonly image2DArray motion;

layout(push_constant) uniform Push {
    uvec2 size;
    uint layer;
    float scale;
    vec4 intrinsics;
    vec4 from_row_0;
    vec4 from_row_1;
    vec4 from_row_2;
    vec4 to_row_0;
    vec4 to_row_1;
    vec4 to_row_2;
} push;

float dot4(vec4 a, vec4 b) {
    precise float sum = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
    return sum;
}

// Where a point (homogeneous, in the camera of now) falls in the camera whose 3x4 matrix has these rows; z at or behind
// the camera: nowhere, `seen` is cleared.
vec2 project(vec4 row_0, vec4 row_1, vec4 row_2, vec4 point, inout bool seen) {
    float z = dot4(row_2, point);
    seen = seen && z > 0.0;
    precise vec2 at = vec2(dot4(row_0, point), dot4(row_1, point)) / z;
    precise vec2 px = push.intrinsics.xy * at + push.intrinsics.zw;
    return px;
}

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    float depth_m = imageLoad(depth, ivec2(pixel)).r;
    // The point over its depth: w = 1/depth goes to 0 for what is infinitely far, with no case of its own.
    precise vec2 ray = (vec2(pixel) + 0.5 - push.intrinsics.zw) / push.intrinsics.xy;
    vec4 point = vec4(ray, 1.0, depth_m > 0.0 ? 1.0 / depth_m : 0.0);
    bool seen = true;
    vec2 from_px = project(push.from_row_0, push.from_row_1, push.from_row_2, point, seen);
    vec2 to_px = project(push.to_row_0, push.to_row_1, push.to_row_2, point, seen);
    precise vec2 motion_px = (to_px - from_px) * push.scale;
    imageStore(motion, ivec3(pixel, push.layer), vec4(seen ? motion_px : vec2(0.0), 0.0, 0.0));
}
