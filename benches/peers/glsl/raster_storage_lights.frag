#version 460
// The picture of raster_color.frag as a user would otherwise write it: the lights in a storage buffer, read in the
// loop, a root for every length and pow() for the highlight. What the raster's 16 samples are measured against.
struct Light {
    vec4 position_m;
    vec4 color;
    vec4 attenuation;
};
layout(set = 0, binding = 2, std430) readonly buffer Lights {
    Light lights[];
};
layout(set = 0, binding = 3) uniform usamplerBuffer cameras;
layout(set = 1, binding = 0) uniform sampler2D kd_texture;

layout(constant_id = 0) const uint LIGHT_COUNT = 0;
layout(constant_id = 1) const bool TEXTURED = false;

layout(location = 0) in vec3 in_position_m;
layout(location = 1) in vec3 in_normal;
layout(location = 2) in vec2 in_uv;
layout(location = 3) flat in vec3 in_kd;
layout(location = 4) flat in vec4 in_ks_ns;
layout(location = 0) out vec4 out_color;

void main() {
    vec3 kd = in_kd;
    if (TEXTURED) {
        kd *= texture(kd_texture, vec2(in_uv.x, 1.0 - in_uv.y)).rgb;
    }
    vec3 to_eye = normalize(-in_position_m);
    vec3 n = normalize(in_normal);
    if (dot(n, to_eye) < 0.0) {
        n = -n;
    }
    vec3 position_m = uintBitsToFloat(texelFetch(cameras, 0).xyz) + in_position_m;
    vec3 sum = vec3(0.0);
    for (uint i = 0; i < LIGHT_COUNT; ++i) {
        vec3 offset_m = lights[i].position_m.xyz - position_m;
        float distance_m = length(offset_m);
        vec3 to_light = offset_m / distance_m;
        vec3 a = lights[i].attenuation.xyz;
        vec3 arriving = lights[i].color.rgb / (a.x + a.y * distance_m + a.z * distance_m * distance_m);
        vec3 halfway = normalize(to_light + to_eye);
        float shine = dot(n, halfway) > 0.0 ? pow(dot(n, halfway), in_ks_ns.w) : 0.0;
        sum += arriving * (kd * max(dot(n, to_light), 0.0) + in_ks_ns.rgb * shine);
    }
    out_color = vec4(sum, 1.0);
}
