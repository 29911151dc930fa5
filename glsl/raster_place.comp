#version 460
// What the vertex stage would compute, once a vertex and in all threads: lavapipe shades vertices in one thread, and reads
// a storage buffer there at a twentieth of a frame a matrix. Used where no lens bends the picture.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 64) in;

// Radiance is wanted; motion vectors are.
layout(constant_id = 0) const bool COLOR = true;
layout(constant_id = 1) const bool MOTION = false;

struct Vertex {
    float position_m[3];
    uint object;
    float normal[3];
    uint material;
    float uv[2];
};
layout(set = 0, binding = 0, std430) readonly buffer Vertices {
    Vertex vertices[];
};

// As in raster_vert.glsl.
struct ObjectAtInstant {
    mat4 clip_from_object;
    mat4 clip_from_object_at_from;
    mat4 clip_from_object_at_to;
    mat4 camera_centred_from_object;
};
layout(set = 0, binding = 1, std430) readonly buffer Instants {
    ObjectAtInstant instants[];
};

struct Material {
    vec4 kd;
    vec4 ks_ns;
};
layout(set = 0, binding = 2, std430) readonly buffer Materials {
    Material materials[];
};

// What the vertex stage reads. Depth is reversed and infinite: clip.z is the near distance for every vertex.
struct PlacedVertex {
    float clip_xyw[3];
    float position_m[3];
    float normal[3];
    float uv[2];
    float kd[3];
    float ks_ns[4];
    float clip_from[3];
    float clip_to[3];
};
layout(set = 0, binding = 3, std430) writeonly buffer PlacedVertices {
    PlacedVertex placed[];
};

layout(push_constant) uniform Push {
    // Row of `instants`, and its length.
    uint instant;
    uint object_count;
    uint vertex_count;
} push;

float[3] three(vec3 v) {
    return float[3](v.x, v.y, v.z);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.vertex_count) {
        return;
    }
    Vertex v = vertices[index];
    uint row = push.instant * push.object_count + v.object;
    vec4 position = vec4(v.position_m[0], v.position_m[1], v.position_m[2], 1.0);
    placed[index].clip_xyw = three((instants[row].clip_from_object * position).xyw);
    if (COLOR) {
        vec3 normal = vec3(v.normal[0], v.normal[1], v.normal[2]);
        mat4 centred = instants[row].camera_centred_from_object;
        placed[index].position_m = three((centred * position).xyz);
        placed[index].normal = three(mat3(centred) * normal);
        placed[index].uv = v.uv;
        Material m = materials[v.material];
        placed[index].kd = three(m.kd.rgb);
        placed[index].ks_ns = float[4](m.ks_ns.x, m.ks_ns.y, m.ks_ns.z, m.ks_ns.w);
    }
    if (MOTION) {
        placed[index].clip_from = three((instants[row].clip_from_object_at_from * position).xyw);
        placed[index].clip_to = three((instants[row].clip_from_object_at_to * position).xyw);
    }
}
