#pragma once
// Inside proxies only: which cells of a texture a chart touches.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// Cells that are touched, as runs of each row.
struct ChartMask {
  struct Run {
    std::uint32_t row = 0, first = 0, count = 0;
  };
  std::uint32_t width = 0, height = 0;  // cells
  std::vector<Run> runs;                // by row, then by first; runs of a row do not touch
  std::uint64_t cell_count() const;
};

/// The cells, unit squares, whose inside the triangles touch. Corners lie in [0, width] x [0, height].
ChartMask mask_of(std::span<const std::array<Vec2d, 3>> triangles, std::uint32_t width, std::uint32_t height);

/// The mask turned by a quarter: (x, y) -> (height - y, x).
ChartMask quarter_turned(const ChartMask& mask);

}  // namespace texmesh
