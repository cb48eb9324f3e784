#include "stages/proxies/making/nested_rival.h"

#include <gtest/gtest.h>

#include "tests/support/meshes.h"

namespace texmesh::proxies {
namespace {

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

struct RivalWins : ::testing::Test {
  NestedScales scales = alone(testing::bumpy_sphere(20, 40));
  ShownMaterials shown{{RenderMaterial{}}, {}};
  ProxyStudio studio{scales.mesh, shown};
};

TEST_F(RivalWins, WithoutAnyLossWhereTheWholeMeshFits) {
  EXPECT_TRUE(rival_wins(scales, shown, 30000, 0, studio, {}));
}

TEST_F(RivalWins, NeverWhereItsPicturesAreFartherOff) {
  EXPECT_FALSE(rival_wins(scales, shown, 30000, -1e-9, studio, {}));
}

TEST_F(RivalWins, NeverWhereNoScaleFits) {
  EXPECT_FALSE(rival_wins(scales, shown, 4000, 1, studio, {}));
  EXPECT_FALSE(rival_wins(scales, shown, 0, 1, studio, {}));
}

}  // namespace
}  // namespace texmesh::proxies
