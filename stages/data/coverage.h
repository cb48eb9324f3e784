#pragma once

#include "stages/data/fragments.h"

namespace texmesh {

/// Bytes of one row of coverage bits: ceil(width / 8).
constexpr std::size_t coverage_stride_bytes(std::uint32_t width_px) {
  return (std::size_t{width_px} + 7) / 8;
}

/// Bytes of the coverage bits of an image.
constexpr std::size_t coverage_size_bytes(std::uint32_t width_px, std::uint32_t height_px) {
  return coverage_stride_bytes(width_px) * height_px;
}

/// Coverage bits of an image, as TexturePlane::coverage has them: 1 bit per texel, rows of
/// coverage_stride_bytes(), bit 7 first. A view: whoever owns the bits keeps them alive.
struct CoverageMask {
  const std::uint8_t* bits = nullptr;
  std::size_t stride_bytes = 0;
  std::uint32_t width_px = 0, height_px = 0;

  CoverageMask() = default;
  /// `coverage` holds coverage_size_bytes(width, height) bytes.
  CoverageMask(const std::vector<std::uint8_t>& coverage, std::uint32_t width, std::uint32_t height)
      : bits(coverage.data()),
        stride_bytes(coverage_stride_bytes(width)),
        width_px(width),
        height_px(height) {}
  explicit CoverageMask(const TexturePlane& plane)
      : CoverageMask(plane.coverage, plane.width_px, plane.height_px) {}

  /// Without bits, which stands for a mask of full coverage.
  bool empty() const { return bits == nullptr; }
  /// x < width_px, y < height_px.
  bool covered(std::uint32_t x, std::uint32_t y) const { return byte_at(x, y) >> (7 - x % 8) & 1; }
  /// The byte that holds the texel's bit: the eight texels from x / 8 * 8 on.
  std::uint8_t byte_at(std::uint32_t x, std::uint32_t y) const { return bits[y * stride_bytes + x / 8]; }
};

}  // namespace texmesh
