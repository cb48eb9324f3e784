#pragma once

#include "stages/data/coverage.h"

namespace texmesh {

/// Which texels of a window into an image are covered; with an empty mask all are.
struct CoverageWindow {
  CoverageMask mask;                      // of the image: what lies beyond it is not covered
  std::uint32_t left_px = 0, top_px = 0;  // where the window lies in the image, with a mask or without
  /// Whether the texel at (x, y) of the window is covered; only for a mask that is not empty.
  bool covered(std::uint32_t x, std::uint32_t y) const {
    const std::uint32_t u = left_px + x, v = top_px + y;
    return u < mask.width_px && v < mask.height_px && mask.covered(u, v);
  }
};

/// A rectangle of interleaved 8-bit pixels within a larger image.
struct PixelWindow {
  const std::uint8_t* data = nullptr;
  std::size_t stride_bytes = 0;
  std::uint32_t width_px = 0, height_px = 0;
  CoverageWindow coverage{};
};

}  // namespace texmesh
