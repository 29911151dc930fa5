// Paths of surface points: where what a texel of the reference picture shows stands at other instants of the frame.
// Twin: src/reference/path.rs. The kernel declares samplers `path_0`, `path_1`, `path_2`, each with the displacements
// (px, from the reference instant) to two knots, in order of time and without the reference instant's own, which is
// zero; and `inverse_depth` of their size. FROM_DEPTH: all that is seen moves rigidly, and the displacements follow
// from its depth.
#ifndef PATH_GLSL
#define PATH_GLSL

// Images that hold knots; texels of the path images a px.
layout(constant_id = 0) const int PATH_IMAGES = 3;
layout(constant_id = 1) const int PATH_SCALE = 1;

// Behind a function, because the build's reflection does not evaluate comparisons of constants.
int path_images() { return PATH_IMAGES; }
int path_scale() { return PATH_SCALE; }

layout(constant_id = 5) const uint FROM_DEPTH = 0u;
bool from_depth() { return FROM_DEPTH != 0u; }

// Texels of the path images and of the depth, margin included.
ivec2 path_texels() { return (ivec2(push.size) + 2 * push.margin_px) * PATH_SCALE; }

// A texel of them. It is not fetched but sampled (nearest), because lavapipe 22.3 looks up the level of each lane for a
// fetch.
vec4 texel_of(sampler2D image, ivec2 texel) {
    return textureLod(image, (vec2(texel) + 0.5) / vec2(path_texels()), 0.0);
}

// FROM_DEPTH: whether several bodies are seen: the second channel of `inverse_depth` says which.
layout(constant_id = 7) const uint BODIES = 0u;
bool bodies() { return BODIES != 0u; }

// FROM_DEPTH: rows x, y and w of the matrices that take (ndc, near distance over distance, 1) at the reference instant
// to clip space at knots 0 to last_knot; BODIES: those of one body after the other. Texels of a buffer: a software
// device fetches one for all lanes at once.
layout(set = 0, binding = 10) uniform usamplerBuffer moved;

vec4 moved_row(int row) { return uintBitsToFloat(texelFetch(moved, row)); }

// Rows of a matrix.
struct Moved {
    vec4 x;
    vec4 y;
    vec4 w;
};

// The matrix of a body at place `at` of the time axis: knots lie so close that what is between two is linear.
Moved moved_at(int body, float at) {
    float last = float(push.last_knot);
    float before = clamp(floor(at), 0.0, last - 1.0);
    precise float share = clamp(at - before, 0.0, 1.0);
    int row = 3 * (body * (int(push.last_knot) + 1) + int(before));
    vec4 x = moved_row(row);
    vec4 y = moved_row(row + 1);
    vec4 w = moved_row(row + 2);
    precise vec4 x_at = x + share * (moved_row(row + 3) - x);
    precise vec4 y_at = y + share * (moved_row(row + 4) - y);
    precise vec4 w_at = w + share * (moved_row(row + 5) - w);
    return Moved(x_at, y_at, w_at);
}

// Shares of the knots in the displacement at one instant: one vec2 a path image. FROM_DEPTH: the instant, and its
// matrix where there is but one body.
struct PathWeights {
    vec2 image_0;
    vec2 image_1;
    vec2 image_2;
    float at;
    Moved moved;
};

// What is seen so near to the picture's plane at another instant, or behind it, moves as if it were so near.
const float LEAST_W = 0.02;

// Displacement by a matrix of what a texel shows at that depth, px.
vec2 displacement_by(ivec2 texel, float depth, Moved m) {
    vec2 size = vec2(path_texels());
    precise vec2 ndc = (vec2(texel) + 0.5) / size * 2.0 - 1.0;
    precise float sx = m.x.x * ndc.x + m.x.y * ndc.y + m.x.z * depth + m.x.w;
    precise float sy = m.y.x * ndc.x + m.y.y * ndc.y + m.y.z * depth + m.y.w;
    precise float sw = max(m.w.x * ndc.x + m.w.y * ndc.y + m.w.z * depth + m.w.w, LEAST_W);
    precise vec2 moved_px = (vec2(sx, sy) / sw - ndc) * (0.5 / float(PATH_SCALE)) * size;
    return moved_px;
}

