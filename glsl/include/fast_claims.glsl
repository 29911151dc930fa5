// Reading the claims that fast_seeds made, and the list of pixels that see several surfaces. Twin:
// src/reference/fast_claims.rs. Needs fast_push.
#ifndef FAST_CLAIMS_GLSL
#define FAST_CLAIMS_GLSL

// Claims of one slot at a pixel and its four diagonal neighbours.
struct SlotClaims {
    uint nearest;
    uint farthest;
    // Whether all of them can be of one surface.
    bool agree;
};

// Neighbours of more different depth, and different motion, are two surfaces: a quarter of an octave.
const uint ONE_SURFACE_KEYS = 32u;
const uint NO_CLAIM = 0xffffffffu;
const ivec2 NEIGHBOURS[5] = ivec2[5](ivec2(0), ivec2(-1), ivec2(1, -1), ivec2(-1, 1), ivec2(1));

// All that is claimed at a pixel and its four diagonal neighbours.
struct Claims {
    uvec4 at[5];
};

Claims claims_around(ivec2 pixel) {
    Claims around;
    for (int i = 0; i < 5; ++i) {
        ivec2 at = clamp(pixel + NEIGHBOURS[i], ivec2(0), ivec2(push.size) - 1);
        uint index = seed_index(0u, at) / 4u;
        if (CLAIMS_ARE_TEXELS == 1u) {
            around.at[i] = texelFetch(claims, int(index));
        } else {
            around.at[i] = claim_words[index];
        }
    }
    return around;
}

SlotClaims slot_claims(uint slot, Claims around) {
    SlotClaims c = SlotClaims(0u, NO_CLAIM, false);
    ivec2 low = ivec2(1 << 20);
    ivec2 high = -low;
    int count = 0;
    for (int i = 0; i < 5; ++i) {
        uint key = slot == 0u ? around.at[i].x : (slot == 1u ? around.at[i].y : around.at[i].z);
        // A gap is no objection: where the picture stretches, some pixels are nobody's.
        if (key != 0u) {
            c.nearest = max(c.nearest, key);
            c.farthest = min(c.farthest, key);
            low = min(low, seed_offset(key));
            high = max(high, seed_offset(key));
            ++count;
        }
    }
    // Neighbours on one surface differ by rounding, or because it slants or turns; a step in depth with it is an edge.
    ivec2 spread = high - low;
    bool one_depth = (c.nearest >> 20u) - (c.farthest >> 20u) <= ONE_SURFACE_KEYS;
    c.agree = count >= 3 && all(lessThanEqual(spread, ivec2(1))) && (one_depth || all(equal(spread, ivec2(0))));
    return c;
}

#endif
