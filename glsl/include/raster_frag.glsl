// Fragment stage of all rasterizing pipelines: linear radiance with coverage, and motion in px per frame interval.
// EXACT: lines have times of their own, so the eye moves over the picture; alpha says what moves alike.
#ifndef EXACT
#include "raster_push.glsl"
#endif

#ifdef COLOR
layout(constant_id = 0) const bool LIT = false;
layout(constant_id = 1) const bool TEXTURED = false;
// Some of what is drawn has a specular colour.
layout(constant_id = 4) const bool GLOSSY = true;
#include "raster_lights.glsl"
#include "half.glsl"
// Positions of the camera, m, a texel each: a word of a storage buffer is read lane by lane on a software device, which
// took a quarter of this shader's time.
layout(set = 0, binding = 3) uniform usamplerBuffer cameras;
layout(set = 1, binding = 0) uniform sampler2D kd_texture;

layout(location = 0) in vec3 in_position_m;
layout(location = 1) in vec3 in_normal;
layout(location = 2) in vec2 in_uv;
layout(location = 3) flat in vec3 in_kd;
layout(location = 4) flat in vec4 in_ks_ns;
#ifdef EXACT
layout(location = 5) in vec3 in_eye_m;
// Number of the motion group, from 1.
layout(location = 6) flat in float in_group;
vec3 to_eye_m() { return in_eye_m - in_position_m; }
vec3 origin_m() { return uintBitsToFloat(texelFetch(cameras, 0).xyz); }
#else
// Positions are relative to the camera.
vec3 to_eye_m() { return -in_position_m; }
vec3 origin_m() { return uintBitsToFloat(texelFetch(cameras, int(push.instant)).xyz); }
#endif
layout(location = 0) out vec4 out_color;

struct Arriving {
    vec3 diffuse;
    vec3 specular;
};

// What one point light adds: Blinn-Phong without the surface's colours. One root a length: the reciprocal one.
void add_light(inout Arriving sum, vec3 offset_m, vec3 color, vec3 attenuation, vec3 n, vec3 to_eye) {
    float square = dot(offset_m, offset_m);
    float inverse = inversesqrt(square);
    vec3 arriving = color / (attenuation.x + attenuation.y * (square * inverse) + attenuation.z * square);
    float facing = dot(n, offset_m) * inverse;
    sum.diffuse += arriving * max(facing, 0.0);
    if (GLOSSY) {
        // Halfway is the sum of two unit vectors: its product with n and its length follow from theirs.
        float square_halfway = 2.0 + 2.0 * dot(offset_m, to_eye) * inverse;
        float toward = (facing + dot(n, to_eye)) * inversesqrt(max(square_halfway, 1e-12));
        sum.specular += arriving * (toward > 0.0 ? pow(toward, in_ks_ns.w) : 0.0);
    }
}

// Blinn-Phong from both sides, summed over the point lights.
vec3 blinn_phong(vec3 kd) {
    vec3 to_eye = normalize(to_eye_m());
    vec3 n = normalize(in_normal);
    n = dot(n, to_eye) < 0.0 ? -n : n;
    vec3 from_light = origin_m() + in_position_m;
    Arriving sum = Arriving(vec3(0.0), vec3(0.0));
    for (uint i = 0; i < min(LIGHT_COUNT, FIXED_LIGHTS); ++i) {
        vec3 offset_m = fixed_position_m(i) - from_light;
        add_light(sum, offset_m, fixed_color(i), fixed_attenuation(i), n, to_eye);
    }
    for (uint i = FIXED_LIGHTS; i < LIGHT_COUNT; ++i) {
        vec3 offset_m = lights[i].position_m.xyz - from_light;
        add_light(sum, offset_m, lights[i].color.rgb, lights[i].attenuation.xyz, n, to_eye);
    }
    return kd * sum.diffuse + (GLOSSY ? in_ks_ns.rgb * sum.specular : vec3(0.0));
}
#endif

#ifdef MOTION
layout(location = 5) in vec3 in_clip_from;
layout(location = 6) in vec3 in_clip_to;
#ifdef PATH
layout(location = 7) in vec3 in_clip_now;
// From the picture's instant to the begin of the span, and to its end.
layout(location = 0) out vec4 out_path_px;
#elif defined(COLOR)
layout(location = 1) out vec2 out_motion_px;
#else
layout(location = 0) out vec2 out_motion_px;
#endif

// Where a point that is now in view lies behind the camera at the other time, its motion is large, not negative.
vec2 on_picture(vec3 clip) {
    return clip.xy / max(clip.z, 1e-4);
}
#endif

void main() {
#ifdef COLOR
    vec3 kd = in_kd;
    if (TEXTURED) {
        // v is up, rows run down.
        kd *= texture(kd_texture, vec2(in_uv.x, 1.0 - in_uv.y)).rgb;
    }
    // The attachment's format.
    vec3 seen = nearest_half(LIT ? blinn_phong(kd) : kd);
#ifdef EXACT
    out_color = vec4(seen, in_group);
#else
    out_color = vec4(seen, 1.0);
#endif
#endif
#ifdef PATH
    vec2 now = on_picture(in_clip_now);
    vec2 from_px = (on_picture(in_clip_from) - now) * push.motion_scale_px;
    vec2 to_px = (on_picture(in_clip_to) - now) * push.motion_scale_px;
    out_path_px = vec4(from_px, to_px);
#elif defined(MOTION)
    out_motion_px = (on_picture(in_clip_to) - on_picture(in_clip_from)) * push.motion_scale_px;
#endif
}
