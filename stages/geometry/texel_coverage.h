#pragma once
// Inside the compiler only: where on a texture a triangle lies. Texel coordinates: p = uv * size in texels,
// texel (i, j) is the unit square [i, i + 1) x [j, j + 1) with its centre at + 0.5.
#include "format/model/model.h"

namespace texmesh {

/// UV to texel coordinates of one texture reference: KHR_texture_transform (scale, then rotation
/// counter-clockwise as seen with v downwards, then offset), then the size.
class TexelMap {
 public:
  TexelMap(const UvTransform& transform, std::uint32_t width_px, std::uint32_t height_px);
  Vec2d operator()(Vec2f uv) const {
    const double u = uv.x * scale_.x, v = uv.y * scale_.y;
    return {(cos_ * u + sin_ * v + offset_.x) * width_, (cos_ * v - sin_ * u + offset_.y) * height_};
  }

 private:
  Vec2d offset_, scale_;
  double cos_ = 1, sin_ = 0, width_, height_;
};

/// The texels that sampling with bilinear interpolation can touch, one bit each, rows of ceil(width / 8)
/// bytes, bit 7 first.
class TexelCoverage {
 public:
  TexelCoverage(std::uint32_t width_px, std::uint32_t height_px, Wrap wrap_s, Wrap wrap_t);

  /// Marks every texel (i, j) with |x - (i + 0.5)| <= 1 and |y - (j + 0.5)| <= 1 for some point (x, y) of the
  /// triangle, after wrapping. Exact but for rounding, except that a triangle more than four tiles high
  /// counts as its bounding box, and one beyond 2^40 texels as everything: float UVs have no fraction there.
  /// Coordinates are finite.
  void add(const std::array<Vec2d, 3>& triangle);

  /// More triangles with other wrap modes.
  void set_wrap(Wrap wrap_s, Wrap wrap_t) { wrap_s_ = wrap_s, wrap_t_ = wrap_t; }
  const std::vector<std::uint8_t>& bits() const { return bits_; }
  std::vector<std::uint8_t> release_bits() { return std::move(bits_); }

 private:
  struct Extent {
    double lo, hi;
  };
  void trace(const std::array<Vec2d, 3>& triangle, std::int64_t first, std::int64_t last);
  void add_row(std::uint32_t row, Extent extent);
  void mark(std::uint32_t row, std::uint32_t first, std::uint32_t last);
  void mark_everything();

  std::uint32_t width_, height_;
  Wrap wrap_s_, wrap_t_;
  std::vector<std::uint8_t> bits_, row_full_;
  std::uint32_t full_rows_ = 0;
  std::vector<Extent> slabs_;  // of the triangle in hand
};

/// `index` folded into 0..size-1 as the wrap mode says.
std::uint32_t wrapped(std::int64_t index, std::uint32_t size, Wrap wrap);

}  // namespace texmesh
