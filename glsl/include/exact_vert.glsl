// Vertex stage of `--method exact`: the shutter in the projection. A vertex stands where the camera sees it at the time
// of the line that it lands on; visibility, depth and antialiasing of the raster are then those of the delivered picture.
layout(location = 0) in vec3 position_m;
// Number of the motion group: what moves alike.
layout(location = 1) in uint group;
layout(location = 2) in vec3 normal;
layout(location = 3) in uint material;
layout(location = 4) in vec2 uv;

layout(constant_id = 0) const bool LIT = false;

// A motion group at one of `knot_count` equally spaced times, computed in double precision on the host. Between knots
// everything is linear in time: the host chooses so many knots that this is exact to a hundredth of a px.
struct Knot {
    mat4 clip_from_object;
    // World moved so that the camera of a fixed instant is its origin.
    mat4 centred_from_object;
    // The camera in that world; w unused.
    vec4 eye_m;
};
layout(set = 0, binding = 0, std430) readonly buffer Knots {
    Knot knots[];
};
struct Material {
    vec4 kd;
    vec4 ks_ns;
};
layout(set = 0, binding = 1, std430) readonly buffer Materials {
    Material materials[];
};

#include "lens.glsl"
layout(push_constant) uniform Push {
    // Rows a group; 1: an instant, nothing is searched for.
    uint knot_count;
    // Times are places among the knots. Those of lines far outside the picture stop here.
    float place_low;
    float place_high;
    // Place of the line through a point of the picture: dot(place_from_ndc, ndc) + place_offset.
    float place_offset;
    vec2 place_from_ndc;
    Lens lens;
} push;

layout(location = 0) out vec3 out_position_m;
layout(location = 1) out vec3 out_normal;
layout(location = 2) out vec2 out_uv;
layout(location = 3) flat out vec3 out_kd;
layout(location = 4) flat out vec4 out_ks_ns;
layout(location = 5) out vec3 out_eye_m;
layout(location = 6) flat out float out_group;

invariant gl_Position;

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
vec4 project(uint first, float place) {
    uint k = knot_before(place);
    vec4 position = vec4(position_m, 1.0);
    vec4 before = knots[first + k].clip_from_object * position;
    vec4 after = knots[first + k + 1].clip_from_object * position;
    return sensor_from_ideal(before + (place - float(k)) * (after - before));
}

// Place in time of the line that a point falls on. What is behind the camera is taken to be just in front of it: in the
// limit that is where it leaves the picture, and a time that varies continuously along every edge is all that matters
// for what lies outside.
float place_of_line(vec4 clip) {
    vec2 ndc = clip.xy / max(clip.w, clip.z);
    return clamp(dot(push.place_from_ndc, ndc) + push.place_offset, push.place_low, push.place_high);
}

// The place p at which p = place_of_line(project(p)): fixed-point steps with the slope of the last two (secant). The
// slope is held under one, so that content as fast as the readout cannot throw a vertex about.
float own_place(uint first) {
    float last = 0.5 * (push.place_low + push.place_high);
    float last_line = place_of_line(project(first, last));
    float place = last_line;
    for (int i = 1; i < STEPS; ++i) {
        float line = place_of_line(project(first, place));
        float step = place - last;
        float slope = abs(step) > 1e-6 ? clamp((line - last_line) / step, -0.8, 0.8) : 0.0;
        last = place;
        last_line = line;
        place = clamp(place + (line - place) / (1.0 - slope), push.place_low, push.place_high);
    }
    return place;
}

void main() {
    uint first = group * push.knot_count;
    vec4 position = vec4(position_m, 1.0);
    mat4 centred;
    if (push.knot_count == 1) {
        gl_Position = sensor_from_ideal(knots[first].clip_from_object * position);
        if (LIT) {
            centred = knots[first].centred_from_object;
            out_eye_m = knots[first].eye_m.xyz;
        }
    } else {
        float place = own_place(first);
        gl_Position = project(first, place);
        if (LIT) {
            uint k = knot_before(place);
            float weight = place - float(k);
            mat4 before = knots[first + k].centred_from_object;
            centred = before + weight * (knots[first + k + 1].centred_from_object - before);
            out_eye_m = mix(knots[first + k].eye_m.xyz, knots[first + k + 1].eye_m.xyz, weight);
        }
    }
    if (LIT) {
        out_position_m = (centred * position).xyz;
        out_normal = mat3(centred) * normal;
    } else {
        out_position_m = vec3(0.0);
        out_normal = vec3(0.0);
        out_eye_m = vec3(0.0);
    }
    out_uv = uv;
    out_kd = materials[material].kd.rgb;
    out_ks_ns = materials[material].ks_ns;
    out_group = float(group + 1u);
}
