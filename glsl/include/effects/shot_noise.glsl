// shot_noise: Poisson on electrons. Exact (inversion) where few are expected, an expansion of the inverse distribution
// where many are. Twin: src/effects/shot_noise.rs, with the source of the expansion.
#ifndef SHOT_NOISE_GLSL
#define SHOT_NOISE_GLSL

const uint STREAM_SHOT_NOISE = 0x5348u;
// Mean counts below this are inverted exactly.
const float SHOT_NOISE_FEW = 12.0;
const int SHOT_NOISE_MOST = 64;

// e^-x for 0 <= x <= 12, from sums and products only, so that it rounds alike everywhere.
float shot_noise_exp_minus(float x) {
    float k = floor(x * 1.442695 + 0.5);
    precise float r = (x - k * 0.693359375) + k * 2.1219444e-4;
    precise float p = 0.0013888889;
    p = 0.0083333333 - p * r;
    p = 0.041666667 - p * r;
    p = 0.16666667 - p * r;
    p = 0.5 - p * r;
    p = 1.0 - p * r;
    p = 1.0 - p * r;
    precise float scaled = p * uintBitsToFloat(uint(127 - int(k)) << 23u);
    return scaled;
}

// Smallest n whose distribution function reaches u.
float shot_noise_few(float mean, uint bits) {
    precise float u = (float(bits) + 0.5) * 2.3283064e-10;
    precise float p = shot_noise_exp_minus(mean);
    precise float reached = p;
    float n = 0.0;
    for (int i = 1; i <= SHOT_NOISE_MOST && u > reached; ++i) {
        p = p * mean / float(i);
        reached = reached + p;
        n = float(i);
    }
    return n;
}

float shot_noise_many(float mean, float w) {
    precise float root = sqrt(mean);
    precise float square = w * w;
    precise float q = mean + root * w + (0.33333334 + square * 0.16666667);
    q = q - w * (0.027777778 + square * 0.013888889) / root;
    q = q + (-0.019753087 + square * (0.0086419750 + square * 0.0037037037)) / mean;
    return max(floor(q), 0.0);
}

vec3 shot_noise(vec3 value, uvec2 pixel, uint slot) {
    float full_well_e = parameter(slot, 0u);
    precise vec3 mean = max(value, vec3(0.0)) * full_well_e;
    uvec4 bits = random_bits(pixel, push.frame, STREAM_SHOT_NOISE, push.seed);
    vec3 w = normal_of_bits(bits).xyz;
    vec3 electrons;
    for (int c = 0; c < 3; ++c) {
        bool few = mean[c] < SHOT_NOISE_FEW;
        // A mean of 0 ends the loop at once: nothing is searched where many are expected.
        float low = shot_noise_few(few ? mean[c] : 0.0, bits[c]);
        float high = shot_noise_many(few ? SHOT_NOISE_FEW : mean[c], w[c]);
        electrons[c] = few ? low : high;
    }
    precise vec3 seen = electrons * parameter(slot, 1u);
    return seen;
}

#endif
