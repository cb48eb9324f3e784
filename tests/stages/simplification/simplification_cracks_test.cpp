// Meshes as other tools tear them: atlases of many small charts, holes, edges of three and more faces, parts
// and materials that are stored apart and only meet because their borders have the same coordinates.
#include <gtest/gtest.h>

#include <cmath>

#include "stages/simplification/simplification.h"
#include "tests/stages/simplification/simplification_checks.h"
#include "tests/support/hostile_meshes.h"

namespace texmesh::simplification_cracks_test {

using namespace testing;  // NOLINT: fixtures and checks

struct Wounds {
  std::uint32_t chart_faces = 0;  // faces of a row per chart, 0 = one chart
  double holes = 0;               // share of the faces that are missing
  double fins = 0;                // faces of other faces' edges, per face
  std::uint32_t materials = 1, parts = 1;
};

/// The whole mesh again, stored as a soup of primitives: nothing shared between two charts, materials or
/// parts, positions included.
Mesh wounded(const Mesh& whole, const Wounds& wounds) {
  Mesh m;
  Random random{11};
  std::map<std::array<std::uint32_t, 4>, std::uint32_t> ids;  // wedge, chart, material, part
  const std::size_t count = whole.triangles.size();
  auto add = [&](const Triangle& corners, std::uint32_t face) {
    const auto along = static_cast<std::uint32_t>(face * std::size_t{wounds.materials} / count);
    const std::uint32_t part = face / 7 % wounds.parts;
    const std::uint32_t chart = wounds.chart_faces ? face / wounds.chart_faces : 0;
    Triangle t;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [at, fresh] = ids.try_emplace({corners[k], chart, along, part}, m.wedge_position.size());
      t[k] = at->second;
      if (!fresh) continue;
      m.wedge_position.push_back(static_cast<std::uint32_t>(m.positions.size()));
      m.positions.push_back(whole.positions[whole.wedge_position[corners[k]]]);
      const Vec2f uv = whole.uv0[corners[k]];
      m.uv0.push_back({uv.x + static_cast<float>(chart), uv.y + static_cast<float>(along)});
    }
    m.triangles.push_back(t);
    m.triangle_material.push_back(static_cast<std::uint16_t>(along));
    m.triangle_part.push_back(static_cast<std::uint16_t>(part));
  };
  for (std::uint32_t f = 0; f < count; ++f) {
    if (random.uniform() < wounds.holes) continue;
    add(whole.triangles[f], f);
    if (random.uniform() >= wounds.fins) continue;
    const Triangle& t = whole.triangles[f];  // a fin to any third vertex
    const Triangle other = whole.triangles[random.next() % count];
    if (other[0] != t[0] && other[0] != t[1]) add({t[0], t[1], other[0]}, f);
  }
  for (std::uint32_t p = 0; p < wounds.parts; ++p) m.part_names.push_back("part " + std::to_string(p));
  return m;
}

void expect_whole(const Mesh& mesh, double left, const char* name) {
  SCOPED_TRACE(name);
  const ConditionedMesh conditioned = condition(mesh);
  for (CollapseOrder order : {CollapseOrder::kTexmesh, CollapseOrder::kThesis, CollapseOrder::kTouching}) {
    SimplificationOptions options;
    options.order = order;
    const NestedScales scales = run(conditioned, options);
    expect_sound(scales, false, order == CollapseOrder::kTouching);
    ASSERT_GT(scales.scales.size(), 1u);
    if (order != CollapseOrder::kThesis) {
      EXPECT_LT(static_cast<double>(scales.scales.back().triangles.size()),
                left * static_cast<double>(mesh.triangles.size()));
    }
  }
}

TEST(SimplificationCracks, TunnelsCloseWhereSurfacesMayTouch) {
  const ConditionedMesh mesh = condition(sieve(21));
  const NestedScales strict = run(mesh), touching = run(mesh, {.order = CollapseOrder::kTouching});
  expect_sound(strict);
  expect_sound(touching, false, true);
  EXPECT_GT(strict.scales.back().triangles.size(), 1000u);  // 100 tunnels take 10 or more each
  EXPECT_LT(touching.scales.back().triangles.size(), 300u);
  // As long as a collapse is left that keeps the surface, nothing touches.
  EXPECT_EQ(touching.scales[1].triangles, strict.scales[1].triangles);
}

TEST(SimplificationCracks, FragmentedAtlas) {
  expect_whole(wounded(bumpy_sphere(32, 48), {.chart_faces = 24}), 0.3, "charts");
  expect_whole(wounded(bumpy_sphere(32, 48), {.chart_faces = 1}), 0.7, "a chart per face");
}

TEST(SimplificationCracks, HolesAndNonManifoldEdges) {
  const Mesh saxophone = wounded(bumpy_sphere(32, 48), {.chart_faces = 30, .holes = 0.02, .fins = 0.01});
  const ConditionedMesh mesh = condition(saxophone);
  EXPECT_GT(mesh.report.non_manifold_edges_found, 10u);
  EXPECT_GT(mesh.report.boundary_edges, 50u);
  expect_whole(saxophone, 0.5, "saxophone");
}

TEST(SimplificationCracks, MaterialsAndPartsStoredApart) {
  const Mesh helmet = wounded(bumpy_sphere(32, 48), {.materials = 6});
  EXPECT_EQ(condition(helmet).report.boundary_edges, 0u);
  expect_whole(helmet, 0.2, "six materials");
  expect_whole(wounded(sheet(40), {.materials = 3, .parts = 4}), 0.8, "parts");
}

TEST(SimplificationCracks, GroundWithHousesInAnAtlasOfScraps) {
  const Mesh site = side_by_side({wounded(sheet(40, 0.2f), {.chart_faces = 18, .materials = 2}),
                                  wounded(cube(), {}), wounded(bumpy_sphere(12, 16), {.chart_faces = 9})},
                                 -0.2f);
  expect_whole(site, 0.5, "site");
}

TEST(SimplificationCracks, AllAtOnce) {
  for (std::uint32_t round = 1; round <= 4; ++round)
    expect_whole(wounded(bumpy_sphere(20, 30), {.chart_faces = 5 * round,
                                                .holes = 0.01 * round,
                                                .fins = 0.02 * round,
                                                .materials = round,
                                                .parts = 5 - round}),
                 0.95, "all");
}

}  // namespace texmesh::simplification_cracks_test
