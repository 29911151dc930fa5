// The shutter of `--method exact`: every vertex is put where the camera sees it at the time of the line that it lands
// on. Visibility, depth and antialiasing of the raster are then those of the delivered picture. A kernel and not the
// vertex shader, because a vertex is shared by six triangles, and lavapipe shades vertices in one thread.
layout(local_size_x = 64) in;

layout(constant_id = 0) const bool LIT = false;

// Input is counted in texels of four words. A software device fetches a texel for all lanes at once, and a word of a
// storage buffer lane by lane; a device that has fewer texels than a scene needs reads storage buffers.
#ifdef TEXELS
#define ROWS(BINDING, NAME) layout(set = 0, binding = BINDING) uniform usamplerBuffer NAME
#define ROW(NAME, INDEX) texelFetch(NAME, INDEX)
#else
#define ROWS(BINDING, NAME) \
    layout(set = 0, binding = BINDING, std430) readonly buffer NAME##_block { uvec4 rows[]; } NAME
#define ROW(NAME, INDEX) NAME.rows[INDEX]
#endif
// Three a vertex: position and number of the motion group (what moves alike); normal and material; uv.
ROWS(0, vertices);
// Nine a motion group at one of `knot_count` equally spaced times, computed in double precision on the host: the
// columns of clip from object; those of world from object, the world moved so that the camera of a fixed instant is its
// origin; the camera in that world. Between knots everything is linear in time: the host chooses so many that this is
// exact to a hundredth of a px.
ROWS(1, knots);
// Two a material: diffuse colour; specular colour and exponent.
ROWS(3, materials);

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

// Steps of the search. Each divides the error by the line's speed over the content's (10 and more), and the secant
// makes it faster than linear: 3 leave less than a thousandth of a line at 0.3 of the readout's speed.
const int STEPS = 3;

// Where the lens puts a point of the ideal picture (clip space). It moves the vertex and with it the line whose time it
// is seen at.
vec4 sensor_from_ideal(vec4 ideal) {
    return lens_sensor(push.lens, ideal);
}

uint knot_before(float place) {
    return uint(clamp(int(floor(place)), 0, int(push.knot_count) - 2));
}

vec4 column(uint knot, int number) {
    return uintBitsToFloat(ROW(knots, 9 * int(knot) + number));
}

// Products of matrices as raster_place.comp has them: a picture at rest is the same to the bit.
vec4 clip_at(uint knot, vec3 position) {
    return mat4(column(knot, 0), column(knot, 1), column(knot, 2), column(knot, 3)) * vec4(position, 1.0);
}

mat4 centred_at(uint knot) {
    return mat4(column(knot, 4), column(knot, 5), column(knot, 6), column(knot, 7));
}

// Linear between knots, and beyond them as between the last two.
vec4 project(uint first, float place, vec3 position) {
    uint k = knot_before(place);
    vec4 before = clip_at(first + k, position);
    vec4 after = clip_at(first + k + 1, position);
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
float own_place(uint first, vec3 position) {
    // The number of knots is odd, so the one in the middle needs no neighbour.
    uint middle = (push.knot_count - 1u) / 2u;
    float last = float(middle);
    float last_line = place_of_line(sensor_from_ideal(clip_at(first + middle, position)));
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

float[3] three(vec3 v) {
    return float[3](v.x, v.y, v.z);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.vertex_count) {
        return;
    }
    uvec4 corner = ROW(vertices, 3 * int(index));
    vec3 position = uintBitsToFloat(corner.xyz);
    uint first = corner.w * push.knot_count;
    vec4 clip;
    uint k = 0;
    float weight = 0.0;
    if (push.knot_count == 1) {
        clip = sensor_from_ideal(clip_at(first, position));
    } else {
        float place = own_place(first, position);
        clip = project(first, place, position);
        k = knot_before(place);
        weight = place - float(k);
    }
    uvec4 side = ROW(vertices, 3 * int(index) + 1);
    int material = 2 * int(side.w);
    placed[index].clip_xyw = float[3](clip.x, clip.y, clip.w);
    if (LIT) {
        mat4 centred = centred_at(first + k);
        vec3 eye = column(first + k, 8).xyz;
        if (push.knot_count > 1) {
            centred += weight * (centred_at(first + k + 1) - centred);
            eye += weight * (column(first + k + 1, 8).xyz - eye);
        }
        placed[index].position_m = three((centred * vec4(position, 1.0)).xyz);
        placed[index].normal = three(mat3(centred) * uintBitsToFloat(side.xyz));
        placed[index].eye_m = three(eye);
        vec4 ks_ns = uintBitsToFloat(ROW(materials, material + 1));
        placed[index].ks_ns = float[4](ks_ns.x, ks_ns.y, ks_ns.z, ks_ns.w);
    }
    vec2 uv = uintBitsToFloat(ROW(vertices, 3 * int(index) + 2).xy);
    placed[index].uv = float[2](uv.x, uv.y);
    placed[index].kd = three(uintBitsToFloat(ROW(materials, material).rgb));
    placed[index].group = corner.w;
}
