#include "stages/skeletonization/skeletonization.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <thread>

#include "format/base/archive.h"
#include "format/base/portable_math.h"
#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/skeletonization/curve_skeleton.h"
#include "tests/support/hostile_meshes.h"
#include "tests/support/meshes.h"

namespace texmesh::skeletonization_test {

using testing::bare_mesh;
using testing::Random;

/// Coarser than the defaults: the shapes here are plain, and a wrap's time grows with the square.
const SkeletonizationOptions kQuick{.alpha_divisor = 40, .max_wrap_faces = 5000};

Skeleton run(const Mesh& m, const SkeletonizationOptions& options = kQuick, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return skeletonize(condition_mesh(m, true, {}, RunContext{}), options, context);
}

std::vector<std::uint8_t> bytes(const Skeleton& s) {
  ArchiveWriter writer;
  writer(s);
  return writer.finish();
}

/// A closed cylinder around the x axis.
Mesh cylinder(float radius, float length, std::uint32_t rings, std::uint32_t segments) {
  std::vector<Vec3f> points;
  for (std::uint32_t i = 0; i <= rings; ++i)
    for (std::uint32_t j = 0; j < segments; ++j) {
      const double a = 2 * portable::kPi * j / segments;
      points.push_back(to_float(Vec3d{length * (double{1} * i / rings - 0.5), radius * portable::cos(a),
                                      radius * portable::sin(a)}));
    }
  const auto left = static_cast<std::uint32_t>(points.size()), right = left + 1;
  points.push_back({-length / 2, 0, 0});
  points.push_back({length / 2, 0, 0});
  std::vector<Triangle> triangles;
  for (std::uint32_t j = 0; j < segments; ++j) {
    const std::uint32_t k = (j + 1) % segments, top = rings * segments;
    for (std::uint32_t i = 0; i < rings; ++i) {
      const std::uint32_t a = i * segments + j, b = i * segments + k, c = a + segments, d = b + segments;
      triangles.push_back({a, b, d});
      triangles.push_back({a, d, c});
    }
    triangles.push_back({left, k, j});
    triangles.push_back({right, top + j, top + k});
  }
  return bare_mesh(std::move(points), std::move(triangles));
}

void expect_sound(const Skeleton& s, std::size_t positions) {
  ASSERT_EQ(s.distance.size(), positions);
  ASSERT_EQ(s.radius.size(), positions);
  ASSERT_FALSE(s.nodes.empty());
  ASSERT_FALSE(s.segments.empty());
  for (const auto& segment : s.segments)
    for (std::uint32_t n : segment) EXPECT_LT(n, s.nodes.size());
  for (std::size_t p = 0; p < positions; ++p) {
    EXPECT_GE(s.distance[p], 0);
    EXPECT_GT(s.radius[p], 0);
    EXPECT_GE(s.radius[p], s.distance[p]);
    EXPECT_TRUE(std::isfinite(s.radius[p]));
  }
}

TEST(Skeletonization, CylinderHasItsAxis) {
  const Mesh m = cylinder(0.5f, 6, 60, 32);
  const Skeleton s = run(m);
  expect_sound(s, m.positions.size());
  EXPECT_FALSE(s.fallback_centroid);
  EXPECT_TRUE(s.notes.empty());
  for (Vec3f n : s.nodes) EXPECT_LT(std::hypot(n.y, n.z), 0.15f);
  for (std::size_t p = 0; p + 2 < m.positions.size(); ++p) {
    if (std::fabs(m.positions[p].x) > 2) continue;
    EXPECT_NEAR(s.distance[p], 0.5f, 0.1f);
  }
}

/// A torus around the y axis.
Mesh torus(double ring, double tube, std::uint32_t around, std::uint32_t across) {
  std::vector<Vec3f> points;
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i < around; ++i)
    for (std::uint32_t j = 0; j < across; ++j) {
      const double a = 2 * portable::kPi * i / around, b = 2 * portable::kPi * j / across;
      const double r = ring + tube * portable::cos(b);
      points.push_back(to_float(Vec3d{r * portable::cos(a), tube * portable::sin(b), r * portable::sin(a)}));
      const std::uint32_t right = (i + 1) % around * across, up = (j + 1) % across, p = i * across + j;
      triangles.push_back({p, i * across + up, right + up});
      triangles.push_back({p, right + up, right + j});
    }
  return bare_mesh(std::move(points), std::move(triangles));
}

