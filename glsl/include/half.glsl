// The nearest half float, to even: what stores to half floats does with it is left to the device, and lavapipe rounds
// towards zero, so that all light came out 0.035 % too dark, and again by as much with each further store.
vec3 nearest_half(vec3 value) {
    uvec3 bits = floatBitsToUint(value);
    return uintBitsToFloat((bits + 0xfffu + ((bits >> 13) & 1u)) & 0xffffe000u);
}
