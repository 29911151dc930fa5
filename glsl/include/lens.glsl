// The lens as a map of the picture: where it puts what an ideal pinhole would put at a point, and back. Twin in double
// precision: src/camera/distortion/extended.rs, which also says how the mapping goes on beyond the rays that are
// needed.
#ifndef LENS_GLSL
#define LENS_GLSL

// Kernels that are compiled for a picture without a lens set this to a constant: a software device runs both sides of a
// branch on a push constant (without it, exact_paths takes 1.8 times as long).
#ifndef LENS_POSSIBLE
#define LENS_POSSIBLE true
#endif

// The values of LensPush::model.
const uint LENS_NONE = 0u;
const uint LENS_BROWN_CONRADY = 1u;
const uint LENS_EQUIDISTANT = 2u;
const uint LENS_RATIONAL = 3u;
const uint LENS_DIVISION = 4u;

struct Lens {
    // Normalised device coordinates: centre + scale * normalised coordinates (x / z, y / z).
    vec2 scale;
    vec2 centre;
    vec2 k12;
    // k3, k4.
    vec2 k34;
    vec2 k56;
    vec2 p;
    // Ideal radius up to which the model holds, and the slope beyond.
    float radius;
    float slope;
    // Of the colour that is drawn: lateral chromatic aberration.
    float magnification;
    uint model;
};

vec2 lens_distort(Lens lens, vec2 ideal) {
    float s = dot(ideal, ideal);
    if (lens.model == LENS_DIVISION) {
        return ideal * (2.0 / (1.0 + sqrt(max(1.0 - 4.0 * lens.k12.x * s, 0.0))));
    }
    if (lens.model != LENS_EQUIDISTANT) {
        float radial = 1.0 + s * (lens.k12.x + s * (lens.k12.y + s * lens.k34.x));
        if (lens.model == LENS_RATIONAL) {
            radial /= 1.0 + s * (lens.k34.y + s * (lens.k56.x + s * lens.k56.y));
        }
        float xy = 2.0 * ideal.x * ideal.y;
        vec2 along = s + 2.0 * ideal * ideal;
        return ideal * radial + vec2(lens.p.x * xy + lens.p.y * along.x, lens.p.x * along.y + lens.p.y * xy);
    }
    float r = sqrt(s);
    if (r < 1e-3) {
        return ideal * (1.0 + s * (lens.k12.x - 1.0 / 3.0));
    }
    float theta = atan(r);
    float t = theta * theta;
    return ideal *
           (theta * (1.0 + t * (lens.k12.x + t * (lens.k12.y + t * (lens.k34.x + t * lens.k34.y)))) / r);
}

// Clip space of the ideal picture to that of the sensor. Beyond the radius, and behind the camera, the mapping goes on
// linearly, so nothing that lies there is folded back into the picture.
vec4 lens_sensor(Lens lens, vec4 ideal) {
    if (LENS_POSSIBLE ? lens.model == LENS_NONE : true) {
        return ideal;
    }
    // Normalised coordinates times w.
    vec2 at = (ideal.xy - lens.centre * ideal.w) / lens.scale;
    float r = length(at);
    vec2 seen;
    if (r <= lens.radius * ideal.w) {
        seen = ideal.w > 0.0 ? lens_distort(lens, at / ideal.w) * ideal.w : at;
    } else {
        vec2 edge = at * (lens.radius / r);
        seen = (lens_distort(lens, edge) - lens.slope * edge) * ideal.w + lens.slope * at;
    }
    return vec4(lens.centre * ideal.w + lens.scale * lens.magnification * seen, ideal.zw);
}

// The ideal point (normalised device coordinates) of one on the sensor, by Newton's method.
vec2 lens_ideal(Lens lens, vec2 sensor) {
    if (LENS_POSSIBLE ? lens.model == LENS_NONE : true) {
        return sensor;
    }
    const int STEPS = 6;
    const float STEP = 1e-3;
    vec2 seen = (sensor - lens.centre) / (lens.scale * lens.magnification);
    vec2 at = seen;
    if (lens.model == LENS_EQUIDISTANT) {
        float theta = length(seen);
        at = theta > 1e-6 ? seen * (tan(min(theta, 1.5)) / theta) : seen;
    } else if (lens.model == LENS_DIVISION) {
        at = seen / max(1.0 + lens.k12.x * dot(seen, seen), 1e-3);
    }
    for (int i = 0; i < STEPS; ++i) {
        at *= min(1.0, 0.999 * lens.radius / max(length(at), 1e-9));
        float h = STEP * (1.0 + length(at));
        vec2 dx = (lens_distort(lens, at + vec2(h, 0.0)) - lens_distort(lens, at - vec2(h, 0.0))) / (2.0 * h);
        vec2 dy = (lens_distort(lens, at + vec2(0.0, h)) - lens_distort(lens, at - vec2(0.0, h))) / (2.0 * h);
        at += inverse(mat2(dx, dy)) * (seen - lens_distort(lens, at));
    }
    float r = length(at);
    if (r > lens.radius) {
        // Where the mapping is linear.
        vec2 edge = at * (lens.radius / r);
        at = edge * (1.0 + max(length(seen - lens_distort(lens, edge)), 0.0) / (lens.slope * lens.radius));
    }
    return lens.centre + lens.scale * at;
}

#endif
