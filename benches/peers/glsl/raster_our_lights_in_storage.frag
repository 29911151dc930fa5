#version 460
// raster_color.frag with nothing changed but where the lights stand: what that alone is worth.
#extension GL_GOOGLE_include_directive : require
#define COLOR
#define LIGHTS_IN_STORAGE
#include "raster_frag.glsl"
