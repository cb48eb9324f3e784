#include "stages/condition/condition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "stages/base/run_context.h"
#include "tests/support/hostile_meshes.h"

namespace texmesh::condition_test {

using testing::Random;

ConditionedMesh run(const Mesh& m, const ConditionOptions& options = {}, bool by_specification = true) {
  return condition_mesh(m, by_specification, options, RunContext{});
}

/// Every corner on its own, as STL stores triangles.
Mesh exploded(const Mesh& m) {
  Mesh out = m;
  out.positions.clear();
  out.wedge_position.clear();
  out.uv0.clear();
  out.normals.clear();
  for (Triangle& t : out.triangles)
    for (std::uint32_t& w : t) {
      out.wedge_position.push_back(static_cast<std::uint32_t>(out.positions.size()));
      out.positions.push_back(m.positions[m.wedge_position[w]]);
      if (!m.uv0.empty()) out.uv0.push_back(m.uv0[w]);
      if (!m.normals.empty()) out.normals.push_back(m.normals[w]);
      w = out.wedge_position.back();
    }
  return out;
}

/// The promise of ConditionedMesh, checked with maps and sets rather than the code under test.
void expect_manifold(const ConditionedMesh& c) {
  const Mesh& m = c.mesh;
  std::set<std::pair<std::uint32_t, std::uint32_t>> directed;
  std::map<std::uint32_t, std::map<std::uint32_t, std::uint32_t>> link;  // position: next neighbour around it
  for (std::uint32_t t = 0; t < m.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t a = m.position_of(t, k), b = m.position_of(t, (k + 1) % 3),
                          d = m.position_of(t, (k + 2) % 3);
      ASSERT_NE(a, b);
      EXPECT_TRUE(directed.insert({a, b}).second) << "edge " << a << " " << b << " runs twice the same way";
      EXPECT_TRUE(link[a].insert({b, d}).second);
    }
  for (const auto& [p, next] : link) {
    std::set<std::uint32_t> ends;
    for (const auto& [from, to] : next) ends.insert(to);
    std::vector<std::uint32_t> starts;
    for (const auto& [from, to] : next)
      if (!ends.count(from)) starts.push_back(from);
    ASSERT_LE(starts.size(), 1u) << "position " << p << " has several fans";
    std::uint32_t at = starts.empty() ? next.begin()->first : starts[0];
    std::size_t steps = 0;
    for (auto i = next.find(at); i != next.end() && steps < next.size(); i = next.find(i->second)) ++steps;
    EXPECT_EQ(steps, next.size()) << "position " << p << " has several fans";
  }
  EXPECT_EQ(link.size(), m.positions.size()) << "unused positions";
  std::set<std::uint32_t> used;
  for (const Triangle& t : m.triangles) used.insert(t.begin(), t.end());
  EXPECT_EQ(used.size(), m.wedge_count()) << "unused wedges";
}

/// What a viewer sees: per triangle its points and attributes, in the input's order.
void expect_same_look(const Mesh& in, const ConditionedMesh& c) {
  ASSERT_EQ(c.triangle_source.size(), c.mesh.triangles.size());
  EXPECT_TRUE(std::is_sorted(c.triangle_source.begin(), c.triangle_source.end()));
  for (std::size_t t = 0; t < c.mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t w = in.triangles[c.triangle_source[t]][k], v = c.mesh.triangles[t][k];
      EXPECT_EQ(in.positions[in.wedge_position[w]], c.mesh.positions[c.mesh.wedge_position[v]]);
      EXPECT_TRUE(in.uv0.empty() || in.uv0[w] == c.mesh.uv0[v]);
      EXPECT_TRUE(in.normals.empty() || in.normals[w] == c.mesh.normals[v]);
    }
  for (std::size_t p = 0; p < c.mesh.positions.size(); ++p) {
    EXPECT_EQ(c.mesh.positions[p], in.positions[c.position_source[p]]);
    EXPECT_EQ(c.mesh.positions[p], c.mesh.positions[c.twin[p]]);
    EXPECT_EQ(c.twin[c.twin[p]], c.twin[p]);
    EXPECT_LE(c.twin[p], p);
    EXPECT_EQ(c.component[p], c.component[c.twin[p]]);
  }
}

TEST(Condition, CleanMeshStaysAsItIs) {
  // The sphere's fixture has a wedge at each pole that no triangle uses; condition drops those.
  for (const Mesh& m : {testing::cube(), run(testing::sphere(8, 12)).mesh, testing::sheet(5)}) {
    const ConditionedMesh c = run(m);
    EXPECT_EQ(c.mesh, m);
    EXPECT_TRUE(c.notes.empty());
    EXPECT_EQ(c.component_count, 1u);
    EXPECT_EQ(c.report.welded_positions + c.report.welded_wedges + c.report.unused_positions, 0u);
    expect_manifold(c);
  }
  EXPECT_EQ(run(testing::cube()).report.boundary_edges, 0u);
  EXPECT_EQ(run(testing::sheet(5)).report.boundary_edges, 20u);
}

TEST(Condition, WeldsASoupBackTogether) {
  const Mesh m = testing::sphere(8, 12);
  Mesh soup = exploded(m);
  for (Vec3f& p : soup.positions) {
    if (p.x == 0) p.x = -0.0f;
    if (p.y == 0) p.y = static_cast<float>(&p - soup.positions.data()) > 100 ? -0.0f : 0.0f;
  }
  const ConditionedMesh c = run(soup);
  EXPECT_EQ(c.mesh.positions.size(), m.positions.size());
  // The poles have a wedge per segment in the fixture, of which only those in use come through the soup.
  EXPECT_LE(c.mesh.wedge_count(), m.wedge_count());
  EXPECT_EQ(c.report.boundary_edges, 0u);
  EXPECT_EQ(c.report.welded_positions, soup.positions.size() - m.positions.size());
  expect_manifold(c);
  expect_same_look(soup, c);
}

TEST(Condition, WeldDistanceClosesCracks) {
  Mesh soup = exploded(testing::cube());
  Random random{7};
  for (Vec3f& p : soup.positions)
    p = p + Vec3f{static_cast<float>(random.uniform()), static_cast<float>(random.uniform()),
                  static_cast<float>(random.uniform())} *
                1e-5f;
  EXPECT_EQ(run(soup).mesh.positions.size(), 36u);
  const ConditionedMesh c = run(soup, {.weld_distance = 1e-4});
  EXPECT_EQ(c.mesh.positions.size(), 8u);
  EXPECT_EQ(c.report.boundary_edges, 0u);
  expect_manifold(c);
}

TEST(Condition, WeldDistanceNeverJoinsWhatIsFartherApart) {
  Random random{11};
  Mesh m = testing::bare_mesh({}, {});
  for (std::uint32_t i = 0; i < 3000; ++i) {
    m.positions.push_back({static_cast<float>(random.uniform()), static_cast<float>(random.uniform()),
                           static_cast<float>(random.uniform() * 0.02)});
    m.wedge_position.push_back(i);
  }
  for (std::uint32_t i = 0; i + 2 < 3000; i += 3) m.triangles.push_back({i, i + 1, i + 2});
  m.triangle_material.assign(1000, 0);
  m.triangle_part.assign(1000, 0);
  const ConditionedMesh c = run(m, {.weld_distance = 0.001});
  EXPECT_GT(c.report.welded_positions, 0u);
  const double limit = 0.001 * 1.42;
  for (std::uint32_t a = 0; a < c.mesh.positions.size(); ++a)
    for (std::uint32_t b = a + 1; b < c.mesh.positions.size(); ++b)
      EXPECT_TRUE(c.twin[a] == c.twin[b] || length(c.mesh.positions[a] - c.mesh.positions[b]) > limit * 0.99);
  for (std::size_t t = 0; t < c.mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_LT(
          length(c.mesh.positions[c.mesh.position_of(static_cast<std::uint32_t>(t), static_cast<int>(k))] -
                 m.positions[m.triangles[c.triangle_source[t]][k]]),
          limit * 1.01);
}

TEST(Condition, DropsDegeneratesAndDuplicates) {
  Mesh m = testing::cube();
  const Mesh clean = m;
  const auto add = [&](Triangle t) {
    m.triangles.push_back(t);
    m.triangle_material.push_back(0);
    m.triangle_part.push_back(0);
  };
  add({0, 0, 1});
  add({0, 1, 0});
  const Triangle first = m.triangles[0];
  add({first[1], first[2], first[0]});
  const ConditionedMesh c = run(m);
  EXPECT_EQ(c.mesh, clean);
  EXPECT_EQ(c.report.degenerate_triangles, 2u);
  EXPECT_EQ(c.report.duplicate_triangles, 1u);
  ASSERT_EQ(c.notes.size(), 2u);
  EXPECT_EQ(c.notes[0].severity, Severity::kWarning);
}

TEST(Condition, KeepsACopyWithAnotherMaterial) {
  Mesh m = testing::cube();
  m.triangles.push_back(m.triangles[0]);
  m.triangle_material.push_back(1);
  m.triangle_part.push_back(0);
  const ConditionedMesh c = run(m);
  EXPECT_EQ(c.mesh.triangles.size(), 13u);
  EXPECT_EQ(c.mesh.positions.size(), 11u);
  EXPECT_EQ(c.component_count, 1u);
  expect_manifold(c);
  expect_same_look(m, c);
}

TEST(Condition, SliverStaysWhereItClosesACrack) {
  // A square whose left half has a vertex in the middle of the diagonal that its right half has not.
  const std::vector<Vec3f> points{{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {1, 1, 0}};
  const ConditionedMesh c = run(testing::bare_mesh(points, {{0, 1, 2}, {0, 2, 4}, {0, 4, 3}, {4, 2, 3}}));
  EXPECT_EQ(c.report.slivers_kept, 1u);
  EXPECT_EQ(c.report.boundary_edges, 4u);
  expect_manifold(c);
  // The same sliver at the rim: nothing gapes without it.
  const ConditionedMesh rim = run(testing::bare_mesh(points, {{0, 1, 2}, {0, 2, 4}}));
  EXPECT_EQ(rim.report.degenerate_triangles, 1u);
  EXPECT_EQ(rim.mesh.triangles.size(), 1u);
}

TEST(Condition, TwoSidedSheetIsSplitIntoItsSides) {
  Mesh m = testing::sheet(4);
  const std::size_t n = m.triangles.size(), points = m.positions.size();
  for (std::size_t t = 0; t < n; ++t) {
    const Triangle a = m.triangles[t];
    m.triangles.push_back({a[0], a[2], a[1]});
    m.triangle_material.push_back(0);
    m.triangle_part.push_back(0);
  }
  const ConditionedMesh c = run(m);
  EXPECT_EQ(c.mesh.triangles.size(), 2 * n);
  EXPECT_EQ(c.mesh.positions.size(), 2 * points);
  EXPECT_EQ(c.component_count, 1u);
  expect_manifold(c);
  expect_same_look(m, c);
  const ConditionedMesh one =
      run(testing::bare_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 1}}));
  EXPECT_EQ(one.mesh.positions.size(), 6u);
}

