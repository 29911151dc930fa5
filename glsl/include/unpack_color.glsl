// A caller's colour picture to linear RGBA. Twin: src/reference/unpack.rs.
layout(local_size_x = 16, local_size_y = 8) in;

// Linear radiance; alpha 1 where the source has none.
#ifdef HALF
#include "half.glsl"
#define COLOR_FORMAT rgba16f
#else
#define COLOR_FORMAT rgba32f
#endif
layout(set = 0, binding = 1, COLOR_FORMAT) uniform writeonly image2D color;
// Radiance of the 256 sRGB codes, then of the 256 linear ones, four a texel: a software device fetches a texel for all
// lanes at once, and words of a storage buffer lane by lane.
layout(set = 0, binding = 2) uniform usamplerBuffer decode;
// The format where the kernel is made for one, else 0: a software device takes all branches that it does not know
// better of.
layout(constant_id = 0) const uint FORMAT = 0u;

layout(push_constant) uniform Push {
    uvec2 size;
    uint first_byte;
    uint stride_bytes;
    uint format;
    uint codes_from;
} push;

#include "unpack.glsl"

const float BRIGHTEST_HALF = 65504.0;
const uint RGB8 = 1u;
const uint RGBA8 = 2u;
const uint BGRA8 = 3u;
const uint RGBA16F = 4u;

// Behind a function, because the build's reflection does not evaluate comparisons of constants.
uint format() { return FORMAT != 0u ? FORMAT : push.format; }

float decoded(uint offset) {
    uint code = push.codes_from + byte_at(offset);
    uvec4 four = texelFetch(decode, int(code >> 2u));
    uvec2 two = (code & 2u) == 0u ? four.xy : four.zw;
    return uintBitsToFloat((code & 1u) == 0u ? two.x : two.y);
}

// What is not a number is black: it must not spread over a blurred picture.
vec4 numbers(vec4 v) {
    return vec4(is_number(v.r) ? v.r : 0.0, is_number(v.g) ? v.g : 0.0, is_number(v.b) ? v.b : 0.0,
                is_number(v.a) ? v.a : 0.0);
}

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, push.size))) {
        return;
    }
    uint row = push.first_byte + pixel.y * push.stride_bytes;
    vec4 value;
    if (format() == RGB8) {
        uint at = row + 3u * pixel.x;
        value = vec4(decoded(at), decoded(at + 1u), decoded(at + 2u), 1.0);
    } else if (format() == RGBA8 || format() == BGRA8) {
        uint at = row + 4u * pixel.x;
        value = vec4(decoded(at), decoded(at + 1u), decoded(at + 2u), float(byte_at(at + 3u)) / 255.0);
        value = format() == BGRA8 ? value.bgra : value;
    } else if (format() == RGBA16F) {
        uint at = row + 8u * pixel.x;
        value = numbers(vec4(half_at(at), half_at(at + 2u), half_at(at + 4u), half_at(at + 6u)));
    } else {
        uint at = row + 16u * pixel.x;
        value = numbers(vec4(float_at(at), float_at(at + 4u), float_at(at + 8u), float_at(at + 12u)));
    }
#ifdef HALF
    // What is brighter than half floats hold would be infinitely bright, and spread over a blurred picture.
    value.rgb = nearest_half(clamp(value.rgb, vec3(-BRIGHTEST_HALF), vec3(BRIGHTEST_HALF)));
#endif
    imageStore(color, ivec2(pixel), value);
}
