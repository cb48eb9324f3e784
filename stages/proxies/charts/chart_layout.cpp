#include "stages/proxies/charts/chart_layout.h"

#include <array>
#include <cmath>
#include <cstddef>

#include "format/base/no_index.h"
#include "stages/proxies/charts/conformal_map.h"

namespace texmesh {
namespace {

// L2 of Sander et al. 2001: the root of the mean squared stretch, 1 for a plane.
constexpr double kMostStretch = 1.25;
// A projection that stretches no more than this is kept, which saves the solver's time.
constexpr double kProjectionStretch = 1.02;
// Of a triangle's singular values and of one to the chart's mean.
constexpr double kMostRatio = 3;

}  // namespace

ChartLayout::ChartLayout(const ProxySurface& surface)
    : surface_(surface), number_of_(3 * surface.triangles.size(), kNoIndex) {
  for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
    own_.emplace_back(
        std::array{corner_position(3 * t), corner_position(3 * t + 1), corner_position(3 * t + 2)});
    for (const Vec2d p : {Vec2d{}, Vec2d{own_[t].base, 0}, own_[t].apex}) places_.push_back(p);
  }
  tried_ = places_;
}

void ChartLayout::project(std::span<const std::uint32_t> triangles, Vec3d area_normal) {
  const PlaneAxes axes(normalized(area_normal));
  for (const std::uint32_t t : triangles)
    for (std::uint32_t c = 3 * t; c < 3 * t + 3; ++c) tried_[c] = axes(corner_position(c));
}

/// Gives the disk's vertices numbers, fills disk_, and returns how many vertices there are.
std::size_t ChartLayout::number_vertices(std::span<const std::uint32_t> triangles,
                                         const std::vector<std::uint32_t>& vertices) {
  std::uint32_t count = 0;
  disk_.clear();
  disk_own_.clear();
  for (const std::uint32_t t : triangles) {
    Triangle numbered;
    for (std::size_t k = 0; k < 3; ++k) {
      std::uint32_t& number = number_of_[vertices[3 * std::size_t{t} + k]];
      if (number == kNoIndex) number = count++;
      numbered[k] = number;
    }
    disk_.push_back(numbered);
    disk_own_.push_back(own_[t]);
  }
  return count;
}

/// Of the border's half-edges, the one that begins farthest away.
std::uint32_t ChartLayout::farthest(std::span<const std::uint32_t> border, Vec3d from) const {
  std::uint32_t best = border[0];
  double most = -1;
  for (const std::uint32_t h : border) {
    const Vec3d d = corner_position(h) - from;
    if (const double d2 = dot(d, d); d2 > most) most = d2, best = h;
  }
  return best;
}

bool ChartLayout::unfold(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
                         const std::vector<std::uint32_t>& vertices) {
  const std::size_t count = number_vertices(triangles, vertices);
  const std::uint32_t a = farthest(border, corner_position(border[0]));
  const std::uint32_t b = farthest(border, corner_position(a));
  const auto number = [&](std::uint32_t c) { return number_of_[vertices[c]]; };
  const double distance = length(corner_position(b) - corner_position(a));
  std::vector<Vec2d> found;
  if (number(a) != number(b))
    found = conformal_map(disk_, disk_own_, count, {number(a), number(b)}, distance);
  if (!found.empty())
    for (const std::uint32_t t : triangles)
      for (std::uint32_t c = 3 * t; c < 3 * t + 3; ++c) tried_[c] = found[number(c)];
  for (const std::uint32_t t : triangles)
    for (std::uint32_t c = 3 * t; c < 3 * t + 3; ++c) number_of_[vertices[c]] = kNoIndex;
  return !found.empty();
}

/// Checks the places tried and gives the chart its area.
bool ChartLayout::is_sound(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
                           const std::vector<std::uint32_t>& vertices, double most_stretch) {
  double area = 0, flat_area = 0, stretch = 0, least2 = 1e300, largest2 = 0;
  for (const std::uint32_t t : triangles) {
    const FlatStretch s = flat_stretch(own_[t], &tried_[3 * std::size_t{t}]);
    if (!(s.area > 0) || !(s.least2 > 0) || s.largest2 > kMostRatio * kMostRatio * s.least2) return false;
    area += own_[t].area();
    flat_area += s.area;
    stretch += own_[t].area() * (1 / s.least2 + 1 / s.largest2) / 2;
    least2 = std::fmin(least2, s.least2);
    largest2 = std::fmax(largest2, s.largest2);
  }
  const double scale2 = area / flat_area;  // to the chart's area
  if (!(stretch <= most_stretch * most_stretch * area * scale2)) return false;
  if (least2 * scale2 * kMostRatio * kMostRatio < 1 || largest2 * scale2 > kMostRatio * kMostRatio)
    return false;
  if (!border_is_simple(border, vertices, tried_)) return false;
  const double scale = std::sqrt(scale2);
  for (const std::uint32_t t : triangles)
    for (std::size_t c = 3 * std::size_t{t}; c < 3 * std::size_t{t} + 3; ++c) tried_[c] = tried_[c] * scale;
  return true;
}

bool ChartLayout::try_disk(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
                           const std::vector<std::uint32_t>& vertices, Vec3d area_normal) {
  project(triangles, area_normal);
  if (is_sound(triangles, border, vertices, kProjectionStretch)) return true;
  if (unfold(triangles, border, vertices) && is_sound(triangles, border, vertices, kMostStretch)) return true;
  project(triangles, area_normal);
  return is_sound(triangles, border, vertices, kMostStretch);
}

void ChartLayout::keep_tried(std::span<const std::uint32_t> triangles) {
  for (const std::uint32_t t : triangles)
    for (std::size_t c = 3 * std::size_t{t}; c < 3 * std::size_t{t} + 3; ++c) places_[c] = tried_[c];
}

}  // namespace texmesh
