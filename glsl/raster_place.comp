#version 460
// What the vertex stage would compute, once a vertex and in all threads: lavapipe shades vertices in one thread, and
// reads a storage buffer there at a twentieth of a frame a matrix. Used where no lens bends the picture.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 64) in;

// Radiance is wanted; motion vectors are.
layout(constant_id = 0) const bool COLOR = true;
layout(constant_id = 1) const bool MOTION = false;

// All input as texels of four words: a software device fetches a texel for all lanes at once, and a word of a storage
// buffer lane by lane.
// Three a vertex: position and object, normal and material, uv.
layout(set = 0, binding = 0) uniform usamplerBuffer vertices;
// Sixteen an object at an instant: the columns of its four matrices, as in raster_vert.glsl.
layout(set = 0, binding = 1) uniform usamplerBuffer instants;
// Two a material: diffuse colour; specular colour and exponent.
layout(set = 0, binding = 2) uniform usamplerBuffer materials;

const int CLIP = 0;
const int CLIP_AT_FROM = 1;
const int CLIP_AT_TO = 2;
const int CAMERA_CENTRED = 3;

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

vec4 column(int row, int of, int number) {
    return uintBitsToFloat(texelFetch(instants, row + 4 * of + number));
}

mat4 matrix(int row, int of) {
    return mat4(column(row, of, 0), column(row, of, 1), column(row, of, 2), column(row, of, 3));
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.vertex_count) {
        return;
    }
    uvec4 first = texelFetch(vertices, 3 * int(index));
    int row = 16 * int(push.instant * push.object_count + first.w);
    vec4 position = vec4(uintBitsToFloat(first.xyz), 1.0);
    placed[index].clip_xyw = three((matrix(row, CLIP) * position).xyw);
    if (COLOR) {
        uvec4 second = texelFetch(vertices, 3 * int(index) + 1);
        mat4 centred = matrix(row, CAMERA_CENTRED);
        placed[index].position_m = three((centred * position).xyz);
        placed[index].normal = three(mat3(centred) * uintBitsToFloat(second.xyz));
        vec2 uv = uintBitsToFloat(texelFetch(vertices, 3 * int(index) + 2).xy);
        placed[index].uv = float[2](uv.x, uv.y);
        placed[index].kd = three(uintBitsToFloat(texelFetch(materials, 2 * int(second.w)).rgb));
        vec4 ks_ns = uintBitsToFloat(texelFetch(materials, 2 * int(second.w) + 1));
        placed[index].ks_ns = float[4](ks_ns.x, ks_ns.y, ks_ns.z, ks_ns.w);
    }
    if (MOTION) {
        placed[index].clip_from = three((matrix(row, CLIP_AT_FROM) * position).xyw);
        placed[index].clip_to = three((matrix(row, CLIP_AT_TO) * position).xyw);
    }
}
