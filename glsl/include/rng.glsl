// Counter-based random numbers: Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011).
// A value is a pure function of (pixel, frame, stream, seed): no state, no order, the same bits everywhere. Twin:
// src/chain/rng.rs. The logarithm and the circle are polynomials of `precise` sums and products, because those round
// alike on every device and on the CPU; log(), sin() and cos() need not.
#ifndef RNG_GLSL
#define RNG_GLSL

// One stream a purpose, stated by the effect that draws from it (STREAM_...). Fixed patterns belong to the sensor: they
// pass FIXED_FRAME instead of the frame, and the sensor's seed instead of the run's.
const uint FIXED_FRAME = 0xffffffffu;

uvec4 philox4x32_10(uvec4 counter, uvec2 key) {
    for (int i = 0; i < 10; ++i) {
        uvec2 high, low;
        umulExtended(uvec2(0xD2511F53u, 0xCD9E8D57u), counter.xz, high, low);
        counter = uvec4(high.y ^ counter.y ^ key.x, low.y, high.x ^ counter.w ^ key.y, low.x);
        key += uvec2(0x9E3779B9u, 0xBB67AE85u);
    }
    return counter;
}

// 128 random bits.
uvec4 random_bits(uvec2 pixel, uint frame, uint stream, uvec2 seed) {
    return philox4x32_10(uvec4(pixel, frame, stream), seed);
}

// -2 ln((bits + 1) / 2^32): 0 to 44.4. Mantissa folded to [sqrt 1/2, sqrt 2), then x - x^2/2 + x^3 p(x).
float minus_two_log(uint bits) {
    precise float u = float(bits) + 1.0;
    uint raw = floatBitsToUint(u);
    uint above = (raw & 0x7fffffu) > 0x3504f3u ? 1u : 0u;
    float exponent = float(int(raw >> 23u) - 127 + int(above));
    precise float x = uintBitsToFloat((raw & 0x7fffffu) | ((127u - above) << 23u)) - 1.0;
    precise float p = 0.06971612;
    p = p * x - 0.11479734;
    p = p * x + 0.1168542;
    p = p * x - 0.12425687;
    p = p * x + 0.14249058;
    p = p * x - 0.16667803;
    p = p * x + 0.20000716;
    p = p * x - 0.24999997;
    p = p * x + 0.3333333;
    precise float square = x * x;
    precise float log_mantissa = x - 0.5 * square + x * square * p;
    precise float log_u = (32.0 - exponent) * 0.69314718 - log_mantissa;
    return max(2.0 * log_u, 0.0);
}

// A point of the unit circle: two bits choose the quadrant, thirty the angle within (-pi/4, pi/4) of its middle.
vec2 unit_circle(uint bits) {
    precise float angle = (float(bits & 0x3fffffffu) * 9.3132257e-10 - 0.5) * 1.5707964;
    precise float square = angle * angle;
    precise float sine = angle * (1.0 + square * (-0.16666667 + square * (0.008333334
        + square * (-0.00019841270 + square * 2.7557319e-6))));
    precise float cosine = 1.0 + square * (-0.5 + square * (0.041666668 + square * (-0.0013888889
        + square * (2.4801587e-5 + square * -2.7557319e-7))));
    uint quadrant = bits >> 30u;
    vec2 even = (quadrant & 1u) == 0u ? vec2(cosine, sine) : vec2(-sine, cosine);
    return (quadrant & 2u) == 0u ? even : -even;
}

// Four independent normal numbers (Box-Muller; up to 6.66 sigma).
vec4 normal_of_bits(uvec4 bits) {
    precise vec2 first = sqrt(minus_two_log(bits.x)) * unit_circle(bits.y);
    precise vec2 second = sqrt(minus_two_log(bits.z)) * unit_circle(bits.w);
    return vec4(first, second);
}

vec4 random_normal(uvec2 pixel, uint frame, uint stream, uvec2 seed) {
    return normal_of_bits(random_bits(pixel, frame, stream, seed));
}

#endif
