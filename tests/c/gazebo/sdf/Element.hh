// A stand-in for sdformat: a table of texts.
#pragma once
#include <map>
#include <sstream>
#include <string>
#include <utility>
namespace sdf {
class Element {
  public:
    std::map<std::string, std::string> values;
    template <class T> std::pair<T, bool> Get(const std::string &key, const T &otherwise) const {
        const auto found = values.find(key);
        if (found == values.end()) return {otherwise, false};
        std::istringstream text(found->second);
        T value{};
        text >> value;
        return {value, true};
    }
};
} // namespace sdf