/// Errors of R over the vertices that `counts`, as parts of the true one.
struct RadiusError {
  double largest = 0, rms = 0, mean = 0;
};
template <class Counts>
RadiusError radius_error(const Mesh& m, const Skeleton& s, double radius, const Counts& counts) {
  RadiusError e;
  double n = 0;
  for (std::size_t p = 0; p < m.positions.size(); ++p) {
    if (!counts(m.positions[p])) continue;
    const double error = static_cast<double>(s.distance[p]) / radius - 1;
    e.largest = std::max(e.largest, std::fabs(error));
    e.rms += error * error;
    e.mean += error;
    ++n;
  }
  e.rms = std::sqrt(e.rms / n);
  e.mean /= n;
  return e;
}

TEST(Skeletonization, CylindersHaveTheirRadiusWithinOnePercent) {
  for (const float radius : {0.3f, 0.5f, 0.8f}) {
    const Mesh m = cylinder(radius, 6, 60, 48);
    const RadiusError e =
        radius_error(m, run(m, {}), radius, [&](Vec3f p) { return std::fabs(p.x) < 3 - 1.5f * radius; });
    EXPECT_LT(e.largest, 0.01) << radius;
    EXPECT_LT(std::fabs(e.mean), 0.001) << radius;
  }
}

TEST(Skeletonization, ToriHaveTheirRadiusWithinFivePercent) {
  for (const double tube : {0.2, 0.35, 0.5}) {
    const Mesh m = torus(1, tube, 96, 40);
    const RadiusError e = radius_error(m, run(m, {}), tube, [](Vec3f) { return true; });
    EXPECT_LT(std::fabs(e.mean), 0.002) << tube;
    EXPECT_LT(e.rms, 0.02) << tube;
    EXPECT_LT(e.largest, 0.03) << tube;
  }
}

TEST(Skeletonization, SphereHasItsRadius) {
  const Mesh m = testing::sphere(24, 36);
  const Skeleton s = run(m);
  expect_sound(s, m.positions.size());
  EXPECT_FALSE(s.fallback_centroid);
  std::vector<float> sorted = s.distance;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_NEAR(sorted[sorted.size() / 2], 1, 0.25f);
}

TEST(Skeletonization, ScalesAndMovesWithTheObject) {
  Mesh m = cylinder(0.5f, 6, 20, 16);
  const Skeleton small = run(m);
  for (Vec3f& p : m.positions) p = p * 4096.0f;
  const Skeleton large = run(m);
  ASSERT_EQ(small.nodes.size(), large.nodes.size());
  for (std::size_t p = 0; p < small.distance.size(); ++p)
    EXPECT_FLOAT_EQ(small.distance[p] * 4096, large.distance[p]);
  // Moved, the coordinates round differently, and so does everything behind them; the shape stays, but for
  // how far the skeleton reaches towards the flat ends.
  const std::vector<Vec3f> before = m.positions;
  for (Vec3f& p : m.positions) p = p + Vec3f{16384, 0, -8192};
  const Skeleton moved = run(m);
  for (std::size_t p = 0; p < small.distance.size(); ++p)
    if (std::fabs(before[p].x) < 2 * 4096) EXPECT_NEAR(moved.distance[p], large.distance[p], 0.15 * 2048);
}

TEST(Skeletonization, RadiusHasAFloor) {
  const Skeleton s = run(testing::bumpy_sphere(24, 36, 0.1f), {.alpha_divisor = 40, .radius_floor = 0.9});
  std::vector<float> sorted = s.distance;
  std::sort(sorted.begin(), sorted.end());
  const float floor = 0.9f * sorted[sorted.size() / 2];
  bool raised = false;
  for (std::size_t p = 0; p < s.distance.size(); ++p) {
    EXPECT_FLOAT_EQ(s.radius[p], std::max(s.distance[p], floor));
    raised = raised || s.radius[p] > s.distance[p];
  }
  EXPECT_TRUE(raised);
}

