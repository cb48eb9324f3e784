#include "stages/geometry/scale_frames.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stages/geometry/triangle_tree.h"
#include "tests/support/meshes.h"

namespace texmesh::scale_frames_test {

/// A wavy sheet, and as scale 1 every fourth of its points: a wave is about four edges of the scale long.
struct Nest {
  NestedScales scales;
  Nest() {
    constexpr std::uint32_t kCells = 48, kStep = 4, kRow = kCells + 1;
    Mesh& m = scales.mesh = testing::sheet(kCells, 0);
    for (Vec3f& p : m.positions) {
      const double a = 20 * static_cast<double>(p.x), b = 17 * static_cast<double>(p.y);
      p.z = static_cast<float>(0.03 * std::sin(a) * std::cos(b));
      const Vec3d up{-0.6 * std::cos(a) * std::cos(b), 0.51 * std::sin(a) * std::sin(b), 1};
      m.normals.push_back(to_float(normalized(up)));
    }
    NestedScale fine, coarse;
    fine.triangles = m.triangles;
    for (std::uint32_t t = 0; t < m.triangles.size(); ++t) fine.triangle_source.push_back(t);
    for (std::uint32_t p = 0; p < m.positions.size(); ++p) {
      const std::uint32_t i = p % kRow, j = p / kRow;
      const auto kept = [](std::uint32_t x) { return (x + kStep / 2) / kStep * kStep; };
      if (const std::uint32_t to = kept(j) * kRow + kept(i); to != p) scales.collapses.push_back({p, to, 0});
    }
    for (std::uint32_t j = 0; j < kCells; j += kStep)
      for (std::uint32_t i = 0; i < kCells; i += kStep) {
        const std::uint32_t a = j * kRow + i, b = a + kStep, c = a + kStep * kRow, d = c + kStep;
        for (const Triangle& t : {Triangle{a, b, d}, Triangle{a, d, c}}) {
          coarse.triangle_source.push_back(static_cast<std::uint32_t>(coarse.triangles.size()));
          coarse.triangles.push_back(t);
        }
      }
    coarse.scale = 1;
    coarse.collapse_count = static_cast<std::uint32_t>(scales.collapses.size());
    scales.scales = {fine, coarse};
  }
};

/// Mean square difference, over the area, between S_0's normals and those of the scale where it is nearest.
double normal_error(const NestedScales& scales, const std::vector<Vec3f>& normals) {
  const Mesh& m = scales.mesh;
  std::vector<Vec3d> points;
  for (const std::uint32_t p : m.wedge_position) points.push_back(to_double(m.positions[p]));
  const std::vector<Triangle>& triangles = scales.scales[1].triangles;
  const TriangleTree tree(points, triangles);
  std::vector<double> area(m.wedge_count(), 0);
  for (const Triangle& t : m.triangles)
    for (const std::uint32_t w : t)
      area[w] += length(cross(points[t[1]] - points[t[0]], points[t[2]] - points[t[0]]));
  double sum = 0, total = 0;
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {
    const TriangleTree::Nearest found = tree.nearest(points[w]);
    Vec3d n;
    for (std::size_t k = 0; k < 3; ++k)
      n = n + to_double(normals[triangles[found.triangle][k]]) * found.weight[k];
    const Vec3d d = normalized(n) - to_double(m.normals[w]);
    sum += area[w] * dot(d, d);
    total += area[w];
  }
  return sum / total;
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
  EXPECT_TRUE(lit_scale(nest.scales, 1, RunContext{}).normals.empty());
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
    s.collapses.push_back(Collapse::with_component(position + k, 1));
  }
  s.mesh.triangles.push_back({first, first + 1, first + 2});
  s.scales[0].triangles = s.mesh.triangles;
  s.scales[1].collapse_count += 3;
  const std::vector<Vec3f> after = scale_frames(s, 1, {}).normals;
  for (std::size_t w = 0; w < before.size(); ++w) EXPECT_EQ(after[w], before[w]) << w;
}

TEST(ScaleFrames, ALitScaleIsTheExtractedOneWithItsFrames) {
  const Nest nest;
  const Mesh plain = extract_scale(nest.scales, nest.scales.scales[1]),
             lit = lit_scale(nest.scales, 1, RunContext{});
  const ScaleFrames frames = scale_frames(nest.scales, 1, {});
  EXPECT_EQ(lit.positions, plain.positions);
  EXPECT_EQ(lit.triangles, plain.triangles);
  EXPECT_NE(lit.normals, plain.normals);
  for (std::size_t t = 0; t < lit.triangles.size(); ++t)
    EXPECT_EQ(lit.normals[lit.triangles[t][0]], frames.normals[nest.scales.scales[1].triangles[t][0]]);
}

}  // namespace texmesh::scale_frames_test
