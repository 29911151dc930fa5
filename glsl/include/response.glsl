// A monotone curve per channel on linear values, as a table, both ways. Twin: src/effects/response.rs. Needs chain.glsl.
#ifndef RESPONSE_GLSL
#define RESPONSE_GLSL

const uint RESPONSE_PIECES = 64u;

float response_begin(uint j) {
    precise float root = float(j) / float(RESPONSE_PIECES);
    precise float begin = root * root;
    return begin;
}

// `first`: place of the channel's first value.
float response_to_sensor(float delivered, uint first) {
    float root = delivered > 0.0 ? sqrt(delivered) : 0.0;
    uint j = min(uint(min(root, 2.0) * float(RESPONSE_PIECES)), RESPONSE_PIECES - 1u);
    float low = table(first + j);
    float high = table(first + j + 1u);
    precise float slope = (high - low) / (response_begin(j + 1u) - response_begin(j));
    precise float value = low + (delivered - response_begin(j)) * slope;
    return value;
}

float response_from_sensor(float sensor, uint first) {
    uint j = 0u;
    for (uint next = RESPONSE_PIECES / 2u; next > 0u; next /= 2u) {
        j += table(first + j + next) <= sensor ? next : 0u;
    }
    float low = table(first + j);
    float high = table(first + j + 1u);
    float begin = response_begin(j);
    precise float slope = (response_begin(j + 1u) - begin) / (high - low);
    precise float value = begin + (sensor - low) * slope;
    return value;
}

#endif
