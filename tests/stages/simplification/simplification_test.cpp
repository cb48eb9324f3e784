#include "stages/simplification/simplification.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "format/base/archive.h"
#include "format/base/portable_math.h"
#include "stages/base/run_context.h"
#include "tests/stages/simplification/simplification_checks.h"
#include "tests/support/hostile_meshes.h"
#include "tests/support/meshes.h"

namespace texmesh::simplification_test {

using namespace testing;  // NOLINT: fixtures and checks

Mesh two_material_sphere() {
  Mesh m = testing::sphere(24, 32);
  for (std::size_t t = 0; t < m.triangles.size(); ++t) {
    const Vec3f a = m.positions[m.position_of(static_cast<std::uint32_t>(t), 0)];
    const Vec3f b = m.positions[m.position_of(static_cast<std::uint32_t>(t), 1)];
    const Vec3f c = m.positions[m.position_of(static_cast<std::uint32_t>(t), 2)];
    m.triangle_material[t] = a.y + b.y + c.y > 0 ? 1 : 0;
    m.triangle_part[t] = a.y > 0.9f ? 1 : 0;
  }
  m.part_names = {"body", "cap"};
  return m;
}

/// `pages` sheets that share their left border: a non-manifold spine.
Mesh book(int pages, int n) {
  Mesh m;
  const Mesh page = sheet(n, 0.02f);
  for (int k = 0; k < pages; ++k) {
    const auto base = static_cast<std::uint32_t>(m.positions.size());
    const double turn = 0.7 * k;
    for (const Vec3f p : page.positions)
      m.positions.push_back(to_float(Vec3d{p.x * std::cos(turn), p.y, p.x * (std::sin(turn) + p.z)}));
    for (std::size_t w = 0; w < page.wedge_count(); ++w) {
      m.wedge_position.push_back(base + page.wedge_position[w]);
      m.uv0.push_back({page.uv0[w].x + static_cast<float>(k), page.uv0[w].y});
    }
    for (Triangle t : page.triangles) m.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  }
  m.triangle_material.assign(m.triangles.size(), 0);
  m.triangle_part.assign(m.triangles.size(), 0);
  m.part_names = {"book"};
  return m;
}

TEST(Simplification, KeepsEveryPropertyOnClosedSurfaces) {
  const NestedScales scales = run(condition(bumpy_sphere(32, 48)));
  expect_sound(scales);
  EXPECT_GE(scales.scales.size(), 8u);
  EXPECT_LT(scales.scales.back().triangles.size(), scales.scales[0].triangles.size() / 20);
  EXPECT_EQ(count_edges(scales, scales.scales.back()).border, 0u);
}

TEST(Simplification, PartsOfOneMaterialThatShareWedgesAreOneSurface) {
  Mesh m = bumpy_sphere(24, 32);
  const NestedScales whole = run(condition(m));
  for (std::size_t t = 0; t < m.triangles.size(); ++t)
    m.triangle_part[t] = static_cast<std::uint16_t>(t * 5 / m.triangles.size());
  m.part_names = {"a", "b", "c", "d", "e"};
  const NestedScales parts = run(condition(m));
  expect_sound(parts);
  ASSERT_EQ(parts.scales.size(), whole.scales.size());
  for (std::size_t i = 0; i < whole.scales.size(); ++i) {
    EXPECT_EQ(parts.scales[i].triangles, whole.scales[i].triangles);
    EXPECT_EQ(parts.scales[i].triangle_source, whole.scales[i].triangle_source);
  }
  for (std::size_t t = 0; t < m.triangles.size(); ++t) m.triangle_material[t] = m.triangle_part[t];
  EXPECT_NE(run(condition(m)).scales.back().triangles, whole.scales.back().triangles);
}

TEST(Simplification, KeepsBordersOfSheets) {
  const NestedScales scales = run(condition(sheet(24)));
  expect_sound(scales);
  // The four corners are where the border turns; the square keeps its extent at every scale.
  for (const NestedScale& s : scales.scales) {
    const Mesh m = extract_scale(scales, s);
    double area = 0;
    for (const Triangle& t : m.triangles) area += uv_turn(m, t) / 2;
    EXPECT_NEAR(std::fabs(area), 1, 0.02) << "scale " << s.scale;
  }
}

TEST(Simplification, MeetsVertexTargetsWhereNothingLocks) {
  const ConditionedMesh mesh = condition(sheet(40, 0.2f));
  const ScaleMap map = random_scale_map(mesh.mesh.positions.size());
  const NestedScales scales =
      simplify(mesh, map, {.min_triangles = 20, .coarsest = 1, .coarsest_vertices = 0}, kOneThread);
  for (const NestedScale& s : scales.scales) {
    const auto asked = static_cast<std::uint32_t>(std::count_if(
        map.persistence.begin(), map.persistence.end(), [&](std::uint8_t p) { return p >= s.scale; }));
    if (s.floor_reason.empty()) {
      EXPECT_EQ(s.position_count, asked);
    } else {
      EXPECT_GE(s.position_count, asked);
    }
  }
}

TEST(Simplification, CoarsestScaleIsSmallWhereMuchPersists) {
  const ConditionedMesh mesh = condition(sheet(40, 0.1f));
  ScaleMap map = random_scale_map(mesh.mesh.positions.size());
  for (std::size_t p = 0; p < map.persistence.size(); ++p)
    if (p % 3 == 0) map.persistence[p] = 12;
  auto last = [&](double coarsest) {
    const NestedScales scales = simplify(mesh, map, {.min_triangles = 20, .coarsest = coarsest}, kOneThread);
    expect_sound(scales);
    return scales.scales.back();
  };
  EXPECT_GE(last(1).position_count, mesh.mesh.positions.size() / 3);
  EXPECT_EQ(last(0.05).position_count, std::lround(0.05 * static_cast<double>(mesh.mesh.positions.size())));
  EXPECT_EQ(last(0.05).scale, 12);
}

TEST(Simplification, CoarsestScaleHasEnoughVerticesForAFirstPicture) {
  const ConditionedMesh mesh = condition(sheet(60, 0.1f));  // 3721 positions
  const ScaleMap map = random_scale_map(mesh.mesh.positions.size(), 20);
  const auto coarsest = [&](int vertices) {
    const NestedScales scales =
        simplify(mesh, map, {.min_triangles = 20, .coarsest_vertices = vertices}, kOneThread);
    expect_sound(scales);
    return scales.scales.back().position_count;
  };
  EXPECT_LT(coarsest(0), 60u);
  EXPECT_EQ(coarsest(100), 100u);
  EXPECT_EQ(coarsest(400), 186u);  // a 20th of them is less
}

TEST(Simplification, CubeOfTwelveTrianglesStaysAsItIs) {
  const NestedScales scales = run(condition(testing::cube()));
  expect_sound(scales);
  EXPECT_EQ(scales.scales.size(), 1u);
}

TEST(Simplification, SingleTriangle) {
  Mesh m = sheet(1);
  m.triangles.resize(1), m.triangle_material.resize(1), m.triangle_part.resize(1);
  const NestedScales scales = run(condition(m), {.min_triangles = 1});
  ASSERT_EQ(scales.scales.size(), 1u);
  EXPECT_EQ(scales.scales[0].triangles.size(), 1u);
}

TEST(Simplification, MeshWithoutUv) {
  Mesh m = bumpy_sphere(20, 30);
  m.uv0.clear();
  const NestedScales scales = run(condition(m));
  expect_sound(scales);
  EXPECT_GE(scales.scales.size(), 5u);
}

TEST(Simplification, SeveralComponentsStay) {
  const NestedScales scales =
      run(condition(testing::side_by_side({bumpy_sphere(16, 24), sheet(12), testing::cube()})));
  expect_sound(scales);
  const Mesh m = extract_scale(scales, scales.scales.back());
  std::vector<int> seen(3);
  for (Vec3f p : m.positions) ++seen[p.x < 2.3f ? 0 : p.x < 3.6f ? 1 : 2];
  for (int n : seen) EXPECT_GT(n, 2);
}

TEST(Simplification, BordersOfMaterialsAndPartsMoveTogether) {
  const NestedScales scales = run(condition(two_material_sphere()));
  expect_sound(scales);
  EXPECT_GE(scales.scales.size(), 4u);
  for (const NestedScale& s : scales.scales) {
    const Mesh m = extract_scale(scales, s);
    double share[2] = {0, 0};
    for (std::size_t t = 0; t < m.triangles.size(); ++t) {
      const auto i = static_cast<std::uint32_t>(t);
      const Vec3f a = m.positions[m.position_of(i, 0)];
      share[m.triangle_material[t]] += length(cross(to_double(m.positions[m.position_of(i, 1)] - a),
                                                    to_double(m.positions[m.position_of(i, 2)] - a)));
    }
    EXPECT_NEAR(share[1] / (share[0] + share[1]), 0.5, 0.08) << "scale " << s.scale;
  }
}

TEST(Simplification, NonManifoldSpineNeitherCracksNorSpreads) {
  const ConditionedMesh mesh = condition(book(3, 12));
  const NestedScales scales = run(mesh);
  expect_sound(scales);
  bool twins = false;
  for (std::size_t p = 0; p < scales.twin.size(); ++p) twins = twins || scales.twin[p] != p;
  ASSERT_TRUE(twins);
  // The spine itself shrinks: its positions go together, one from each page.
  const EdgeCounts first = count_edges(scales, scales.scales[0]),
                   last = count_edges(scales, scales.scales.back());
  EXPECT_EQ(first.non_manifold, 12u);
  EXPECT_LT(last.non_manifold, 12u);
  EXPECT_GE(last.non_manifold, 1u);
}

TEST(Simplification, DoubledSheetStaysDoubled) {
  Mesh m = sheet(10, 0.1f);
  const std::size_t n = m.triangles.size();
  for (std::size_t t = 0; t < n; ++t)
    m.triangles.push_back({m.triangles[t][0], m.triangles[t][2], m.triangles[t][1]});
  m.triangle_material.resize(2 * n), m.triangle_part.resize(2 * n);
  expect_sound(run(condition(m)));
}

TEST(Simplification, RelaxedJunctionsOnlyRepeatAttributes) {
  // Many small charts: every second vertex is a junction, so little could go without relaxation.
  Mesh m = bumpy_sphere(24, 36);
  Mesh charts = m;
  charts.wedge_position.clear(), charts.uv0.clear(), charts.normals.clear();
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> ids;
  for (std::size_t t = 0; t < m.triangles.size(); ++t) {
    const auto chart = static_cast<std::uint32_t>(t / 8);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t w = m.triangles[t][k];
      const auto [it, fresh] =
          ids.try_emplace({w, chart}, static_cast<std::uint32_t>(charts.wedge_position.size()));
      if (fresh) {
        charts.wedge_position.push_back(m.wedge_position[w]);
        charts.uv0.push_back({m.uv0[w].x + static_cast<float>(chart), m.uv0[w].y});
      }
      charts.triangles[t][k] = it->second;
    }
  }
  const ConditionedMesh conditioned = condition(charts);
  const NestedScales scales = run(conditioned);
  expect_sound(scales);
  EXPECT_GT(scales.mesh.wedge_count(), conditioned.mesh.wedge_count());
  EXPECT_LT(scales.scales.back().position_count, m.positions.size() * 3 / 4);
}

