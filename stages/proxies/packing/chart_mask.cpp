#include "stages/proxies/packing/chart_mask.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace texmesh {
namespace {

// What reaches less than this into a cell, in cells, comes from rounding.
constexpr double kMostRounding = 1e-6;

class MaskBits {
 public:
  MaskBits(std::uint32_t width, std::uint32_t height)
      : width_(width), height_(height), bits_(std::size_t{width} * height, 0) {}

  void set(std::uint32_t x, std::uint32_t y) { bits_[std::size_t{y} * width_ + x] = 1; }
  void add(const std::array<Vec2d, 3>& triangle) {
    const auto [top, bottom] = std::minmax({triangle[0].y, triangle[1].y, triangle[2].y});
    const Cells rows = cells_of(top, bottom, height_);
    for (std::uint32_t y = rows.first; y < rows.end; ++y) {
      const auto [left, right] = extent_in_row(triangle, y);
      const Cells cells = cells_of(left, right, width_);
      for (std::uint32_t x = cells.first; x < cells.end; ++x) set(x, y);
    }
  }
  ChartMask mask() const {
    ChartMask out{width_, height_, {}};
    for (std::uint32_t y = 0; y < height_; ++y)
      for (std::uint32_t x = 0; x < width_; ++x) {
        if (!bits_[std::size_t{y} * width_ + x]) continue;
        if (x > 0 && bits_[std::size_t{y} * width_ + x - 1])
          ++out.runs.back().count;
        else
          out.runs.push_back({y, x, 1});
      }
    return out;
  }

 private:
  struct Cells {
    std::uint32_t first, end;
  };
  /// The cells of [low, high], at least one.
  static Cells cells_of(double low, double high, std::uint32_t count) {
    const double first = std::clamp(std::floor(low + kMostRounding), 0.0, count - 1.0);
    const double end = std::clamp(std::ceil(high - kMostRounding), first + 1, static_cast<double>(count));
    return {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(end)};
  }
  /// From where to where the part of the triangle between y and y + 1 reaches.
  static std::pair<double, double> extent_in_row(const std::array<Vec2d, 3>& triangle, std::uint32_t y) {
    const double top = y, bottom = y + 1.0;
    double left = 1e300, right = -1e300;
    const auto reach = [&](double x) { left = std::min(left, x), right = std::max(right, x); };
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d a = triangle[k], b = triangle[(k + 1) % 3];
      if (a.y >= top && a.y <= bottom) reach(a.x);
      for (const double line : {top, bottom})
        if ((a.y < line) != (b.y < line)) reach(a.x + (b.x - a.x) * ((line - a.y) / (b.y - a.y)));
    }
    return left <= right ? std::pair{left, right} : std::pair{triangle[0].x, triangle[0].x};
  }

  std::uint32_t width_, height_;
  std::vector<std::uint8_t> bits_;
};

}  // namespace

std::uint64_t ChartMask::cell_count() const {
  std::uint64_t sum = 0;
  for (const Run& run : runs) sum += run.count;
  return sum;
}

ChartMask mask_of(std::span<const std::array<Vec2d, 3>> triangles, std::uint32_t width,
                  std::uint32_t height) {
  MaskBits bits(width, height);
  for (const std::array<Vec2d, 3>& triangle : triangles) bits.add(triangle);
  return bits.mask();
}

ChartMask quarter_turned(const ChartMask& mask) {
  MaskBits bits(mask.height, mask.width);
  for (const ChartMask::Run& run : mask.runs)
    for (std::uint32_t x = run.first; x < run.first + run.count; ++x) bits.set(mask.height - 1 - run.row, x);
  return bits.mask();
}

}  // namespace texmesh
