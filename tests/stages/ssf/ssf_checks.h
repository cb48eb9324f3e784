#pragma once
// Runs of the stage, and a relief as a range grid and as a mesh, for the tests of ssf.
#include <algorithm>
#include <cstdint>
#include <vector>

#include "format/base/archive.h"
#include "format/base/portable_math.h"
#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/ssf/ssf.h"

namespace texmesh::testing {

inline ConditionedMesh conditioned(const Mesh& m) { return condition_mesh(m, true, {}, RunContext{}); }

inline ScaleMap run(const Mesh& m, const SsfOptions& options = {}, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return filter_scale_space(conditioned(m), options, context);
}

inline std::vector<std::uint8_t> bytes(const ScaleMap& map) {
  ArchiveWriter writer;
  writer(map);
  return writer.finish();
}

inline std::size_t at_least(const ScaleMap& map, int scale) {
  return static_cast<std::size_t>(
      std::count_if(map.persistence.begin(), map.persistence.end(), [&](int p) { return p >= scale; }));
}

/// Rows around the y axis with r(alpha, y) = 1 + relief, as a range scanner gives them; open at both ends.
inline RangeGrid relief_grid(std::uint32_t columns, std::uint32_t rows, double amplitude) {
  RangeGrid g;
  g.columns = columns;
  g.rows = rows;
  g.alpha_step_rad = static_cast<float>(2 * portable::kPi / columns);
  g.y_step = 3.0f / static_cast<float>(rows);
  for (std::uint32_t y = 0; y < rows; ++y)
    for (std::uint32_t x = 0; x < columns; ++x) {
      const double a = 2 * portable::kPi * x / columns, h = 3.0 * y / rows;
      g.radius.push_back(static_cast<float>(1 + amplitude * (portable::sin(6 * a) * portable::sin(4 * h) +
                                                             0.6 * portable::sin(3 * a + 5 * h))));
      g.position.push_back(y * columns + x);
    }
  return g;
}

inline Mesh mesh_of(const RangeGrid& g) {
  Mesh m;
  for (std::uint32_t y = 0; y < g.rows; ++y)
    for (std::uint32_t x = 0; x < g.columns; ++x) {
      const double r = g.radius[y * g.columns + x], a = double{g.alpha_step_rad} * x;
      m.positions.push_back(
          to_float(Vec3d{r * portable::cos(a), -double{g.y_step} * y, r * portable::sin(a)}));
      m.wedge_position.push_back(y * g.columns + x);
    }
  for (std::uint32_t y = 0; y + 1 < g.rows; ++y)
    for (std::uint32_t x = 0; x < g.columns; ++x) {
      const std::uint32_t a = y * g.columns + x, b = y * g.columns + (x + 1) % g.columns, c = a + g.columns,
                          d = b + g.columns;
      m.triangles.push_back({a, b, d});
      m.triangles.push_back({a, d, c});
    }
  m.triangle_material.assign(m.triangles.size(), 0);
  m.triangle_part.assign(m.triangles.size(), 0);
  m.part_names = {"part"};
  return m;
}

/// The triangles of a mesh as the heat kernel takes them.
struct Surface {
  std::vector<Vec3d> points;
  std::vector<std::uint32_t> corners;
  double mean_edge = 0;
};

inline Surface surface_of(const Mesh& m) {
  Surface s;
  for (Vec3f p : m.positions) s.points.push_back(to_double(p));
  for (std::uint32_t t = 0; t < m.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      s.corners.push_back(m.position_of(t, k));
      s.mean_edge += length(s.points[m.position_of(t, k)] - s.points[m.position_of(t, (k + 1) % 3)]);
    }
  s.mean_edge /= static_cast<double>(s.corners.size());
  return s;
}

}  // namespace texmesh::testing
