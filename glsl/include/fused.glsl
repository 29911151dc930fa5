// The value at a place from the 2x2 texels around it in each of several pictures, which are moved against each other by
// parts of a px: that of least expected error where values alike by exp(-distance^2) are known with a little noise
// (kriging). Twin: src/reference/fused.rs. Needs cubic; the push constants have `texels`.
#ifndef FUSED_GLSL
#define FUSED_GLSL

// Variance of a texel's noise (of places that are off by some hundredths of a px, mostly) over that of the picture.
// Tried on checks at any phase: 0.003 and 0.01, and other likenesses (docs/methods.md).
const float NOISE = 0.008;

// Texels (0, 0), (1, 0), (0, 1), (1, 1) around a place; `off`: from the place to the centre of the first, px.
struct Around {
    mat4x3 texels;
    vec2 off;
    bool known;
};

Around around(sampler2D picture, vec2 place_px, bool known) {
    ivec2 last = push.texels - 2;
    ivec2 first = clamp(ivec2(floor(place_px - 0.5)), ivec2(0), max(last, ivec2(0)));
    ivec2 far = min(first + 1, push.texels - 1);
    Around a;
    a.texels = mat4x3(texel_in(picture, first, push.texels), texel_in(picture, ivec2(far.x, first.y), push.texels),
                      texel_in(picture, ivec2(first.x, far.y), push.texels), texel_in(picture, far, push.texels));
    precise vec2 off = vec2(first) + 0.5 - place_px;
    a.off = off;
    a.known = known;
    return a;
}

// Likeness at a distance along one axis.
float alike(float distance_px) { return exp(-distance_px * distance_px); }

// Likeness of four texels to the place.
vec4 alike_to_place(Around a) {
    vec2 x = vec2(alike(a.off.x), alike(a.off.x + 1.0));
    vec2 y = vec2(alike(a.off.y), alike(a.off.y + 1.0));
    return a.known ? vec4(x * y.x, x * y.y) : vec4(0.0);
}

// Likeness of four texels (rows) to four others (columns) that lie `apart` before them.
mat4 alike_to_others(vec2 apart) {
    vec2 x_0 = vec2(alike(apart.x), alike(apart.x + 1.0));
    vec2 x_1 = vec2(alike(apart.x - 1.0), x_0.x);
    vec2 y_0 = vec2(alike(apart.y), alike(apart.y + 1.0));
    vec2 y_1 = vec2(alike(apart.y - 1.0), y_0.x);
    return mat4(vec4(x_0 * y_0.x, x_0 * y_0.y), vec4(x_1 * y_0.x, x_1 * y_0.y), vec4(x_0 * y_1.x, x_0 * y_1.y),
                vec4(x_1 * y_1.x, x_1 * y_1.y));
}

mat4 between(Around a, Around b) { return a.known && b.known ? alike_to_others(a.off - b.off) : mat4(0.0); }

vec3 least_of(Around a, vec3 before) {
    vec3 least = min(min(a.texels[0], a.texels[1]), min(a.texels[2], a.texels[3]));
    return a.known ? min(before, least) : before;
}

vec3 most_of(Around a, vec3 before) {
    vec3 most = max(max(a.texels[0], a.texels[1]), max(a.texels[2], a.texels[3]));
    return a.known ? max(before, most) : before;
}

// The system of all texels is eliminated picture by picture; one that is not known has no likeness to anything, and
// weighs nothing.
vec3 fused(Around a, Around b, Around c) {
    mat4 own = alike_to_others(vec2(0.0)) + mat4(NOISE);
    mat4 inverse_own = inverse(own);
    mat4 ab = between(a, b);
    mat4 ac = between(a, c);
    vec4 to_a = alike_to_place(a);
    mat4 share_b = transpose(ab) * inverse_own;
    mat4 share_c = transpose(ac) * inverse_own;
    mat4 rest_b = inverse(own - share_b * ab);
    mat4 bc = between(b, c) - share_b * ac;
    vec4 to_b = alike_to_place(b) - share_b * to_a;
    mat4 then_c = transpose(bc) * rest_b;
    mat4 rest_c = inverse(own - share_c * ac - then_c * bc);
    vec4 to_c = alike_to_place(c) - share_c * to_a - then_c * to_b;
    vec4 weights_c = rest_c * to_c;
    vec4 weights_b = rest_b * (to_b - bc * weights_c);
    vec4 weights_a = inverse_own * (to_a - ab * weights_b - ac * weights_c);
    vec4 all = weights_a + weights_b + weights_c;
    vec3 sum = a.texels * weights_a + b.texels * weights_b + c.texels * weights_c;
    // It goes beyond none of the texels, so that nothing rings.
    vec3 least = least_of(c, least_of(b, least_of(a, vec3(3e38))));
    vec3 most = most_of(c, most_of(b, most_of(a, vec3(-3e38))));
    return clamp(sum / (all.x + all.y + all.z + all.w), least, most);
}

#endif
