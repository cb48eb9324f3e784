#include "stages/geometry/scale_frames.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "stages/geometry/triangle_tree.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

/// A bumpy sphere, and as scale 1 one of a third of its rings and segments.
struct Nest {
  NestedScales scales;
  Nest() {
    constexpr std::uint32_t kRings = 48, kSegments = 72, kStep = 3;
    Mesh& m = scales.mesh = testing::bumpy_sphere(kRings, kSegments, 0.06f);
    NestedScale fine, coarse;
    fine.triangles = m.triangles;
    for (std::uint32_t t = 0; t < m.triangles.size(); ++t) fine.triangle_source.push_back(t);
    // Positions of the sphere are found by where they are: the next kept one takes each of the others.
    std::vector<std::uint32_t> kept;
    for (std::uint32_t p = 0; p < m.positions.size(); p += kStep * kStep) kept.push_back(p);
    std::vector<std::uint32_t> to(m.positions.size());
    for (std::uint32_t p = 0; p < to.size(); ++p) {
      float least = std::numeric_limits<float>::infinity();
      for (const std::uint32_t k : kept) {
        const Vec3f d = m.positions[p] - m.positions[k];
        if (const float far = dot(d, d); far < least) least = far, to[p] = k;
      }
      if (to[p] != p) scales.collapses.push_back({p, to[p], 0});
    }
    std::vector<std::uint32_t> wedge(m.positions.size(), 0);
    for (std::uint32_t w = 0; w < m.wedge_count(); ++w) wedge[m.wedge_position[w]] = w;
    for (std::uint32_t t = 0; t < m.triangles.size(); ++t) {
      Triangle moved;
      for (std::size_t k = 0; k < 3; ++k) moved[k] = wedge[to[m.wedge_position[m.triangles[t][k]]]];
      if (moved[0] == moved[1] || moved[1] == moved[2] || moved[2] == moved[0]) continue;
      coarse.triangles.push_back(moved);
      coarse.triangle_source.push_back(t);
    }
    coarse.scale = 1;
    coarse.collapse_count = static_cast<std::uint32_t>(scales.collapses.size());
    scales.scales = {fine, coarse};
  }
};

/// Mean square difference between S_0's normals and those of the scale where it is nearest.
double normal_error(const NestedScales& scales, const std::vector<Vec3f>& normals) {
  const Mesh& m = scales.mesh;
  std::vector<Vec3d> points;
  for (const std::uint32_t p : m.wedge_position) points.push_back(to_double(m.positions[p]));
  const std::vector<Triangle>& triangles = scales.scales[1].triangles;
  const TriangleTree tree(points, triangles);
  double sum = 0;
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {
    const TriangleTree::Nearest found = tree.nearest(points[w]);
    Vec3d n;
    for (std::size_t k = 0; k < 3; ++k)
      n = n + to_double(normals[triangles[found.triangle][k]]) * found.weight[k];
    const Vec3d d = normalized(n) - to_double(m.normals[w]);
    sum += dot(d, d);
  }
  return sum / static_cast<double>(m.wedge_count());
}

TEST(ScaleFrames, TheFinestScaleKeepsItsOwn) {
  const Nest nest;
  const ScaleFrames frames = scale_frames(nest.scales, 0, {});
  EXPECT_EQ(frames.normals, nest.scales.mesh.normals);
  EXPECT_TRUE(frames.tangents.empty());
}

TEST(ScaleFrames, LightsACoarseScaleMoreLikeTheFinest) {
  const Nest nest;
  const ScaleFrames frames = scale_frames(nest.scales, 1, {});
  EXPECT_LT(normal_error(nest.scales, frames.normals),
            0.8 * normal_error(nest.scales, nest.scales.mesh.normals));
}

TEST(ScaleFrames, NormalsAreUnitAndTangentsAtRightAngles) {
  Nest nest;
  Mesh& m = nest.scales.mesh;
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {
    const Vec3f n = m.normals[w];
    const Vec3f t = to_float(normalized(cross(Vec3d{0.3, 1, 0.2}, to_double(n))));
    m.tangents.push_back({t.x, t.y, t.z, w % 5 == 0 ? 0.0f : w % 2 ? 1.0f : -1.0f});
  }
  const ScaleFrames frames = scale_frames(nest.scales, 1, {});
  std::size_t changed = 0;
  for (const Triangle& triangle : nest.scales.scales[1].triangles)
    for (const std::uint32_t w : triangle) {
      const Vec3f n = frames.normals[w];
      const Vec4f t = frames.tangents[w];
      EXPECT_NEAR(dot(n, n), 1, 1e-5);
      EXPECT_EQ(t.w, m.tangents[w].w);
      changed += n != m.normals[w];
      if (t.w == 0) continue;
      EXPECT_NEAR(t.x * n.x + t.y * n.y + t.z * n.z, 0, 1e-5);
      EXPECT_NEAR(t.x * t.x + t.y * t.y + t.z * t.z, 1, 1e-5);
    }
  EXPECT_GT(changed, 0u);
}

TEST(ScaleFrames, SameBitsForAnyThreads) {
  const Nest nest;
  RunContext eight;
  eight.threads = 8;
  EXPECT_EQ(scale_frames(nest.scales, 1, {}).normals, scale_frames(nest.scales, 1, eight).normals);
}

TEST(ScaleFrames, WithoutNormalsThereAreNone) {
  Nest nest;
  nest.scales.mesh.normals.clear();
  EXPECT_TRUE(scale_frames(nest.scales, 1, {}).normals.empty());
  EXPECT_TRUE(lit_scale(nest.scales, 1, {}).normals.empty());
}

TEST(ScaleFrames, VanishedComponentsSayNothing) {
  Nest nest;
  NestedScales& s = nest.scales;
  // A triangle far off with normals of its own; it vanishes.
  const auto first = static_cast<std::uint32_t>(s.mesh.wedge_count());
  const auto position = static_cast<std::uint32_t>(s.mesh.positions.size());
  const std::vector<Vec3f> before = scale_frames(s, 1, {}).normals;
  for (std::uint32_t k = 0; k < 3; ++k) {
    s.mesh.positions.push_back({9, k == 1 ? 1.0f : 0.0f, k == 2 ? 1.0f : 0.0f});
    s.mesh.wedge_position.push_back(position + k);
    s.mesh.uv0.push_back({0, 0});
    s.mesh.normals.push_back({-1, 0, 0});
    s.collapses.push_back({position + k, position + k, 1});
  }
  s.mesh.triangles.push_back({first, first + 1, first + 2});
  s.scales[0].triangles = s.mesh.triangles;
  s.scales[1].collapse_count += 3;
  const std::vector<Vec3f> after = scale_frames(s, 1, {}).normals;
  for (std::size_t w = 0; w < before.size(); ++w) EXPECT_EQ(after[w], before[w]) << w;
}

TEST(ScaleFrames, ALitScaleIsTheExtractedOneWithItsFrames) {
  const Nest nest;
  const Mesh plain = extract_scale(nest.scales, nest.scales.scales[1]), lit = lit_scale(nest.scales, 1, {});
  const ScaleFrames frames = scale_frames(nest.scales, 1, {});
  EXPECT_EQ(lit.positions, plain.positions);
  EXPECT_EQ(lit.triangles, plain.triangles);
  EXPECT_NE(lit.normals, plain.normals);
  for (std::size_t t = 0; t < lit.triangles.size(); ++t)
    EXPECT_EQ(lit.normals[lit.triangles[t][0]], frames.normals[nest.scales.scales[1].triangles[t][0]]);
}

}  // namespace
}  // namespace texmesh
