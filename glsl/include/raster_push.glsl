#include "lens.glsl"
layout(push_constant) uniform Push {
    // Row of `instants`, and its length.
    uint instant;
    uint object_count;
    // px of motion per unit of clip space: half the picture's size (in delivered px) over the span, per frame interval.
    vec2 motion_scale_px;
    Lens lens;
} push;
