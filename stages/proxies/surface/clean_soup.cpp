#include "stages/proxies/surface/clean_soup.h"

#include <algorithm>
#include <vector>

#include "format/base/no_index.h"
#include "stages/geometry/weld.h"

namespace texmesh {
namespace {

/// The lowest corner first; direction stays.
Triangle lowest_first(Triangle t) {
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return t;
}

/// Sets `dropped` for triangles that repeat one before them.
void drop_repeated(const std::vector<Triangle>& triangles, const std::vector<std::uint32_t>& group,
                   std::vector<std::uint8_t>& dropped) {
  struct Key {
    Triangle corners;
    std::uint32_t group, triangle;
    auto operator<=>(const Key&) const = default;
  };
  std::vector<Key> keys;
  keys.reserve(triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    if (!dropped[t]) keys.push_back({lowest_first(triangles[t]), group[t], t});
  std::sort(keys.begin(), keys.end());
  for (std::size_t i = 1; i < keys.size(); ++i)
    if (keys[i].corners == keys[i - 1].corners && keys[i].group == keys[i - 1].group)
      dropped[keys[i].triangle] = 1;
}

/// Positions that triangles have, in order, and the triangles with their indices; a missing corner's is
/// kNoIndex. Late in a simplification few of all positions are left, and welding sorts them.
struct UsedSoup {
  std::vector<Vec3f> points;
  std::vector<Triangle> triangles;
  UsedSoup(std::span<const Vec3f> positions, std::span<const Triangle> given)
      : triangles(given.begin(), given.end()) {
    std::vector<std::uint32_t> at(positions.size(), kNoIndex);
    for (const Triangle& t : given)
      for (const std::uint32_t p : t)
        if (p < at.size()) at[p] = 0;
    for (std::size_t p = 0; p < at.size(); ++p) {
      if (at[p] == kNoIndex) continue;
      at[p] = static_cast<std::uint32_t>(points.size());
      points.push_back(positions[p]);
    }
    for (Triangle& t : triangles)
      for (std::uint32_t& p : t) p = p < at.size() ? at[p] : kNoIndex;
  }
};

bool has_area(const std::vector<Vec3f>& positions, const Triangle& t) {
  const Vec3d a = to_double(positions[t[0]]);
  const Vec3d n = cross(to_double(positions[t[1]]) - a, to_double(positions[t[2]]) - a);
  return dot(n, n) > 0;
}

}  // namespace

ProxySurface clean_soup(std::span<const Vec3f> positions, std::span<const Triangle> triangles,
                        std::span<const std::uint32_t> group, ZeroArea zero_area) {
  const UsedSoup used(positions, triangles);
  const std::vector<Vec3f>& points = used.points;
  const std::vector<std::uint32_t> weld = weld_positions(points, 0);
  std::vector<Triangle> welded(triangles.size());
  std::vector<std::uint32_t> groups(triangles.size(), 0);
  std::vector<std::uint8_t> dropped(triangles.size(), 0);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    Triangle& w = welded[t];
    for (std::size_t k = 0; k < 3; ++k)
      w[k] = used.triangles[t][k] != kNoIndex ? weld[used.triangles[t][k]] : kNoIndex;
    const bool sound = w[0] != kNoIndex && w[1] != kNoIndex && w[2] != kNoIndex && w[0] != w[1] &&
                       w[1] != w[2] && w[2] != w[0];
    dropped[t] = !sound || (zero_area == ZeroArea::kDrop && !has_area(points, w));
    if (t < group.size()) groups[t] = group[t];
  }
  drop_repeated(welded, groups, dropped);

  ProxySurface surface;
  std::vector<std::uint32_t> at(points.size(), kNoIndex);
  for (std::size_t t = 0; t < welded.size(); ++t) {
    if (dropped[t]) continue;
    for (std::uint32_t& corner : welded[t]) {
      if (at[corner] == kNoIndex) {
        at[corner] = static_cast<std::uint32_t>(surface.positions.size());
        surface.positions.push_back(points[corner]);
      }
      corner = at[corner];
    }
    surface.triangles.push_back(welded[t]);
    surface.group.push_back(groups[t]);
  }
  return surface;
}

}  // namespace texmesh
