#version 460
// Input as texels. The other variant: exact_place_words.comp.
#extension GL_GOOGLE_include_directive : require
#define TEXELS
#include "exact_place.glsl"
