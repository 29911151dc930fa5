#version 460
// All effects between two resamplings that act on one pixel at a time, as one kernel: each is its own function in
// include/effects/, compiled out where its specialization constant is 0. Behind an effect that reads its neighbours
// they run in that effect's last pass instead. Twin: src/reference/chain.rs.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 16, local_size_y = 8) in;

#include "chain.glsl"
#include "deliver.glsl"

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (all(lessThan(pixel, push.size))) {
        deliver(pixel, imageLoad(source, ivec2(pixel)));
    }
}
