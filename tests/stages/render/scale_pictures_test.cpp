#include "stages/render/scale_pictures.h"

#include <gtest/gtest.h>

#include "tests/support/meshes.h"

namespace texmesh::scale_pictures_test {

NestedScales alone(Mesh mesh) {
  NestedScales out;
  out.scales.emplace_back();
  out.scales[0].triangles = mesh.triangles;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) out.scales[0].triangle_source.push_back(t);
  out.mesh = std::move(mesh);
  return out;
}

TEST(WholeMesh, IsSmallWhereItLeavesMostOfTheBytes) {
  const NestedScales scales = alone(testing::sphere(20, 40));
  const double bytes = whole_mesh_bytes(scales);
  EXPECT_GT(bytes, 3000);
  EXPECT_LT(bytes, 6000);
  EXPECT_FALSE(whole_mesh_is_small(scales, static_cast<std::uint64_t>(2.4 * bytes)));
  EXPECT_TRUE(whole_mesh_is_small(scales, static_cast<std::uint64_t>(2.6 * bytes)));
}

TEST(WholeMesh, OfAnAtlasInPiecesIsSmallLater) {
  Mesh mesh = testing::sphere(20, 40);
  Mesh pieces = mesh;
  pieces.wedge_position.clear();
  pieces.uv0.clear();
  pieces.normals.clear();
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k) {
      pieces.triangles[t][k] = static_cast<std::uint32_t>(pieces.wedge_position.size());
      pieces.wedge_position.push_back(mesh.position_of(t, k));
      pieces.uv0.push_back(mesh.uv0[mesh.triangles[t][k]]);
    }
  const NestedScales scales = alone(std::move(pieces));
  const double bytes = whole_mesh_bytes(scales);
  EXPECT_FALSE(whole_mesh_is_small(scales, static_cast<std::uint64_t>(6 * bytes)));
  EXPECT_TRUE(whole_mesh_is_small(scales, static_cast<std::uint64_t>(7 * bytes)));
}

struct Competitors : ::testing::Test {
  NestedScales scales = alone(testing::bumpy_sphere(20, 40));
  ShownMaterials shown{{RenderMaterial{}}, {}};
  ReferenceViews views = reference_views(scales.mesh, shown, kMiddlePx, {});
  CompetingScales competitors{scales, shown, views};
};

TEST_F(Competitors, WinWithoutAnyLossWhereTheWholeMeshFits) {
  EXPECT_TRUE(competitors.win(30000, 0, {}, {}));
}

TEST_F(Competitors, NeverWinWhereTheirPicturesAreFartherOff) {
  EXPECT_FALSE(competitors.win(30000, -1e-9, {}, {}));
}

TEST_F(Competitors, NeverWinWhereNoScaleFits) {
  EXPECT_FALSE(competitors.win(4000, 1, {}, {}));
  EXPECT_FALSE(competitors.win(0, 1, {}, {}));
}

TEST_F(Competitors, TheLikeliestSpeaksForAll) {
  EXPECT_TRUE(competitors.likeliest_wins(30000, 0, {}, {}));
  EXPECT_FALSE(competitors.likeliest_wins(30000, -1e-9, {}, {}));
  EXPECT_FALSE(competitors.likeliest_wins(4000, 1, {}, {}));
}

/// The bytes that hold the whole mesh by the estimate do not pay for it in a plan.
TEST_F(Competitors, PayMoreInPlans) {
  const RivalPrices plans = competitors.prices_in_plans();
  EXPECT_GT(plans.mesh, 1);
  EXPECT_GT(plans.besides, 15000);
  EXPECT_FALSE(competitors.win(30000, 0, plans, {}));
  EXPECT_TRUE(competitors.win(60000, 0, plans, {}));
  const auto least = static_cast<std::uint64_t>(plans.besides + 3000);
  EXPECT_FALSE(competitors.win(least, 1, plans, {})) << "nothing is left for a mesh";
}

/// What was compared with one proxy is known for the next, and half of the views are not taken for all.
TEST_F(Competitors, ManyQuestionsHaveTheAnswersOfOne) {
  NestedScales coarse = alone(testing::sphere(6, 9));  // stands for S_0 and does not look like it
  const auto asked = [&](CompetingScales& of, double flip) { return of.win(30000, flip, {}, {}); };
  CompetingScales all(coarse, shown, views);
  for (const double flip : {1e-4, 0.02, 0.05, 0.1, 0.5, 1e-4}) {
    CompetingScales one(coarse, shown, views);
    EXPECT_EQ(asked(all, flip), asked(one, flip)) << flip;
  }
}

}  // namespace texmesh::scale_pictures_test
