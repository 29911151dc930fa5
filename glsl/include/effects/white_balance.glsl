// white_balance: gains of red and blue. Twin: src/effects/white_balance.rs.
#ifndef WHITE_BALANCE_GLSL
#define WHITE_BALANCE_GLSL

vec3 white_balance(vec3 value, uvec2 pixel, uint slot) {
    precise vec3 seen = value * vec3(parameter(slot, 0u), 1.0, parameter(slot, 1u));
    return seen;
}

#endif
