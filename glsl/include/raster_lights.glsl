// The scene's lights. Up to FIXED_LIGHTS of them are specialization constants, so that a loop over them is unrolled
// into arithmetic on numbers that the compiler knows; what is beyond is read from a uniform buffer (reading a storage
// buffer in the loop costs lavapipe a fifth more).
struct Light {
    // Relative to the world's origin; w unused.
    vec4 position_m;
    vec4 color;
    // Constant, linear, quadratic.
    vec4 attenuation;
};
const uint MAX_LIGHTS = 64;
// LIGHTS_IN_STORAGE: all of them by the loop, from a storage buffer; a bench measures against it.
#ifdef LIGHTS_IN_STORAGE
layout(set = 0, binding = 2, std430) readonly buffer Lights {
    Light lights[];
};
const uint FIXED_LIGHTS = 0;
#else
layout(set = 0, binding = 2, std140) uniform Lights {
    Light lights[MAX_LIGHTS];
};
const uint FIXED_LIGHTS = 8;
#endif

layout(constant_id = 2) const uint LIGHT_COUNT = 0;
layout(constant_id = 16) const float L0PX = 0.0;
layout(constant_id = 17) const float L0PY = 0.0;
layout(constant_id = 18) const float L0PZ = 0.0;
layout(constant_id = 19) const float L0CR = 0.0;
layout(constant_id = 20) const float L0CG = 0.0;
layout(constant_id = 21) const float L0CB = 0.0;
layout(constant_id = 22) const float L0A0 = 0.0;
layout(constant_id = 23) const float L0A1 = 0.0;
layout(constant_id = 24) const float L0A2 = 0.0;
layout(constant_id = 25) const float L1PX = 0.0;
layout(constant_id = 26) const float L1PY = 0.0;
layout(constant_id = 27) const float L1PZ = 0.0;
layout(constant_id = 28) const float L1CR = 0.0;
layout(constant_id = 29) const float L1CG = 0.0;
layout(constant_id = 30) const float L1CB = 0.0;
layout(constant_id = 31) const float L1A0 = 0.0;
layout(constant_id = 32) const float L1A1 = 0.0;
layout(constant_id = 33) const float L1A2 = 0.0;
layout(constant_id = 34) const float L2PX = 0.0;
layout(constant_id = 35) const float L2PY = 0.0;
layout(constant_id = 36) const float L2PZ = 0.0;
layout(constant_id = 37) const float L2CR = 0.0;
layout(constant_id = 38) const float L2CG = 0.0;
layout(constant_id = 39) const float L2CB = 0.0;
layout(constant_id = 40) const float L2A0 = 0.0;
layout(constant_id = 41) const float L2A1 = 0.0;
layout(constant_id = 42) const float L2A2 = 0.0;
layout(constant_id = 43) const float L3PX = 0.0;
layout(constant_id = 44) const float L3PY = 0.0;
layout(constant_id = 45) const float L3PZ = 0.0;
layout(constant_id = 46) const float L3CR = 0.0;
layout(constant_id = 47) const float L3CG = 0.0;
layout(constant_id = 48) const float L3CB = 0.0;
layout(constant_id = 49) const float L3A0 = 0.0;
layout(constant_id = 50) const float L3A1 = 0.0;
layout(constant_id = 51) const float L3A2 = 0.0;
layout(constant_id = 52) const float L4PX = 0.0;
layout(constant_id = 53) const float L4PY = 0.0;
layout(constant_id = 54) const float L4PZ = 0.0;
layout(constant_id = 55) const float L4CR = 0.0;
layout(constant_id = 56) const float L4CG = 0.0;
layout(constant_id = 57) const float L4CB = 0.0;
layout(constant_id = 58) const float L4A0 = 0.0;
layout(constant_id = 59) const float L4A1 = 0.0;
layout(constant_id = 60) const float L4A2 = 0.0;
layout(constant_id = 61) const float L5PX = 0.0;
layout(constant_id = 62) const float L5PY = 0.0;
layout(constant_id = 63) const float L5PZ = 0.0;
layout(constant_id = 64) const float L5CR = 0.0;
layout(constant_id = 65) const float L5CG = 0.0;
layout(constant_id = 66) const float L5CB = 0.0;
layout(constant_id = 67) const float L5A0 = 0.0;
layout(constant_id = 68) const float L5A1 = 0.0;
layout(constant_id = 69) const float L5A2 = 0.0;
layout(constant_id = 70) const float L6PX = 0.0;
layout(constant_id = 71) const float L6PY = 0.0;
layout(constant_id = 72) const float L6PZ = 0.0;
layout(constant_id = 73) const float L6CR = 0.0;
layout(constant_id = 74) const float L6CG = 0.0;
layout(constant_id = 75) const float L6CB = 0.0;
layout(constant_id = 76) const float L6A0 = 0.0;
layout(constant_id = 77) const float L6A1 = 0.0;
layout(constant_id = 78) const float L6A2 = 0.0;
layout(constant_id = 79) const float L7PX = 0.0;
layout(constant_id = 80) const float L7PY = 0.0;
layout(constant_id = 81) const float L7PZ = 0.0;
layout(constant_id = 82) const float L7CR = 0.0;
layout(constant_id = 83) const float L7CG = 0.0;
layout(constant_id = 84) const float L7CB = 0.0;
layout(constant_id = 85) const float L7A0 = 0.0;
layout(constant_id = 86) const float L7A1 = 0.0;
layout(constant_id = 87) const float L7A2 = 0.0;
vec3 fixed_position_m(uint i) {
    switch (i) {
    case 0: return vec3(L0PX, L0PY, L0PZ);
    case 1: return vec3(L1PX, L1PY, L1PZ);
    case 2: return vec3(L2PX, L2PY, L2PZ);
    case 3: return vec3(L3PX, L3PY, L3PZ);
    case 4: return vec3(L4PX, L4PY, L4PZ);
    case 5: return vec3(L5PX, L5PY, L5PZ);
    case 6: return vec3(L6PX, L6PY, L6PZ);
    default: return vec3(L7PX, L7PY, L7PZ);
    }
}
vec3 fixed_color(uint i) {
    switch (i) {
    case 0: return vec3(L0CR, L0CG, L0CB);
    case 1: return vec3(L1CR, L1CG, L1CB);
    case 2: return vec3(L2CR, L2CG, L2CB);
    case 3: return vec3(L3CR, L3CG, L3CB);
    case 4: return vec3(L4CR, L4CG, L4CB);
    case 5: return vec3(L5CR, L5CG, L5CB);
    case 6: return vec3(L6CR, L6CG, L6CB);
    default: return vec3(L7CR, L7CG, L7CB);
    }
}
vec3 fixed_attenuation(uint i) {
    switch (i) {
    case 0: return vec3(L0A0, L0A1, L0A2);
    case 1: return vec3(L1A0, L1A1, L1A2);
    case 2: return vec3(L2A0, L2A1, L2A2);
    case 3: return vec3(L3A0, L3A1, L3A2);
    case 4: return vec3(L4A0, L4A1, L4A2);
    case 5: return vec3(L5A0, L5A1, L5A2);
    case 6: return vec3(L6A0, L6A1, L6A2);
    default: return vec3(L7A0, L7A1, L7A2);
    }
}
