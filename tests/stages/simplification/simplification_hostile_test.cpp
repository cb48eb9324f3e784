// What is wrong with scans, or meant to be: conditioned and simplified, nothing of it may break what every
// result keeps.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>

#include "format/base/errors.h"
#include "stages/simplification/simplification.h"
#include "tests/stages/simplification/simplification_checks.h"
#include "tests/support/hostile_meshes.h"

namespace texmesh::simplification_hostile_test {

using namespace testing;  // NOLINT: fixtures and checks

TEST(SimplificationHostile, SliversOfNextToNoArea) {
  const ConditionedMesh mesh = condition(sliver_sheet(24));
  double least = 1;
  for (const Triangle& t : mesh.mesh.triangles) {
    const auto at = [&](std::size_t k) {
      return to_double(mesh.mesh.positions[mesh.mesh.wedge_position[t[k]]]);
    };
    least = std::min(least, length(cross(at(1) - at(0), at(2) - at(0))) / 2);
  }
  ASSERT_LT(least, 1e-12);
  const NestedScales scales = run(mesh);
  expect_sound(scales);
  EXPECT_LT(scales.scales.back().position_count, mesh.mesh.positions.size() / 4);
}

TEST(SimplificationHostile, FarFromTheOriginNothingChanges) {
  Mesh near = bumpy_sphere(24, 36), far = near;
  for (std::size_t p = 0; p < near.positions.size(); ++p)
    for (int k = 0; k < 3; ++k) {
      near.positions[p][k] = std::floor(near.positions[p][k] * 512) / 512;
      far.positions[p][k] = near.positions[p][k] + 8192 * static_cast<float>(k + 1) / 4;
    }
  far.origin = {1e7, -2e7, 3e6};
  const NestedScales a = run(condition(near)), b = run(condition(far));
  expect_sound(b);
  ASSERT_EQ(a.scales.size(), b.scales.size());
  for (std::size_t i = 0; i < a.scales.size(); ++i) EXPECT_EQ(a.scales[i].triangles, b.scales[i].triangles);
  EXPECT_EQ(extract_scale(b, b.scales.back()).origin, far.origin);
}

TEST(SimplificationHostile, DuplicatedFaces) {
  Mesh m = bumpy_sphere(20, 30);
  const NestedScales clean = run(condition(m));
  repeat_triangles(m);
  const NestedScales doubled = run(condition(m));
  ASSERT_EQ(clean.scales.size(), doubled.scales.size());
  for (std::size_t i = 0; i < clean.scales.size(); ++i)
    EXPECT_EQ(clean.scales[i].triangles, doubled.scales[i].triangles);
  Mesh decal = bumpy_sphere(20, 30);  // copies of another material stay, and move with what is under them
  repeat_triangles(decal);
  for (std::size_t t = decal.triangles.size() / 2; t < decal.triangles.size(); ++t)
    decal.triangle_material[t] = 1;
  const NestedScales both = run(condition(decal));
  expect_sound(both);
  EXPECT_LT(both.scales.back().triangles.size(), both.scales[0].triangles.size() / 4);
}

TEST(SimplificationHostile, InsideOutComponents) {
  const Mesh m = bumpy_sphere(16, 24);
  const NestedScales scales = run(condition(side_by_side({m, inside_out(m)})));
  expect_sound(scales);
  EXPECT_LT(scales.scales.back().triangles.size(), scales.scales[0].triangles.size() / 8);
  Mesh patched = bumpy_sphere(16, 24);  // a patch of one component the wrong way round
  for (std::size_t t = 100; t < 180; ++t) std::swap(patched.triangles[t][1], patched.triangles[t][2]);
  expect_sound(run(condition(patched)));
}

TEST(SimplificationHostile, SoupOfRandomTriangles) {
  for (int round = 0; round < 20; ++round) {
    Random random{static_cast<std::uint64_t>(round) + 1};
    const ConditionedMesh soup = condition(random_soup(random, 30, 150));
    expect_sound(run(soup, {.max_error = 1, .min_triangles = 1}));
    expect_sound(run(soup, {.order = CollapseOrder::kTouching, .max_error = 1, .min_triangles = 1}), true,
                 true);
  }
}

TEST(SimplificationHostile, NothingToShowIsAnError) {
  const std::vector<Triangle> faces{{0, 1, 2}, {2, 1, 3}, {0, 2, 3}};
  EXPECT_THROW(condition(bare_mesh({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}, {1, 2, 3}}, faces)), StageError);
  EXPECT_THROW(condition(bare_mesh({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {4, 4, 4}}, faces)), StageError);
  const float inf = std::numeric_limits<float>::infinity();
  EXPECT_THROW(condition(bare_mesh({{inf, 0, 0}, {1, inf, 1}, {2, 2, inf}, {-inf, 4, 4}}, faces)),
               StageError);
}