TEST(Simplification, ErrorsGrowAndStopAtTheLimit) {
  const ConditionedMesh mesh = condition(bumpy_sphere(32, 48, 0.1f));
  const NestedScales free = run(mesh), strict = run(mesh, {.max_error = 0.002});
  for (std::size_t k = 1; k < free.scales.size(); ++k)
    EXPECT_GT(free.scales[k].error_rms, 0.9f * free.scales[k - 1].error_rms);
  EXPECT_GT(strict.scales.back().position_count, free.scales.back().position_count);
  EXPECT_LT(strict.scales.back().error_rms, free.scales.back().error_rms);
  const Vec3f size{2.3f, 2.3f, 2.3f};
  for (const NestedScale& s : strict.scales) EXPECT_LE(s.error_max, 0.002f * length(size));
  ASSERT_FALSE(strict.notes.empty());
  EXPECT_EQ(strict.notes[0].code, "scale-floor");
  EXPECT_NE(strict.notes[0].text.find("max_error"), std::string::npos);
  // Whether collapses ran out or whole scales were left out: the coarsest one says what stopped it.
  const NestedScales middle = run(mesh, {.max_error = 0.025});
  ASSERT_GT(middle.scales.size(), 1u);
  EXPECT_NE(middle.scales.back().floor_reason.find("max_error"), std::string::npos);
}

