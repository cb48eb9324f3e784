#pragma once
// Shapes for tests of proxies: positions and triangles alone.
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "stages/proxies/simplify_surface.h"
#include "tests/support/hostile_meshes.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

struct Soup {
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> group;

  std::vector<ProxySurface> simplified(const std::vector<std::uint32_t>& counts) const {
    return simplify_surface(positions, triangles, group, counts, RunContext{});
  }
  /// Cleaned, and otherwise as it is.
  ProxySurface surface() const { return simplified({0xffffffffu}).front(); }
};

inline Soup soup_of(const Mesh& m) {
  Soup soup{m.positions, {}, {}};
  for (std::uint32_t t = 0; t < m.triangles.size(); ++t)
    soup.triangles.push_back({m.position_of(t, 0), m.position_of(t, 1), m.position_of(t, 2)});
  return soup;
}

/// Rows of quads that are closed or open along both sides; point(i, j) for row i and column j.
template <class Point>
Soup quad_rows(std::uint32_t rows, std::uint32_t columns, Point point) {
  Soup soup;
  for (std::uint32_t i = 0; i <= rows; ++i)
    for (std::uint32_t j = 0; j <= columns; ++j) soup.positions.push_back(point(i, j));
  for (std::uint32_t i = 0; i < rows; ++i)
    for (std::uint32_t j = 0; j < columns; ++j) {
      const std::uint32_t a = i * (columns + 1) + j, b = a + 1, c = a + columns + 1, d = c + 1;
      soup.triangles.push_back({a, b, d});
      soup.triangles.push_back({a, d, c});
    }
  return soup;
}

/// Radii 1 and 0.4. Seams are closed by equal positions, as files have them.
inline Soup torus(std::uint32_t rows, std::uint32_t columns) {
  return quad_rows(rows, columns, [&](std::uint32_t i, std::uint32_t j) {
    const double a = 6.283185307179586 * (i % rows) / rows, b = 6.283185307179586 * (j % columns) / columns;
    const double r = 1 + 0.4 * std::cos(b);
    return to_float(Vec3d{r * std::cos(a), 0.4 * std::sin(b), r * std::sin(a)});
  });
}

/// A strip of one side: its triangles cannot all be wound alike.
inline Soup moebius_strip(std::uint32_t rows) {
  return quad_rows(rows, 4, [&](std::uint32_t i, std::uint32_t j) {
    const std::uint32_t column = i == rows ? 4 - j : j;
    const double a = 6.283185307179586 * (i % rows) / rows, width = (column - 2.0) * 0.2;
    const double r = 1 + width * std::cos(a / 2);
    return to_float(Vec3d{r * std::cos(a), width * std::sin(a / 2), r * std::sin(a)});
  });
}

/// Pages that share one edge, the spine.
inline Soup book(std::uint32_t pages) {
  Soup soup{{{0, 0, 0}, {0, 1, 0}}, {}, {}};
  for (std::uint32_t i = 0; i < pages; ++i) {
    const double a = 6.283185307179586 * i / pages;
    soup.positions.push_back(to_float(Vec3d{std::cos(a), 0.5, std::sin(a)}));
    soup.triangles.push_back(i % 2 == 0 ? Triangle{0, 1, i + 2} : Triangle{1, 0, i + 2});
  }
  return soup;
}

}  // namespace texmesh::testing
