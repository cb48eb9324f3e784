#pragma once
#include <cstdint>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// A picture in linear light, square, row-major, with the pixels that show the object.
struct Picture {
  std::uint32_t side_px = 0;
  std::vector<Vec3f> linear;          // RGB of BT.709 primaries, 0..1 (brighter is cut off)
  std::vector<std::uint8_t> covered;  // 0 or 1
};

}  // namespace texmesh
