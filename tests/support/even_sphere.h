#pragma once
#include <map>
#include <utility>
#include <vector>

#include "format/base/portable_math.h"
#include "format/model/model.h"

namespace texmesh::testing {

/// An octahedron split `levels` times and blown up to a sphere, with or without bumps: nearly even triangles
/// everywhere, where the poles of a UV sphere are slivers whose capped rates read as features.
inline Mesh even_sphere(int levels, double amplitude) {
  std::vector<Vec3d> points{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  Mesh m;
  m.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middle;
    const auto split = [&](std::uint32_t a, std::uint32_t b) {
      const auto [at, added] =
          middle.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(points.size()));
      if (added) points.push_back(normalized(points[a] + points[b]));
      return at->second;
    };
    std::vector<Triangle> finer;
    for (const Triangle& t : m.triangles) {
      const std::uint32_t a = split(t[0], t[1]), b = split(t[1], t[2]), c = split(t[2], t[0]);
      for (const Triangle& part :
           {Triangle{t[0], a, c}, Triangle{a, t[1], b}, Triangle{c, b, t[2]}, Triangle{a, b, c}})
        finer.push_back(part);
    }
    m.triangles = finer;
  }
  for (const Vec3d p : points) {
    const double relief = portable::sin(9 * p.x) * portable::sin(8 * p.y + 1) * portable::sin(7 * p.z + 2);
    m.wedge_position.push_back(static_cast<std::uint32_t>(m.positions.size()));
    m.positions.push_back(to_float(p * (1 + amplitude * relief)));
  }
  m.triangle_material.assign(m.triangles.size(), 0);
  m.triangle_part.assign(m.triangles.size(), 0);
  m.part_names = {"part"};
  return m;
}

}  // namespace texmesh::testing
