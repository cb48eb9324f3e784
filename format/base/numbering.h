#pragma once
#include <type_traits>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// Numbers things in the order of their first use: `number` where the thing has one; else, at kNoIndex, it
/// gets the next one and stands at the end of `list`.
template <class T>
std::uint32_t numbered(std::uint32_t& number, std::vector<T>& list, const std::type_identity_t<T>& thing) {
  if (number == kNoIndex) {
    number = static_cast<std::uint32_t>(list.size());
    list.push_back(thing);
  }
  return number;
}

}  // namespace texmesh