TEST(Skeletonization, NeverFails) {
  const Mesh one = bare_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  expect_sound(run(one), 3);
  expect_sound(run(testing::sheet(12)), 13 * 13);
  expect_sound(run(testing::sheet(12, 0)), 13 * 13);
  Mesh tiny = testing::cube();
  for (Vec3f& p : tiny.positions) p = p * 1e-4f;
  const Mesh several =
      testing::side_by_side({testing::cube(), testing::sheet(4), tiny, testing::sphere(8, 12)}, 3);
  expect_sound(run(several), several.positions.size());
  Random random{17};
  Mesh soup = bare_mesh({}, {});
  for (std::uint32_t i = 0; i < 300; ++i) {
    soup.positions.push_back({static_cast<float>(random.uniform()), static_cast<float>(random.uniform()),
                              static_cast<float>(random.uniform())});
    soup.wedge_position.push_back(i);
    if (i % 3 == 2) soup.triangles.push_back({i - 2, i - 1, i});
  }
  soup.triangle_material.assign(100, 0);
  soup.triangle_part.assign(100, 0);
  expect_sound(run(soup), 300);
  Mesh huge = testing::cube();
  for (Vec3f& p : huge.positions) p = p * 1e30f;
  expect_sound(run(huge), 8);
  Mesh needle = testing::cube();
  for (Vec3f& p : needle.positions) p = {p.x * 1e6f, p.y * 1e-6f, p.z * 1e-6f};
  expect_sound(run(needle), 8);
}

TEST(Skeletonization, SameBytesForAnyThreadCountAndEveryRun) {
  const Mesh m = testing::side_by_side({testing::bumpy_sphere(24, 36, 0.1f), testing::cube()}, 1);
  const std::vector<std::uint8_t> first = bytes(run(m));
  // Other heap addresses: nothing may be ordered by pointers.
  const std::vector<std::vector<int>> ballast(1000, std::vector<int>(37));
  EXPECT_EQ(first, bytes(run(m)));
  EXPECT_EQ(first, bytes(run(m, kQuick, 8)));
}

TEST(Skeletonization, ContractionRefusesWhatIsNotClosed) {
  EXPECT_THROW(contract_to_skeleton({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}), std::exception);
  EXPECT_THROW(contract_to_skeleton({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2}, {0, 1, 3}}}),
               std::exception);
}

TEST(Skeletonization, WhatCgalWouldNotEndOnIsGivenUp) {
  // Coordinates whose products overflow: every ray from a point leaves CGAL undecided, and it would try the
  // next one for ever.
  TriangleSoup soup;
  const Mesh m = testing::bumpy_sphere(10, 14, 0);
  const ConditionedMesh closed = condition_mesh(m, true, {}, RunContext{});
  for (Vec3f p : closed.mesh.positions) soup.points.push_back(to_double(p) * 1e160);
  for (std::uint32_t t = 0; t < closed.mesh.triangles.size(); ++t)
    soup.triangles.push_back(
        {closed.mesh.position_of(t, 0), closed.mesh.position_of(t, 1), closed.mesh.position_of(t, 2)});
  EXPECT_THROW(contract_to_skeleton(soup), std::exception);
}

TEST(Skeletonization, AClosedSurfaceOfFewTrianglesIsContractedWithoutAWrap) {
  const SkeletonizationOptions no_wrap{.max_wrap_steps = 1000};
  for (const float radius : {0.3f, 0.5f, 0.8f}) {
    const Mesh m = cylinder(radius, 6, 30, 30);
    const Skeleton s = run(m, no_wrap);
    expect_sound(s, m.positions.size());
    EXPECT_TRUE(s.notes.empty());
    const RadiusError e =
        radius_error(m, s, radius, [&](Vec3f p) { return std::fabs(p.x) < 3 - 1.5f * radius; });
    EXPECT_LT(e.largest, 0.1) << radius;  // 1.9 where triangles get long along it
  }
  Random random{5};
  for (const double noise : {0.1, 0.6}) {  // of surfaces that cross themselves
    Mesh m = testing::bumpy_sphere(24, 36, 0.3f);
    for (Vec3f& p : m.positions) {
      const auto off = [&] { return noise * (random.uniform() * 2 - 1); };
      p = p + to_float(Vec3d{off(), off(), off()});
    }
    expect_sound(run(m), m.positions.size());
  }
}

TEST(Skeletonization, WorkCapsFallBackStepByStep) {
  const Mesh m = testing::side_by_side({testing::bumpy_sphere(24, 36, 0.1f), testing::cube()}, 1);  // wrapped
  const auto codes = [](const Skeleton& s) {
    std::vector<std::string> list;
    for (const Note& n : s.notes)
      if (n.severity == Severity::kWarning) list.push_back(n.code);
    return list;
  };
  EXPECT_TRUE(codes(run(m)).empty());
  // Enough for a coarser wrap only.
  bool coarser = false;
  for (int steps = 64000; steps >= 1000 && !coarser; steps /= 2) {
    const Skeleton s = run(m, {.alpha_divisor = 40, .max_wrap_steps = steps});
    expect_sound(s, m.positions.size());
    coarser = codes(s) == std::vector<std::string>{"skeleton-coarser-wrap"};
  }
  EXPECT_TRUE(coarser);
  // Not even for that.
  const Skeleton none = run(m, {.alpha_divisor = 400, .max_wrap_steps = 1000});
  expect_sound(none, m.positions.size());
  EXPECT_TRUE(none.fallback_centroid);
  EXPECT_EQ(codes(none), std::vector<std::string>{"skeleton-fallback"});
}