TEST(SimplificationHostile, OneTriangleFarFromAll) {
  const NestedScales scales = run(
      condition(bare_mesh({{1e30f, 0, 0}, {0, 1e30f, 0}, {0, 0, 1e30f}}, {{0, 1, 2}})), {.min_triangles = 1});
  expect_sound(scales);
  EXPECT_EQ(scales.scales.size(), 1u);
}

TEST(SimplificationHostile, HubOfAWideFan) {
  // The middle of a disc with as many corners as the rim has points; quadratic time would show at once.
  const std::uint32_t n = std::getenv("TEXMESH_FULL") ? 500'000 : 10'000;
  std::vector<Vec3f> points{{0, 0, 0}};
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i < n; ++i) {
    const double turn = 2 * 3.14159265358979 * i / n;
    points.push_back(to_float(Vec3d{std::cos(turn), std::sin(turn), 0.01 * std::sin(40 * turn)}));
    triangles.push_back({0, i + 1, (i + 1) % n + 1});
  }
  const NestedScales scales = run(condition(bare_mesh(points, triangles)), {.coarsest = 0.01});
  EXPECT_LT(scales.scales.back().triangles.size(), n / 20);
  EXPECT_EQ(count_edges(scales, scales.scales.back()).border, scales.scales.back().triangles.size());
}

TEST(SimplificationHostile, DustVanishes) {
  const int count = std::getenv("TEXMESH_FULL") ? 1'000'000 : 20'000;
  const ConditionedMesh mesh = condition(dust(count, 0.001f));
  ASSERT_EQ(mesh.component_count, static_cast<std::uint32_t>(count));
  const NestedScales scales = run(mesh, {.coarsest = 0.01});
  const NestedScale& last = scales.scales.back();
  EXPECT_LE(last.position_count, 3u * static_cast<std::uint32_t>(count) / 100 + 3);
  EXPECT_EQ(last.position_count, 3 * last.triangles.size());
  EXPECT_EQ(last.triangle_source[0], 0u);  // the largest stays
  // A hundredth of the dust is left: what has vanished is far from it, however small it was.
  EXPECT_GT(last.error_max, 0.05f);
  EXPECT_GT(last.error_rms, 0.02f);
  EXPECT_LE(last.deviation, 0.0025f);
  for (const Collapse& c : scales.collapses) ASSERT_EQ(c.from, c.to);
}