TEST(Simplification, QuadricsBeatTheLiteralThesisOrder) {
  const ConditionedMesh mesh = condition(bumpy_sphere(40, 60, 0.08f));
  const NestedScales ours = run(mesh), thesis = run(mesh, {.order = CollapseOrder::kThesis});
  expect_sound(thesis);
  const ScaleMap map = random_scale_map(mesh.mesh.positions.size());
  std::size_t applied = 0;
  for (const NestedScale& s : thesis.scales)  // it never removes what persists
    for (; applied < s.collapse_count; ++applied)
      EXPECT_LT(map.persistence[thesis.collapses[applied].from], s.scale);
  EXPECT_LT(ours.scales[3].error_rms, thesis.scales[3].error_rms);
  expect_sound(run(mesh, {.persistence_weight = 0}));
}

/// A hexagon whose middle has been moved a third of the way towards one of its corners.
Mesh hexagon_around(std::uint32_t near) {
  std::vector<Vec3f> points;
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i < 6; ++i) {
    const double a = 2 * portable::kPi * i / 6;
    points.push_back(to_float(Vec3d{portable::cos(a), portable::sin(a), 0}));
    triangles.push_back({6, i, (i + 1) % 6});
  }
  points.push_back(points[near] * (1 / 3.0f));
  return bare_mesh(std::move(points), std::move(triangles));
}

