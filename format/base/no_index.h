#pragma once
#include <cstdint>

namespace texmesh {

/// Stands for "no vertex", "no triangle", "no fragment" ... wherever an index has 32 bits.
inline constexpr std::uint32_t kNoIndex = 0xffffffffu;

}  // namespace texmesh
