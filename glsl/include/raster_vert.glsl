// Vertex stage of all rasterizing pipelines. COLOR: radiance is wanted; MOTION: motion vectors are; PATH: displacements
// from the instant of the picture to both ends of the span.
layout(location = 0) in vec3 position_m;
layout(location = 1) in uint object;
layout(location = 2) in vec3 normal;
layout(location = 3) in uint material;
layout(location = 4) in vec2 uv;

// Everything that depends on the instant and the object, computed in double precision on the host.
struct ObjectAtInstant {
    mat4 clip_from_object;
    // At the two ends of the time span over which motion is measured.
    mat4 clip_from_object_at_from;
    mat4 clip_from_object_at_to;
    // World moved so that the camera is its origin: lighting keeps its precision far from the world's origin.
    mat4 camera_centred_from_object;
};

layout(set = 0, binding = 0, std430) readonly buffer Instants {
    ObjectAtInstant instants[];
};

#include "raster_push.glsl"

#ifdef COLOR
struct Material {
    vec4 kd;
    // Specular colour, exponent.
    vec4 ks_ns;
};
layout(set = 0, binding = 1, std430) readonly buffer Materials {
    Material materials[];
};
layout(location = 0) out vec3 out_position_m;
layout(location = 1) out vec3 out_normal;
layout(location = 2) out vec2 out_uv;
layout(location = 3) flat out vec3 out_kd;
layout(location = 4) flat out vec4 out_ks_ns;
#endif
#ifdef MOTION
layout(location = 5) out vec3 out_clip_from;
layout(location = 6) out vec3 out_clip_to;
#endif
#ifdef PATH
layout(location = 7) out vec3 out_clip_now;
#endif

// Two pipelines draw the same triangles into one depth order.
invariant gl_Position;

void main() {
    ObjectAtInstant at = instants[push.instant * push.object_count + object];
    vec4 position = vec4(position_m, 1.0);
    gl_Position = lens_sensor(push.lens, at.clip_from_object * position);
#ifdef COLOR
    out_position_m = (at.camera_centred_from_object * position).xyz;
    out_normal = mat3(at.camera_centred_from_object) * normal;
    out_uv = uv;
    out_kd = materials[material].kd.rgb;
    out_ks_ns = materials[material].ks_ns;
#endif
#ifdef MOTION
    out_clip_from = lens_sensor(push.lens, at.clip_from_object_at_from * position).xyw;
    out_clip_to = lens_sensor(push.lens, at.clip_from_object_at_to * position).xyw;
#endif
#ifdef PATH
    out_clip_now = gl_Position.xyw;
#endif
}