TEST(Condition, SplitsBowTies) {
  const ConditionedMesh c = run(
      testing::bare_mesh({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {-1, 0, 0}, {-1, -1, 0}}, {{0, 1, 2}, {0, 3, 4}}));
  EXPECT_EQ(c.report.split_bow_ties, 1u);
  EXPECT_EQ(c.mesh.positions.size(), 6u);
  EXPECT_EQ(c.twin[5], 0u);
  EXPECT_EQ(c.position_source[5], 0u);
  EXPECT_EQ(c.component_count, 1u);
  expect_manifold(c);
}

TEST(Condition, SplitsThreeLeavesAndOpposedFaces) {
  const std::vector<Vec3f> points{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {-1, 0.5f, 0}, {-1, -0.5f, 0}};
  const ConditionedMesh leaves = run(testing::bare_mesh(points, {{0, 1, 2}, {1, 0, 3}, {1, 0, 4}}));
  EXPECT_EQ(leaves.report.non_manifold_edges_found, 1u);
  EXPECT_EQ(leaves.report.split_non_manifold_edges, 1u);
  EXPECT_EQ(leaves.mesh.positions.size(), 7u);
  expect_manifold(leaves);
  // Two faces of one edge that disagree on what is front.
  const ConditionedMesh opposed = run(testing::bare_mesh(points, {{0, 1, 2}, {0, 1, 3}}));
  EXPECT_EQ(opposed.report.non_manifold_edges_found, 0u);
  EXPECT_EQ(opposed.report.split_non_manifold_edges, 1u);
  EXPECT_EQ(opposed.mesh.positions.size(), 6u);
  expect_manifold(opposed);
}