// FROM_DEPTH: displacement of what one texel shows at place `at` of the time axis, px; `seen`: its depth and body.
vec2 depth_displacement(ivec2 texel, vec2 seen, float at) {
    return displacement_by(texel, seen.x, moved_at(bodies() ? int(seen.y) : 0, at));
}

// The same, and its change a knot: between two knots displacements, not matrices, are taken for linear, which is near
// enough to start a search. `seen`: depth and body.
void depth_motion(ivec2 texel, vec2 seen, float at, out vec2 moved_px, out vec2 rate_px) {
    float last = float(push.last_knot);
    float before = clamp(floor(at), 0.0, last - 1.0);
    precise float share = clamp(at - before, 0.0, 1.0);
    int body = bodies() ? int(seen.y) : 0;
    int row = 3 * (body * (int(push.last_knot) + 1) + int(before));
    vec2 from_px = displacement_by(texel, seen.x, Moved(moved_row(row), moved_row(row + 1), moved_row(row + 2)));
    vec2 to_px = displacement_by(texel, seen.x, Moved(moved_row(row + 3), moved_row(row + 4), moved_row(row + 5)));
    precise vec2 rate = to_px - from_px;
    precise vec2 there = from_px + share * rate;
    moved_px = there;
    rate_px = rate;
}

// Displacement of what one texel shows to knot `layer`, px. Not with FROM_DEPTH.
vec2 knot_displacement(ivec2 texel, int layer) {
    vec4 pair = layer < 2 ? texel_of(path_0, texel)
                          : (layer < 4 ? texel_of(path_1, texel) : texel_of(path_2, texel));
    return (layer & 1) == 0 ? pair.xy : pair.zw;
}

// Weight of the point `offset` knots away (-1, 0, 1) in the parabola through three, at `at` knots from its middle.
float parabola_weight(float at, float offset) {
    precise float side = 0.5 * at * (at + offset);
    precise float middle = 1.0 - at * at;
    return offset == 0.0 ? middle : (abs(offset) == 1.0 ? side : 0.0);
}

// Weight of `knot` at place `at` of the time axis with knots 0..last: between two knots the parabolas through either
// and its neighbours are blended (a cubic with continuous slope, Catmull-Rom); constant acceleration is met exactly. At
// a knot: 1 for itself, 0 for all others, to the bit.
float knot_weight(float at, float knot, float last) {
    if (last < 2.0) {
        precise float linear = 1.0 - abs(at - knot);
        return linear;
    }
    float before = clamp(floor(at), 0.0, last - 1.0);
    precise float f = at - before;
    float left = clamp(before, 1.0, last - 1.0);
    float right = clamp(before + 1.0, 1.0, last - 1.0);
    precise float weight =
        (1.0 - f) * parabola_weight(at - left, knot - left) + f * parabola_weight(at - right, knot - right);
    return weight;
}

// Weight of place `layer` in the path images.
float layer_weight(float at, int layer, int reference_knot, int last_knot) {
    int knot = layer < reference_knot ? layer : layer + 1;
    return knot <= last_knot ? knot_weight(at, float(knot), float(last_knot)) : 0.0;
}

PathWeights path_weights(float at, int reference_knot, int last_knot) {
    PathWeights w = PathWeights(vec2(0.0), vec2(0.0), vec2(0.0), at, Moved(vec4(0.0), vec4(0.0), vec4(0.0)));
    if (from_depth()) {
        if (!bodies()) {
            w.moved = moved_at(0, at);
        }
        return w;
    }
    w.image_0 = vec2(layer_weight(at, 0, reference_knot, last_knot), layer_weight(at, 1, reference_knot, last_knot));
    if (path_images() > 1) {
        w.image_1 =
            vec2(layer_weight(at, 2, reference_knot, last_knot), layer_weight(at, 3, reference_knot, last_knot));
    }
    if (path_images() > 2) {
        w.image_2 =
            vec2(layer_weight(at, 4, reference_knot, last_knot), layer_weight(at, 5, reference_knot, last_knot));
    }
    return w;
}

