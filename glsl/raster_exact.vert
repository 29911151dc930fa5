#version 460
// Rasterizes color of vertices that exact_place.comp has placed.
layout(location = 0) in vec3 clip_xyw;
layout(location = 1) in vec3 position_m;
layout(location = 2) in vec3 normal;
layout(location = 3) in vec3 eye_m;
layout(location = 4) in vec2 uv;
layout(location = 5) in vec3 kd;
layout(location = 6) in vec4 ks_ns;
layout(location = 7) in uint group;

layout(push_constant) uniform Push {
    float near_m;
} push;

layout(location = 0) out vec3 out_position_m;
layout(location = 1) out vec3 out_normal;
layout(location = 2) out vec2 out_uv;
layout(location = 3) flat out vec3 out_kd;
layout(location = 4) flat out vec4 out_ks_ns;
layout(location = 5) out vec3 out_eye_m;
layout(location = 6) flat out float out_group;

void main() {
    gl_Position = vec4(clip_xyw.xy, push.near_m, clip_xyw.z);
    out_position_m = position_m;
    out_normal = normal;
    out_uv = uv;
    out_kd = kd;
    out_ks_ns = ks_ns;
    out_eye_m = eye_m;
    out_group = float(group + 1u);
}
