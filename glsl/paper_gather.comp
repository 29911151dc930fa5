#version 460
// `--method paper`: rolling shutter and motion blur from one picture and up to six motion images (the paper's eq. 4 to
// 7 and section 3.3, in seconds). Times are relative to the instant at which `color` was rendered. Twin:
// src/reference/paper_gather.rs.
#extension GL_GOOGLE_include_directive : require

#include "paper_gather.glsl"