TEST(Simplification, ThesisOrderMergesIntoTheClosestNeighbour) {
  for (std::uint32_t near = 0; near < 6; ++near) {
    const ConditionedMesh mesh = condition(hexagon_around(near));
    ASSERT_EQ(mesh.mesh.positions.size(), 7u);
    ScaleMap map;
    map.scales = 1;
    map.persistence = {1, 1, 1, 1, 1, 1, 0};
    const NestedScales scales = simplify(
        mesh, map,
        {.order = CollapseOrder::kThesis, .max_error = 1, .min_triangles = 1, .coarsest_vertices = 0},
        kOneThread);
    ASSERT_EQ(scales.collapses.size(), 1u);
    EXPECT_EQ(mesh.position_source[scales.collapses[0].from], 6u);
    EXPECT_EQ(mesh.position_source[scales.collapses[0].to], near);
  }
}

TEST(Simplification, PersistentVerticesStayLonger) {
  const ConditionedMesh mesh = condition(bumpy_sphere(32, 48));
  const ScaleMap map = random_scale_map(mesh.mesh.positions.size());
  auto mean_left = [&](double weight) {
    SimplificationOptions options{.persistence_weight = weight};
    const NestedScales scales = simplify(mesh, map, options, kOneThread);
    std::vector<bool> gone(map.persistence.size());
    const std::size_t half = map.persistence.size() / 2;
    for (std::size_t i = 0; i < std::min(half, scales.collapses.size()); ++i)
      gone[scales.collapses[i].from] = true;
    double sum = 0, count = 0;
    for (std::size_t p = 0; p < gone.size(); ++p)
      if (!gone[p]) sum += map.persistence[p], ++count;
    return sum / count;
  };
  EXPECT_GT(mean_left(0.5), mean_left(0));
}

