#pragma once
#include <cstddef>
#include <cstdint>

namespace texmesh {

/// Which texels of a window are covered, as TexturePlane::coverage has them; without bits all are.
struct CoverageWindow {
  const std::uint8_t* bits = nullptr;
  std::size_t stride_bytes = 0;
  std::uint32_t left_px = 0, top_px = 0;      // of the window
  std::uint32_t width_px = 0, height_px = 0;  // of the plane proper: what lies beyond is not covered
  bool covered(std::uint32_t x, std::uint32_t y) const {
    const std::uint32_t u = left_px + x, v = top_px + y;
    return u < width_px && v < height_px && bits[v * stride_bytes + u / 8] >> (7 - u % 8) & 1;
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
