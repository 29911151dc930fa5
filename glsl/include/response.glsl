// A monotone curve per channel on encoded values, as a table, both ways. Twin: src/effects/response.rs. Needs chain.glsl.
#ifndef RESPONSE_GLSL
#define RESPONSE_GLSL

const uint RESPONSE_PIECES = 64u;

// `first`: place of the channel's first value.
float response_to_sensor(float delivered, uint first) {
    precise float place = delivered * float(RESPONSE_PIECES);
    uint j = min(uint(max(place, 0.0)), RESPONSE_PIECES - 1u);
    float low = table(first + j);
    precise float value = low + (place - float(j)) * (table(first + j + 1u) - low);
    return value;
}

float response_from_sensor(float sensor, uint first) {
    uint j = 0u;
    for (uint next = RESPONSE_PIECES / 2u; next > 0u; next /= 2u) {
        j += table(first + j + next) <= sensor ? next : 0u;
    }
    float low = table(first + j);
    precise float share = (sensor - low) / (table(first + j + 1u) - low);
    precise float value = (float(j) + share) / float(RESPONSE_PIECES);
    return value;
}

#endif