/// Pebbles that the map lets go at once: packages need scales between all of them and the last few.
TEST(SimplificationHostile, GravelHasScalesBetween) {
  std::vector<Mesh> pebbles;
  Random random{5};
  for (int i = 0; i < 500; ++i) {
    pebbles.push_back(bumpy_sphere(5, 8));
    for (Vec3f& p : pebbles.back().positions) p = p * 0.01f;
  }
  Mesh gravel = side_by_side(pebbles, 0);
  const std::size_t each = pebbles[0].positions.size();
  for (std::size_t p = 0; p < gravel.positions.size(); p += each) {
    const Vec3f from = gravel.positions[p];
    const Vec3f to{static_cast<float>(random.uniform()), static_cast<float>(random.uniform()),
                   static_cast<float>(random.uniform())};
    for (std::size_t i = 0; i < each; ++i) gravel.positions[p + i] = gravel.positions[p + i] - from + to;
  }
  const ConditionedMesh mesh = condition(gravel);
  ScaleMap map;
  map.scales = 20;
  map.persistence.assign(mesh.mesh.positions.size(), 0);
  const NestedScales scales = simplify(mesh, map, {}, kOneThread);
  expect_sound(scales);
  ASSERT_GE(scales.scales.size(), 5u);  // S_0, the last and three between
  for (std::size_t k = 1; k < scales.scales.size(); ++k)
    EXPECT_GT(scales.scales[k].position_count, 0.24 * scales.scales[k - 1].position_count)
        << scales.scales[k].scale << " after " << scales.scales[k - 1].scale
        << scales.scales[k - 1].floor_reason;
  EXPECT_EQ(scales.scales.back().position_count, 400u);
  // Where few scales are left the last is met all the same.
  map.scales = 2;
  EXPECT_EQ(simplify(mesh, map, {}, kOneThread).scales.back().position_count, 400u);
}

TEST(Simplification, SmallComponentsVanishWhereTheScaleIsCoarserThanThey) {
  std::vector<Mesh> meshes{bumpy_sphere(32, 48)};
  for (int i = 0; i < 6; ++i) {
    meshes.push_back(cube());
    for (Vec3f& p : meshes.back().positions) p = p * (0.004f + 0.003f * static_cast<float>(i));
  }
  const ConditionedMesh mesh = condition(side_by_side(meshes, 0.05f));
  const auto components_left = [&](const NestedScales& scales, const NestedScale& s) {
    std::set<std::uint32_t> left;
    for (const Triangle& t : s.triangles) left.insert(mesh.component[scales.mesh.wedge_position[t[0]]]);
    return left;
  };
  const NestedScales scales = run(mesh);
  expect_sound(scales);
  std::size_t before = 7;
  for (const NestedScale& s : scales.scales) {
    const auto left = components_left(scales, s);
    EXPECT_TRUE(left.count(0));
    EXPECT_LE(left.size(), before);
    before = left.size();
  }
  EXPECT_EQ(before, 1u);
  // Every removed position has one record; those of a component that vanished name themselves, one after the
  // other.
  std::set<std::uint32_t> vanished;
  for (std::size_t i = 0; i < scales.collapses.size(); ++i) {
    const Collapse& c = scales.collapses[i];
    if (c.from != c.to) continue;
    const std::uint32_t component = mesh.component[c.from];
    EXPECT_TRUE(vanished.insert(component).second ||
                (scales.collapses[i - 1].from == scales.collapses[i - 1].to &&
                 mesh.component[scales.collapses[i - 1].from] == component));
  }
  EXPECT_EQ(vanished.size(), 6u);
  const NestedScales kept = run(mesh, {.max_error = 0.0005});
  EXPECT_EQ(components_left(kept, kept.scales.back()).size(), 7u);
  const NestedScales thesis = run(mesh, {.order = CollapseOrder::kThesis});
  EXPECT_EQ(components_left(thesis, thesis.scales.back()).size(), 7u);
}

