// A stand-in for gz-sim: the interfaces of a system.
#pragma once
#include <gz/math/Pose3.hh>
#include <sdf/Element.hh>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
namespace gz::sim {
using Entity = uint64_t;
struct UpdateInfo {
    std::chrono::steady_clock::duration simTime{};
    bool paused = false;
};
class EntityComponentManager {
  public:
    std::function<math::Pose3d(Entity)> pose; // the test's
};
class EventManager {};
class System {
  public:
    virtual ~System() = default;
};
class ISystemConfigure {
  public:
    virtual ~ISystemConfigure() = default;
    virtual void Configure(const Entity &, const std::shared_ptr<const sdf::Element> &, EntityComponentManager &, EventManager &) = 0;
};
class ISystemPostUpdate {
  public:
    virtual ~ISystemPostUpdate() = default;
    virtual void PostUpdate(const UpdateInfo &, const EntityComponentManager &) = 0;
};
} // namespace gz::sim