TEST(Condition, FourLeavesKeepTheFlatPairs) {
  // Two sheets crossing along an edge: each goes on through the other.
  const ConditionedMesh c =
      run(testing::bare_mesh({{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}},
                             {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}, {1, 0, 5}}));
  EXPECT_EQ(c.mesh.positions.size(), 8u);
  EXPECT_EQ(c.mesh.position_of(0, 0), c.mesh.position_of(1, 1));
  EXPECT_EQ(c.mesh.position_of(2, 0), c.mesh.position_of(3, 1));
  EXPECT_NE(c.mesh.position_of(0, 0), c.mesh.position_of(2, 0));
  expect_manifold(c);
}

TEST(Condition, AnySoupBecomesManifold) {
  Random random{3};
  for (int round = 0; round < 400; ++round) {
    const std::uint32_t points = 4 + random.next() % 8, triangles = 1 + random.next() % 40;
    const Mesh m = testing::random_soup(random, points, triangles, 5);
    try {
      const ConditionedMesh c = run(m);
      expect_manifold(c);
      expect_same_look(m, c);
    } catch (const StageError&) {
      for (std::uint32_t i = 0; i < triangles; ++i) {
        const auto corner = [&](std::size_t k) { return m.positions[m.triangles[i][k]]; };
        const Vec3f a = corner(0), b = corner(1), d = corner(2);
        EXPECT_EQ(cross(b - a, d - a), Vec3f{});
      }
    }
    if (HasFatalFailure() || HasNonfatalFailure()) FAIL() << "round " << round;
  }
}

