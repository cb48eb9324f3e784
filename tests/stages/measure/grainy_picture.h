#pragma once
#include "stages/measure/picture.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

/// An object of grain in a box of a grey picture.
inline Picture object_in(std::uint32_t side, std::uint32_t x0, std::uint32_t x1, std::uint32_t y0,
                         std::uint32_t y1) {
  Picture p;
  p.side_px = side;
  Random random{5};
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const bool object = x >= x0 && x < x1 && y >= y0 && y < y1 && (x + y) % 7 != 0;
      const auto value = static_cast<float>(random.uniform());
      p.linear.push_back(object ? Vec3f{value, value, value} : Vec3f{0.2f, 0.2f, 0.2f});
      p.covered.push_back(object);
    }
  return p;
}

}  // namespace texmesh::testing
