#pragma once
// Random triangles on a texture and coverage bits, for the tests of geometry and fragmentation.
#include <array>
#include <cstdint>
#include <vector>

#include "format/model/model.h"
#include "stages/data/fragments.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

using Corners = std::array<Vec2d, 3>;

inline constexpr Wrap kWraps[] = {Wrap::kRepeat, Wrap::kClamp, Wrap::kMirror};

inline bool is_covered(const std::vector<std::uint8_t>& bits, std::uint32_t width, std::uint32_t x,
                       std::uint32_t y) {
  return CoverageMask(bits, width, y + 1).covered(x, y);
}

/// In texels; some without area, some mirrored.
inline Corners random_triangle(Random& random, double size, double span) {
  Corners out;
  const Vec2d at{(random.uniform() - 0.3) * size * 2, (random.uniform() - 0.3) * size * 2};
  for (Vec2d& p : out) p = at + Vec2d{(random.uniform() - 0.5) * span, (random.uniform() - 0.5) * span};
  if (random.next() % 8 == 0) out[2] = (out[0] + out[1]) * 0.5;  // without area
  if (random.next() % 4 == 0) std::swap(out[0], out[1]);         // mirrored
  return out;
}

}  // namespace texmesh::testing