TEST(Condition, DropsWhatIsNotFinite) {
  Mesh m = testing::sphere(8, 12);
  m.positions[0].x = std::numeric_limits<float>::quiet_NaN();
  m.uv0[30].y = std::numeric_limits<float>::infinity();
  m.normals[31] = {};
  m.normals[32] = {0, 3, 0};
  const ConditionedMesh c = run(m);
  EXPECT_EQ(c.report.non_finite_triangles, 12u);
  EXPECT_EQ(c.report.repaired_wedges, 2u);
  EXPECT_EQ(c.report.boundary_edges, 12u);
  expect_manifold(c);
  for (Vec2f uv : c.mesh.uv0) EXPECT_TRUE(std::isfinite(uv.x) && std::isfinite(uv.y));
  for (Vec3f n : c.mesh.normals) EXPECT_NEAR(length(n), 1, 1e-5);
}

TEST(Condition, RefusesWhatShowsNothing) {
  EXPECT_THROW(run(testing::bare_mesh({}, {})), StageError);
  EXPECT_THROW(run(testing::bare_mesh({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}})), StageError);
  EXPECT_THROW(run(testing::bare_mesh({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}},
                                      {{0, 1, 2}, {1, 0, 3}, {2, 1, 3}, {0, 2, 3}})),
               StageError);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(run(testing::bare_mesh({{nan, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}})), StageError);
  EXPECT_THROW(run(testing::bare_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 3}})), StageError);
  Mesh bad = testing::cube();
  bad.wedge_position[3] = 8;
  EXPECT_THROW(run(bad), StageError);
  bad = testing::cube();
  bad.uv0.pop_back();
  EXPECT_THROW(run(bad), StageError);
}

TEST(Condition, NormalsPolicy) {
  Mesh m = run(testing::sphere(16, 24)).mesh;
  const std::vector<Vec3f> own = m.normals;
  EXPECT_EQ(run(m, {.normals = NormalsPolicy::kSmooth}).mesh.normals, own);
  m.normals.clear();
  EXPECT_TRUE(run(m).mesh.normals.empty());
  EXPECT_TRUE(run(m, {.normals = NormalsPolicy::kKeep}, false).mesh.normals.empty());
  const Mesh smooth = run(m, {}, false).mesh;
  ASSERT_EQ(smooth.normals.size(), smooth.wedge_count());
  EXPECT_EQ(smooth.wedge_position, m.wedge_position);
  for (std::size_t w = 0; w < own.size(); ++w) EXPECT_GT(dot(smooth.normals[w], own[w]), 0.95f);
}

TEST(Condition, ComponentsCountSurfacesThatTouchAsOne) {
  Mesh m = testing::side_by_side({testing::cube(), testing::sphere(6, 8), testing::sheet(2)});
  const ConditionedMesh c = run(m);
  EXPECT_EQ(c.component_count, 3u);
  EXPECT_TRUE(std::is_sorted(c.component.begin(), c.component.end()));
  // Two cubes that share a face: the hull goes on from one to the other, the two hidden faces stand alone.
  const ConditionedMesh touching = run(testing::side_by_side({testing::cube(), testing::cube()}, 0));
  EXPECT_EQ(touching.component_count, 1u);
  EXPECT_EQ(touching.mesh.positions.size(), 20u);
  expect_manifold(touching);
}

}  // namespace texmesh::condition_test
