#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <tuple>
#include <utility>

#include "format/base/vec.h"
#include "stages/geometry/texel_coverage.h"

namespace texmesh {

/// A triangle on a texture of width x height texels, for filling. Corners are rounded to 1/256 texel, so that
/// all that follows is exact: triangles that share an edge share no texel and leave none out.
class TexelTriangle {
 public:
  static constexpr std::int64_t kSteps = 256;   // of a texel
  static constexpr int kMostSide_px = 8192;     // of a texture; products of coordinates stay in 64 bits
  static constexpr double kMostTiles = 64;      // that a triangle may reach over
  static constexpr double kFarTexels = 0x1p40;  // where no fraction is left of a float

  /// Corners in texels. Nothing when a corner is not finite or further off than kFarTexels, and when the
  /// triangle reaches over more than kMostTiles tiles: that is no place on a texture.
  static std::optional<TexelTriangle> of(const std::array<Vec2d, 3>& corners, std::uint32_t width_px,
                                         std::uint32_t height_px);

  /// Rows and texels that fill() goes through, at most; those of a clamped direction are clipped.
  double work(Wrap wrap_t, std::uint32_t height_px) const {
    const double rows = static_cast<double>(bottom_ - top_) / kSteps + 1;
    const double clipped = wrap_t == Wrap::kClamp ? std::min<double>(rows, height_px) : rows;
    return clipped * (1 + static_cast<double>(right_ - left_) / kSteps);
  }

  /// Calls span(row, first, end) with the texels whose centres lie inside, after wrapping. What is outside of
  /// a clamped direction is left out.
  template <class F>
  void fill(std::uint32_t width_px, std::uint32_t height_px, Wrap wrap_s, Wrap wrap_t, F&& span) const;

 private:
  struct Point {
    std::int64_t x = 0, y = 0;
  };
  static std::int64_t ceil_div(std::int64_t a, std::int64_t b) {
    return a >= 0 ? (a + b - 1) / b : -(-a / b);
  }
  /// First texel of the row whose centre is not left of the edge; none where the edge does not cross the row.
  static std::optional<std::int64_t> crossing(Point a, Point b, std::int64_t centre_y);

  std::array<Point, 3> corner_;
  std::int64_t tile_x_ = 0, tile_y_ = 0;  // of the origin of the corners, in tiles
  std::int64_t left_ = 0, right_ = 0, top_ = 0, bottom_ = 0;
};

inline std::optional<TexelTriangle> TexelTriangle::of(const std::array<Vec2d, 3>& corners,
                                                      std::uint32_t width_px, std::uint32_t height_px) {
  TexelTriangle out;
  for (std::size_t k = 0; k < 3; ++k) {
    if (!(std::fabs(corners[k].x) < kFarTexels && std::fabs(corners[k].y) < kFarTexels)) return std::nullopt;
    out.corner_[k] = {static_cast<std::int64_t>(std::floor(corners[k].x * kSteps + 0.5)),
                      static_cast<std::int64_t>(std::floor(corners[k].y * kSteps + 0.5))};
  }
  const auto floor_div = [](std::int64_t a, std::int64_t b) { return -ceil_div(-a, b); };
  const auto& c = out.corner_;
  const std::int64_t tile_w = kSteps * width_px, tile_h = kSteps * height_px;
  out.tile_x_ = floor_div(std::min({c[0].x, c[1].x, c[2].x}), tile_w);
  out.tile_y_ = floor_div(std::min({c[0].y, c[1].y, c[2].y}), tile_h);
  for (Point& p : out.corner_) p.x -= out.tile_x_ * tile_w, p.y -= out.tile_y_ * tile_h;
  std::tie(out.left_, out.right_) = std::minmax({c[0].x, c[1].x, c[2].x});
  std::tie(out.top_, out.bottom_) = std::minmax({c[0].y, c[1].y, c[2].y});
  if (static_cast<double>(out.right_) > kMostTiles * static_cast<double>(tile_w) ||
      static_cast<double>(out.bottom_) > kMostTiles * static_cast<double>(tile_h))
    return std::nullopt;
  return out;
}

inline std::optional<std::int64_t> TexelTriangle::crossing(Point a, Point b, std::int64_t centre_y) {
  if (a.y > b.y) std::swap(a, b);
  if (centre_y < a.y || centre_y >= b.y) return std::nullopt;
  const std::int64_t height = b.y - a.y;
  const std::int64_t x = a.x * height + (centre_y - a.y) * (b.x - a.x);  // times height
  return ceil_div(x - kSteps / 2 * height, kSteps * height);
}

template <class F>
void TexelTriangle::fill(std::uint32_t width_px, std::uint32_t height_px, Wrap wrap_s, Wrap wrap_t,
                         F&& span) const {
  const std::int64_t width = width_px, height = height_px;
  std::int64_t row = ceil_div(top_ - kSteps / 2, kSteps), last = ceil_div(bottom_ - kSteps / 2, kSteps);
  if (wrap_t == Wrap::kClamp) {
    row = std::max(row, -tile_y_ * height);
    last = std::min(last, (1 - tile_y_) * height);
  }
  for (; row < last; ++row) {
    std::int64_t first = 0, end = 0;
    bool one = false;
    for (std::size_t k = 0; k < 3; ++k)
      if (const auto x = crossing(corner_[k], corner_[(k + 1) % 3], row * kSteps + kSteps / 2)) {
        (one ? end : first) = *x;
        one = true;
      }
    if (first > end) std::swap(first, end);
    const std::uint32_t y = wrapped(row + tile_y_ * height, height_px, wrap_t);
    if (wrap_s == Wrap::kClamp) {
      first = std::max(first, -tile_x_ * width);
      end = std::min(end, (1 - tile_x_) * width);
      if (first < end)
        span(y, static_cast<std::uint32_t>(first + tile_x_ * width),
             static_cast<std::uint32_t>(end + tile_x_ * width));
      continue;
    }
    while (first < end) {  // tile by tile; corners are not left of tile 0
      const std::int64_t stop = std::min(end, (first / width + 1) * width);
      const std::uint32_t a = wrapped(first + tile_x_ * width, width_px, wrap_s),
                          b = wrapped(stop - 1 + tile_x_ * width, width_px, wrap_s);
      span(y, std::min(a, b), std::max(a, b) + 1);
      first = stop;
    }
  }
}

}  // namespace texmesh
