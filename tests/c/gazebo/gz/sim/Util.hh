// A stand-in for gz-sim.
#pragma once
#include <gz/sim/System.hh>
namespace gz::sim {
inline math::Pose3d worldPose(const Entity &entity, const EntityComponentManager &components) { return components.pose(entity); }
} // namespace gz::sim