/// Seams that wind across a flat sheet: their charts may not creep over one another.
TEST(Simplification, SeamsStayWhereTheyAre) {
  const int n = 40;
  Mesh m = sheet(n, 0), charts = m;
  charts.wedge_position.clear(), charts.uv0.clear(), charts.normals.clear(), charts.colours.clear();
  const auto left = [](double x, double y) { return x < 0.5 + 0.12 * std::sin(9 * y); };
  std::map<std::pair<std::uint32_t, bool>, std::uint32_t> ids;
  for (Triangle& t : charts.triangles) {
    Vec3f middle{};
    for (std::uint32_t w : t) middle = middle + m.positions[m.wedge_position[w]] * (1.0f / 3);
    const bool chart = left(static_cast<double>(middle.x), static_cast<double>(middle.y));
    for (std::uint32_t& w : t) {
      const auto [at, fresh] = ids.try_emplace({w, chart}, charts.wedge_position.size());
      if (fresh) {
        charts.wedge_position.push_back(m.wedge_position[w]);
        charts.uv0.push_back({m.uv0[w].x + (chart ? 0.f : 2.f), m.uv0[w].y});
      }
      w = at->second;
    }
  }
  const ConditionedMesh mesh = condition(charts);
  const auto astray = [&](double weight) {  // area that belongs to the other chart
    SimplificationOptions options;
    options.seam_weight = weight;
    const NestedScales scales = run(mesh, options);
    expect_sound(scales, true);
    double area = 0;
    for (const Triangle& t : scales.scales.back().triangles) {
      const bool chart = scales.mesh.uv0[t[0]].x < 1.5f;
      const auto at = [&](std::size_t k) {
        return to_double(scales.mesh.positions[scales.mesh.wedge_position[t[k]]]);
      };
      const double whole = length(cross(at(1) - at(0), at(2) - at(0))) / 2;
      int wrong = 0, all = 0;
      for (int i = 0; i < 20; ++i)
        for (int j = 0; i + j < 20; ++j, ++all) {
          const Vec3d p = at(0) * ((i + 0.3) / 20) + at(1) * ((j + 0.3) / 20) + at(2) * ((19.4 - i - j) / 20);
          wrong += left(p.x, p.y) != chart;
        }
      area += whole * wrong / all;
    }
    return area;
  };
  const double loose = astray(0), held = astray(1);
  EXPECT_LT(held, 0.03);
  EXPECT_LT(held, loose / 2);
}

/// A flat sheet whose normals bend in one half only keeps more vertices there when normals count.
TEST(Simplification, NormalsGuideTheCollapse) {
  Mesh m = sheet(30, 0);
  m.uv0.clear();
  m.normals.clear();
  for (std::uint32_t p : m.wedge_position) {
    const double x = static_cast<double>(m.positions[p].x), bend = x > 0.5 ? std::sin(20 * x) : 0;
    m.normals.push_back(to_float(normalized(Vec3d{bend, 0, 1})));
  }
  const ConditionedMesh mesh = condition(m);
  const auto right_share = [&](double weight) {
    SimplificationOptions options;
    options.normal_weight = weight;
    options.persistence_weight = 0;
    const NestedScales scales = run(mesh, options);
    expect_sound(scales, true);
    const Mesh middle = extract_scale(scales, scales.scales[scales.scales.size() / 2]);
    double right = 0;
    for (Vec3f p : middle.positions) right += p.x > 0.5f;
    return right / static_cast<double>(middle.positions.size());
  };
  EXPECT_GT(right_share(0.1), 1.2 * right_share(0));
}

/// As normals: alpha is an attribute like the colours, with or without them.
TEST(Simplification, AlphaGuidesTheCollapse) {
  Mesh m = sheet(30, 0);
  m.normals.clear();
  for (std::uint32_t p : m.wedge_position) {
    const double x = static_cast<double>(m.positions[p].x),
                 alpha = x > 0.5 ? 0.5 + 0.5 * std::sin(20 * x) : 1;
    m.colours.push_back({1, 1, 1, static_cast<float>(alpha)});
  }
  const ConditionedMesh mesh = condition(m);
  const auto right_share = [&](double weight) {
    SimplificationOptions options;
    options.colour_weight = weight;
    options.persistence_weight = 0;
    const NestedScales scales = run(mesh, options);
    expect_sound(scales, true);
    const Mesh middle = extract_scale(scales, scales.scales[scales.scales.size() / 2]);
    double right = 0;
    for (Vec3f p : middle.positions) right += p.x > 0.5f;
    return right / static_cast<double>(middle.positions.size());
  };
  EXPECT_GT(right_share(0.1), 1.2 * right_share(0));
}

}  // namespace texmesh::simplification_hostile_test