/// An open cone of needles around one hub.
Mesh fan(std::uint32_t sides) {
  std::vector<Vec3f> points{{0, 0.3f, 0}};
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i < sides; ++i) {
    const double a = 2 * portable::kPi * i / sides;
    points.push_back(to_float(Vec3d{portable::cos(a), 0, portable::sin(a)}));
    triangles.push_back({0, 1 + i, 1 + (i + 1) % sides});
  }
  return bare_mesh(std::move(points), std::move(triangles));
}

TEST(Skeletonization, NeedlesAroundAHubTakeACoarserWrap) {
  // Steps alone would not say that it takes long: every one of them looks at all needles.
  const Mesh few = fan(60), many = fan(6000);
  const SkeletonizationOptions options{.alpha_divisor = 40, .max_wrap_steps = 150000};
  const Skeleton plain = run(few, options), coarser = run(many, options);
  expect_sound(plain, few.positions.size());
  expect_sound(coarser, many.positions.size());
  EXPECT_TRUE(plain.notes.empty());
  ASSERT_FALSE(coarser.notes.empty());
  EXPECT_EQ(coarser.notes[0].severity, Severity::kWarning);
}

TEST(Skeletonization, AWrapStopsWhenCancelled) {
  const ConditionedMesh mesh = condition_mesh(fan(3000), true, {}, RunContext{});
  std::atomic<bool> cancelled = false;
  RunContext context;
  context.cancelled = &cancelled;
  std::thread later([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    cancelled = true;
  });
  // All of it takes many seconds.
  EXPECT_THROW(skeletonize(mesh, {.alpha_divisor = 400, .max_wrap_steps = 2000000}, context), Cancelled);
  later.join();
}

TEST(Skeletonization, AnOpenBaseDoesNotMakeABowl) {
  // A ball without its cap has the radius of a ball, not that of the wall that a wrap of a bowl would have.
  Mesh m = testing::sphere(24, 36);
  std::erase_if(m.triangles,
                [&](const Triangle& t) { return m.positions[m.wedge_position[t[0]]].y < -0.8f; });
  m.triangle_material.resize(m.triangles.size());
  m.triangle_part.resize(m.triangles.size());
  Skeleton s = run(m);
  std::nth_element(s.distance.begin(),
                   s.distance.begin() + static_cast<std::ptrdiff_t>(s.distance.size() / 2), s.distance.end());
  EXPECT_GT(s.distance[s.distance.size() / 2], 0.6f);
}

TEST(Skeletonization, StopsWhenCancelled) {
  std::atomic<bool> cancelled = true;
  RunContext context;
  context.cancelled = &cancelled;
  EXPECT_THROW(skeletonize(condition_mesh(testing::cube(), true, {}, RunContext{}), {}, context), Cancelled);
}

TEST(SegmentTree, AgreesWithTryingAll) {
  Random random{23};
  const auto point = [&] { return Vec3d{random.uniform(), random.uniform() * 3, random.uniform() * 0.1}; };
  std::vector<Vec3d> nodes;
  std::vector<std::array<std::uint32_t, 2>> segments;
  for (std::uint32_t i = 0; i < 200; ++i) {
    nodes.push_back(point());
    if (i > 0) segments.push_back({random.next() % i, i});
  }
  segments.push_back({7, 7});
  const SegmentTree tree(nodes, segments);
  for (int q = 0; q < 500; ++q) {
    const Vec3d p = point() * 1.5;
    double best = std::numeric_limits<double>::infinity();
    for (const auto& [a, b] : segments)
      for (int step = 0; step <= 2000; ++step)
        best = std::min(best, length(nodes[a] + (nodes[b] - nodes[a]) * (step / 2000.0) - p));
    EXPECT_LE(tree.distance(p), best + 1e-12);
    EXPECT_GE(tree.distance(p), best - 1e-3);
  }
}

}  // namespace texmesh::skeletonization_test
