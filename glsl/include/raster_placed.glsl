// Vertex stage for vertices that raster_place.comp has placed. The same outputs as raster_vert.glsl.
layout(location = 0) in vec3 clip_xyw;
#ifdef COLOR
layout(location = 1) in vec3 position_m;
layout(location = 2) in vec3 normal;
layout(location = 3) in vec2 uv;
layout(location = 4) in vec3 kd;
layout(location = 5) in vec4 ks_ns;
layout(location = 0) out vec3 out_position_m;
layout(location = 1) out vec3 out_normal;
layout(location = 2) out vec2 out_uv;
layout(location = 3) flat out vec3 out_kd;
layout(location = 4) flat out vec4 out_ks_ns;
#endif
#ifdef MOTION
#ifdef COLOR
layout(location = 6) in vec3 clip_from;
layout(location = 7) in vec3 clip_to;
#else
layout(location = 1) in vec3 clip_from;
layout(location = 2) in vec3 clip_to;
#endif
layout(location = 5) out vec3 out_clip_from;
layout(location = 6) out vec3 out_clip_to;
#endif
#ifdef PATH
layout(location = 7) out vec3 out_clip_now;
#endif

// Near distance, m.
layout(constant_id = 3) const float NEAR_M = 0.01;

// Two pipelines draw the same triangles into one depth order.
invariant gl_Position;

void main() {
    gl_Position = vec4(clip_xyw.xy, NEAR_M, clip_xyw.z);
#ifdef COLOR
    out_position_m = position_m;
    out_normal = normal;
    out_uv = uv;
    out_kd = kd;
    out_ks_ns = ks_ns;
#endif
#ifdef MOTION
    out_clip_from = clip_from;
    out_clip_to = clip_to;
#endif
#ifdef PATH
    out_clip_now = clip_xyw;
#endif
}
