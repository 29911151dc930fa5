#version 460
// Frames from outside with several motion images: as paper_gather.comp, but what a line sees has come the way that the
// motion says from the colour's instant on: its integral. The paper takes the line's own motion for all of the way,
// which of a camera that shakes may be worse with six images than with one. Twin: src/reference/outside_gather.rs.
#extension GL_GOOGLE_include_directive : require

#define INTEGRATED
#include "paper_gather.glsl"
