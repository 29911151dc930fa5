// A stand-in for gz-plugin: enough to compile examples/gazebo against.
#pragma once
#define GZ_ADD_PLUGIN(Class, ...) static_assert(sizeof(Class) > 0, "a plugin");
