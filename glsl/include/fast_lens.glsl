// A lens that the picture was rendered without: it acts where a pixel looks, before anything else is asked. Twin:
// src/reference/fast_push.rs. Needs fast_push.
#ifndef FAST_LENS_GLSL
#define FAST_LENS_GLSL

// Whether there is one. Else nothing is read here.
layout(constant_id = 8) const uint LENS = 0u;
bool through_lens() { return LENS != 0u; }

// By pixel of the result: where a pinhole's picture shows what it sees, px, margin included.
layout(set = 0, binding = 11) uniform sampler2D ideal;
// By pixel of the picture, margin included: where the lens shows what is there, px of the result; far outside: nowhere.
layout(set = 0, binding = 12) uniform sampler2D sensed;

// Where a pixel of the result looks, px, margin included.
vec2 looks_at(ivec2 pixel) {
    precise vec2 own = vec2(pixel) + 0.5 + vec2(push.margin_px);
    return through_lens() ? textureLod(ideal, (vec2(pixel) + 0.5) / vec2(push.size), 0.0).rg : own;
}

// Where the lens shows a place of the pinhole's picture, both px of the result. Within a pixel the lens only shifts:
// claims need no more.
vec2 on_sensor(vec2 position_px) {
    if (!through_lens()) {
        return position_px;
    }
    ivec2 full = ivec2(push.size) + 2 * push.margin_px;
    precise vec2 place = position_px + vec2(push.margin_px);
    ivec2 texel = clamp(ivec2(floor(clamp(place, vec2(0.0), vec2(full)))), ivec2(0), full - 1);
    vec2 there = textureLod(sensed, (vec2(texel) + 0.5) / vec2(full), 0.0).rg;
    precise vec2 shown = there + (place - (vec2(texel) + 0.5));
    return shown;
}

#endif
