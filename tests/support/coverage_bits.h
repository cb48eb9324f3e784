#pragma once
#include <cstdint>
#include <vector>

#include "stages/data/fragments.h"

namespace texmesh::testing {

/// Coverage bits of width x height texels where covered(x, y).
template <class Covered>
std::vector<std::uint8_t> coverage_where(std::uint32_t width, std::uint32_t height, Covered&& covered) {
  std::vector<std::uint8_t> bits(coverage_size_bytes(width, height));
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x)
      if (covered(x, y))
        bits[coverage_stride_bytes(width) * y + x / 8] |= static_cast<std::uint8_t>(0x80 >> x % 8);
  return bits;
}

}  // namespace texmesh::testing
