// Parameters of fast_seeds and fast_gather. Times are relative to the reference instant, at which the picture was
// rendered.
layout(push_constant) uniform Push {
    uvec2 size;
    ivec2 margin_px;
    float start_s;
    float readout_time_s;
    float exposure_time_s;
    float knot_step_s;
    uint reference_knot;
    uint last_knot;
    uint scan_order;
    uint max_samples;
    uint slots;
    // One of several pictures of a frame: when it was rendered, and those before and after it.
    float picture_s;
    float from_s;
    float to_s;
    // The first pixel that fast_gather looks at: a software device runs through pixels that leave at once.
    uvec2 first;
} push;

// Claims, four words a destination pixel: one for each slot (a moment of the exposure: its middle; or begin, middle and
// end), the nearest surface that lands there. 0: none does.
#ifdef MAKES_CLAIMS
layout(set = 0, binding = 0, std430) buffer Seeds {
    uint seeds[];
};
#else
// A software device fetches a texel for all lanes at once, and words of a storage buffer lane by lane; but a texel
// buffer holds no more texels than the device says, and then the words are read.
layout(constant_id = 6) const uint CLAIMS_ARE_TEXELS = 1u;
layout(set = 0, binding = 0) uniform usamplerBuffer claims;
layout(set = 0, binding = 8, std430) readonly buffer ClaimWords {
    uvec4 claim_words[];
};
#endif

const int SEED_REACH_PX = 511;

// Nearer surfaces have greater keys; beside depth the key holds where the source lies. Depth is the float's own
// logarithm: 128 steps an octave from 2^-24 on.
uint seed_key(float inverse_depth, ivec2 source_minus_destination) {
    int depth = clamp((floatBitsToInt(inverse_depth) - 0x33800000) >> 16, 0, 4095);
    uvec2 offset = uvec2(source_minus_destination + 512);
    return (uint(depth) << 20u) | (offset.x << 10u) | offset.y;
}

ivec2 seed_offset(uint key) {
    return ivec2((key >> 10u) & 1023u, key & 1023u) - 512;
}

uint seed_index(uint slot, ivec2 pixel) {
    return 4u * (uint(pixel.y) * push.size.x + uint(pixel.x)) + slot;
}

// Place in the exposure, 0..1.
float slot_fraction(uint slot) {
    return push.slots == 1u ? 0.5 : 0.5 * float(slot);
}
