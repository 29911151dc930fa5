// A stand-in for gz-transport: what is published goes to who has subscribed, in this process and at once.
#pragma once
#include <gz/msgs/image.pb.h>

#include <functional>
#include <map>
#include <string>
#include <vector>
namespace gz::transport {
inline std::map<std::string, std::vector<std::function<void(const msgs::Image &)>>> &subscribers() {
    static std::map<std::string, std::vector<std::function<void(const msgs::Image &)>>> all;
    return all;
}
class Node {
  public:
    class Publisher {
      public:
        explicit Publisher(std::string topic = "") : topic_(std::move(topic)) {}
        bool Publish(const msgs::Image &image) {
            for (auto &call : subscribers()[topic_]) call(image);
            return true;
        }
      private:
        std::string topic_;
    };
    template <class Message> Publisher Advertise(const std::string &topic) { return Publisher(topic); }
    template <class Owner> bool Subscribe(const std::string &topic, void (Owner::*call)(const msgs::Image &), Owner *owner) {
        subscribers()[topic].push_back([call, owner](const msgs::Image &image) { (owner->*call)(image); });
        return true;
    }
};
} // namespace gz::transport