// Displacement of what one texel of the path images shows, px.
vec2 texel_displacement(ivec2 texel, PathWeights w) {
    if (from_depth()) {
        vec2 seen = texel_of(inverse_depth, texel).rg;
        return bodies() ? depth_displacement(texel, seen, w.at) : displacement_by(texel, seen.x, w.moved);
    }
    vec4 knots = texel_of(path_0, texel);
    precise vec2 sum = w.image_0.x * knots.xy + w.image_0.y * knots.zw;
    if (path_images() > 1) {
        knots = texel_of(path_1, texel);
        sum = sum + (w.image_1.x * knots.xy + w.image_1.y * knots.zw);
    }
    if (path_images() > 2) {
        knots = texel_of(path_2, texel);
        sum = sum + (w.image_2.x * knots.xy + w.image_2.y * knots.zw);
    }
    return sum;
}

// The texel of the path images that holds a position, px.
ivec2 path_texel(vec2 position_px) {
    ivec2 last = path_texels() - 1;
    vec2 inside = clamp(floor(position_px * float(PATH_SCALE)), vec2(0.0), vec2(last));
    return clamp(ivec2(inside), ivec2(0), last);
}

vec2 nearest_displacement(vec2 position_px, PathWeights w) {
    return texel_displacement(path_texel(position_px), w);
}

float squared(vec2 v) {
    precise float square = v.x * v.x + v.y * v.y;
    return square;
}

// Displacements of neighbouring texels further apart than this, px, belong to different surfaces.
const float ONE_SURFACE_PX = 0.4;

// Displacements of a block of 2x2 texels: where the block's first texel has its centre, px, the displacement there, and
// its change from texel to texel along x and y. Both differences are means of the block's two.
struct PathBlock {
    vec2 centre_px;
    vec2 at_centre_px;
    vec2 along_x_px;
    vec2 along_y_px;
    bool one_surface;
};

// The block around a position, read once for any number of instants.
ivec2 path_block(vec2 position_px) {
    ivec2 last = max(path_texels() - 2, ivec2(0));
    precise vec2 wanted = position_px * float(PATH_SCALE) - 0.5;
    return clamp(ivec2(floor(clamp(wanted, vec2(0.0), vec2(last)))), ivec2(0), last);
}

PathBlock block_displacement(ivec2 block, PathWeights w) {
    ivec2 far = min(block + 1, path_texels() - 1);
    precise vec2 a = texel_displacement(block, w);
    precise vec2 b = texel_displacement(ivec2(far.x, block.y), w);
    precise vec2 c = texel_displacement(ivec2(block.x, far.y), w);
    precise vec2 d = texel_displacement(far, w);
    vec2 spread = max(max(a, b), max(c, d)) - min(min(a, b), min(c, d));
    PathBlock m;
    precise vec2 centre = (vec2(block) + 1.0) / float(PATH_SCALE);
    precise vec2 mean = 0.25 * (a + b + (c + d));
    precise vec2 along_x = 0.5 * float(PATH_SCALE) * (b - a + (d - c));
    precise vec2 along_y = 0.5 * float(PATH_SCALE) * (c - a + (d - b));
    m.centre_px = centre;
    m.at_centre_px = mean;
    m.along_x_px = along_x;
    m.along_y_px = along_y;
    m.one_surface = max(spread.x, spread.y) <= ONE_SURFACE_PX;
    return m;
}

// The place p in the reference picture of what stands at `x_px`: p + displacement(p) = x, solved for a displacement
// that is linear around the block (a Newton step). The error is the displacement's curvature over half the squared
// distance from the block.
vec2 block_source(PathBlock m, vec2 x_px) {
    precise vec2 rest = x_px - m.centre_px - m.at_centre_px;
    precise float xx = 1.0 + m.along_x_px.x;
    precise float yy = 1.0 + m.along_y_px.y;
    precise float determinant = xx * yy - m.along_y_px.x * m.along_x_px.y;
    precise vec2 moved = vec2(yy * rest.x - m.along_y_px.x * rest.y, xx * rest.y - m.along_x_px.y * rest.x);
    precise vec2 p = m.centre_px + moved / determinant;
    return p;
}

#endif