TEST(Simplification, ColoursGuideTheCollapseWhereThereIsNoTexture) {
  Mesh m = sheet(30, 0);
  m.uv0.clear();
  for (std::uint32_t p : m.wedge_position) {
    const float c = m.positions[p].x < 0.5f ? 0.f : 1.f;
    m.colours.push_back({c, c, c, 1});
  }
  SimplificationOptions options{.min_triangles = 60};
  const ConditionedMesh mesh = condition(m);
  const NestedScales scales =
      simplify(mesh, random_scale_map(mesh.mesh.positions.size(), 20), options, kOneThread);
  double wrong = 0;  // area that spans both colours away from the line between them
  const Mesh coarse = extract_scale(scales, scales.scales.back());
  for (const Triangle& t : coarse.triangles) {
    float lo = 1, hi = 0, left = 1, right = 0;
    for (std::uint32_t w : t) {
      lo = std::min(lo, coarse.colours[w].x), hi = std::max(hi, coarse.colours[w].x);
      left = std::min(left, coarse.positions[coarse.wedge_position[w]].x);
      right = std::max(right, coarse.positions[coarse.wedge_position[w]].x);
    }
    if (hi > lo) wrong = std::max<double>(wrong, right - left);
  }
  EXPECT_LT(scales.scales.back().triangles.size(), 100u);
  EXPECT_LT(wrong, 0.15);
}

TEST(Simplification, ExtractDropsWhatIsUnused) {
  const NestedScales scales = run(condition(two_material_sphere()));
  const NestedScale& s = scales.scales.back();
  const Mesh m = extract_scale(scales, s);
  EXPECT_EQ(m.positions.size(), s.position_count);
  EXPECT_EQ(m.triangles.size(), s.triangles.size());
  EXPECT_EQ(m.uv0.size(), m.wedge_count());
  EXPECT_EQ(m.normals.size(), m.wedge_count());
  EXPECT_EQ(m.part_names, scales.mesh.part_names);
  for (std::size_t t = 0; t < m.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(m.positions[m.wedge_position[m.triangles[t][k]]],
                scales.mesh.positions[scales.mesh.wedge_position[s.triangles[t][k]]]);
      EXPECT_EQ(m.uv0[m.triangles[t][k]], scales.mesh.uv0[s.triangles[t][k]]);
    }
  EXPECT_EQ(extract_scale(scales, scales.scales[0]).triangles.size(), scales.mesh.triangles.size());
}

TEST(Simplification, SameBytesForAnyNumberOfThreads) {
  const ConditionedMesh mesh = condition(bumpy_sphere(24, 36));
  const ScaleMap map = random_scale_map(mesh.mesh.positions.size());
  RunContext eight;
  eight.threads = 8;
  EXPECT_EQ(encode_artefact(simplify(mesh, map, {}, kOneThread)),
            encode_artefact(simplify(mesh, map, {}, eight)));
}

TEST(Simplification, RefusesAScaleMapOfAnotherMesh) {
  const ConditionedMesh mesh = condition(testing::cube());
  EXPECT_THROW(simplify(mesh, random_scale_map(7), {}, kOneThread), StageError);
}

TEST(Simplification, TheThesisKnowsNoBoundOfTheError) {
  const ConditionedMesh mesh = condition(bumpy_sphere(40, 60, 0.08f));
  SimplificationOptions tight{.order = CollapseOrder::kThesis, .max_error = 0.0001, .max_shift = 0.0001};
  const NestedScales bounded = run(mesh, tight);
  tight.max_error = tight.max_shift = 1;
  const NestedScales free = run(mesh, tight);
  ASSERT_EQ(bounded.scales.size(), free.scales.size());
  EXPECT_EQ(bounded.scales.back().position_count, free.scales.back().position_count);
  EXPECT_GT(bounded.scales.back().error_max, 0.0001f * 3);
}

}  // namespace texmesh::simplification_test
