#version 460
// The shutter of `--method exact`: every vertex is put where the camera sees it at the time of the line that it lands on.
// Visibility, depth and antialiasing of the raster are then those of the delivered picture. A kernel and not the vertex
// shader, because a vertex is shared by six triangles, and lavapipe shades vertices in one thread.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 64) in;

layout(constant_id = 0) const bool LIT = false;

struct Vertex {
    float position_m[3];
    // Number of the motion group: what moves alike.
    uint group;
    float normal[3];
    uint material;
    float uv[2];
};
layout(set = 0, binding = 0, std430) readonly buffer Vertices {
    Vertex vertices[];
};

// A motion group at one of `knot_count` equally spaced times, computed in double precision on the host. Between knots
// everything is linear in time: the host chooses so many knots that this is exact to a hundredth of a px.
struct Knot {
    mat4 clip_from_object;
    // World moved so that the camera of a fixed instant is its origin.
    mat4 centred_from_object;
    // The camera in that world; w unused.
    vec4 eye_m;
};
layout(set = 0, binding = 1, std430) readonly buffer Knots {
    Knot knots[];
};

struct Material {
    vec4 kd;
    vec4 ks_ns;
};
layout(set = 0, binding = 3, std430) readonly buffer Materials {
    Material materials[];
};

// What the vertex stage reads. Depth is reversed and infinite: clip.z is the near distance for every vertex.
struct Placed {
    float clip_xyw[3];
    float position_m[3];
    float normal[3];
    float eye_m[3];
    float uv[2];
    float kd[3];
    float ks_ns[4];
    uint group;
};
layout(set = 0, binding = 2, std430) writeonly buffer PlacedVertices {
    Placed placed[];
};

layout(constant_id = 1) const bool LENS = false;
#define LENS_POSSIBLE LENS
#include "lens.glsl"
layout(push_constant) uniform Push {
    uint vertex_count;
    // Rows a group, an odd number; 1: an instant, nothing is searched for.
    uint knot_count;
    // Times are places among the knots. Those of lines far outside the picture stop here.
    float place_low;
    float place_high;
    // Place of the line through a point of the picture: dot(place_from_ndc, ndc) + place_offset.
    vec2 place_from_ndc;
    float place_offset;
    float near_m;
    Lens lens;
} push;

// Steps of the search. Each divides the error by the line's speed over the content's (10 and more), and the secant makes
// it faster than linear: 3 leave less than a thousandth of a line at 0.3 of the readout's speed.
const int STEPS = 3;

// Where the lens puts a point of the ideal picture (clip space). It moves the vertex and with it the line whose time it
// is seen at.
vec4 sensor_from_ideal(vec4 ideal) {
    return lens_sensor(push.lens, ideal);
}

uint knot_before(float place) {
    return uint(clamp(int(floor(place)), 0, int(push.knot_count) - 2));
}

// Linear between knots, and beyond them as between the last two.
vec4 project(uint first, float place, vec4 position) {
    uint k = knot_before(place);
    vec4 before = knots[first + k].clip_from_object * position;
    vec4 after = knots[first + k + 1].clip_from_object * position;
    return sensor_from_ideal(before + (place - float(k)) * (after - before));
}

// Place in time of the line that a point falls on. What is behind the camera is taken to be just in front of it: in the
// limit that is where it leaves the picture, and a time that varies continuously along every edge is all that matters
// for what lies outside.
float place_of_line(vec4 clip) {
    vec2 ndc = clip.xy / max(clip.w, push.near_m);
    return clamp(dot(push.place_from_ndc, ndc) + push.place_offset, push.place_low, push.place_high);
}

// The place p at which p = place_of_line(project(p)): fixed-point steps with the slope of the last two (secant). The
// slope is held under one, so that content as fast as the readout cannot throw a vertex about.
float own_place(uint first, vec4 position) {
    // The number of knots is odd, so the one in the middle needs no neighbour.
    uint middle = (push.knot_count - 1u) / 2u;
    float last = float(middle);
    float last_line = place_of_line(sensor_from_ideal(knots[first + middle].clip_from_object * position));
    float place = last_line;
    for (int i = 1; i < STEPS; ++i) {
        float line = place_of_line(project(first, place, position));
        float step = place - last;
        float slope = abs(step) > 1e-6 ? clamp((line - last_line) / step, -0.8, 0.8) : 0.0;
        last = place;
        last_line = line;
        place = clamp(place + (line - place) / (1.0 - slope), push.place_low, push.place_high);
    }
    return place;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.vertex_count) {
        return;
    }
    Vertex v = vertices[index];
    vec4 position = vec4(v.position_m[0], v.position_m[1], v.position_m[2], 1.0);
    uint first = v.group * push.knot_count;
    vec4 clip;
    uint k = 0;
    float weight = 0.0;
    if (push.knot_count == 1) {
        clip = sensor_from_ideal(knots[first].clip_from_object * position);
    } else {
        float place = own_place(first, position);
        clip = project(first, place, position);
        k = knot_before(place);
        weight = place - float(k);
    }
    Material m = materials[v.material];
    placed[index].clip_xyw = float[3](clip.x, clip.y, clip.w);
    if (LIT) {
        mat4 centred = knots[first + k].centred_from_object;
        vec3 eye = knots[first + k].eye_m.xyz;
        if (push.knot_count > 1) {
            centred += weight * (knots[first + k + 1].centred_from_object - centred);
            eye += weight * (knots[first + k + 1].eye_m.xyz - eye);
        }
        vec3 seen = (centred * position).xyz;
        vec3 normal = mat3(centred) * vec3(v.normal[0], v.normal[1], v.normal[2]);
        placed[index].position_m = float[3](seen.x, seen.y, seen.z);
        placed[index].normal = float[3](normal.x, normal.y, normal.z);
        placed[index].eye_m = float[3](eye.x, eye.y, eye.z);
        placed[index].ks_ns = float[4](m.ks_ns.x, m.ks_ns.y, m.ks_ns.z, m.ks_ns.w);
    }
    placed[index].uv = v.uv;
    placed[index].kd = float[3](m.kd.x, m.kd.y, m.kd.z);
    placed[index].group = v.group;
}
