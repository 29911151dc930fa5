#version 460
// What the device can read between texels at best: taps along a path and nothing else, four a round.
layout(local_size_x = 64, local_size_y = 1) in;
layout(set = 0, binding = 0) uniform sampler2D color;
layout(set = 0, binding = 1, std430) writeonly buffer Pixels {
    uint pixels[];
};
layout(push_constant) uniform Push {
    uvec2 size;
    uint taps;
} push;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    vec2 at = vec2(pixel) + 0.75;
    vec2 along = vec2(1.9, 0.3);
    vec3 sum = vec3(0.0);
    for (uint i = 0; i < push.taps; i += 4) {
        sum += textureLod(color, at, 0.0).rgb;
        sum += textureLod(color, at + along, 0.0).rgb;
        sum += textureLod(color, at + 2.0 * along, 0.0).rgb;
        sum += textureLod(color, at + 3.0 * along, 0.0).rgb;
        at += 4.0 * along;
    }
    pixels[pixel.y * push.size.x + pixel.x] = packUnorm4x8(vec4(sum / float(push.taps), 1.0));
}
