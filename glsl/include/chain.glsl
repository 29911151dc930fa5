// What every kernel of the pixel chain sees. Twins: src/chain/pack.rs (parameters), src/engine/finish.rs (bindings).
#ifndef CHAIN_GLSL
#define CHAIN_GLSL

// The picture so far; alpha as the method wrote it.
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D source;
// The picture before this effect's first pass.
layout(set = 0, binding = 1, rgba32f) uniform readonly image2D original;
layout(set = 0, binding = 2, rgba32f) uniform writeonly image2D target;
// Sixteen rows an effect, from the row of its slot on: 64 words. A software device reads a word of these once for all
// of its lanes where the place is known when the kernel is made.
layout(set = 0, binding = 3, std140) uniform Parameters {
    uvec4 parameter_rows[1024];
};
// What does not fit: lines, weights, bit masks, rows of four numbers. Parameters hold the place of the first word, or
// row. Texels, because a software device fetches a texel for all lanes at once, and a word of a storage buffer lane by
// lane.
layout(set = 0, binding = 4) uniform usamplerBuffer tables;

// A kernel that does more than the chain has a block of its own with these members.
#ifndef CHAIN_PUSH
layout(push_constant) uniform Push {
    uvec2 size;
    uvec2 seed;
    uint frame;
    uint flags;
    uint slot;
} push;
#endif

const uint SLOT_ROWS = 16u;

// Parameter `index` (0 to 63) of a slot, as bits and as a number.
uint parameter_bits(uint slot, uint index) {
    return parameter_rows[SLOT_ROWS * slot + (index >> 2u)][index & 3u];
}
float parameter(uint slot, uint index) {
    return uintBitsToFloat(parameter_bits(slot, index));
}

uint table_bits(uint place) {
    return texelFetch(tables, int(place >> 2u))[place & 3u];
}
float table(uint place) {
    return uintBitsToFloat(table_bits(place));
}
vec4 table_row(uint row) {
    return uintBitsToFloat(texelFetch(tables, int(row)));
}

// The picture's border repeats outwards.
vec4 source_at(ivec2 pixel) {
    return imageLoad(source, clamp(pixel, ivec2(0), ivec2(push.size) - 1));
}

#endif
