// A proxy's mesh with fewer triangles, in its own atlas.
#include "tools/extract/proxy/proxy_search.h"

#include <gtest/gtest.h>

#include <array>
#include <set>

#include "tests/support/meshes.h"

namespace texmesh::thinner_meshes_test {

using Corner = std::array<float, 5>;

std::set<Corner> corners_of(const Mesh& mesh) {
  std::set<Corner> out;
  for (std::size_t w = 0; w < mesh.wedge_count(); ++w) {
    const Vec3f p = mesh.positions[mesh.wedge_position[w]];
    out.insert({p.x, p.y, p.z, mesh.uv0[w].x, mesh.uv0[w].y});
  }
  return out;
}

TEST(ThinnerMeshes, EachHasFewerTrianglesOfTheSameAtlas) {
  Mesh mesh = testing::bumpy_sphere(30, 60);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    mesh.triangle_material[t] = 2 * t < mesh.triangles.size();
  const std::vector<Mesh> meshes = thinner_meshes(mesh, {});
  ASSERT_EQ(meshes.size(), 8u);
  EXPECT_EQ(meshes[0], mesh);
  const std::set<Corner> corners = corners_of(mesh);
  for (std::size_t k = 1; k < meshes.size(); ++k) {
    const auto before = static_cast<double>(meshes[k - 1].triangles.size()),
               now = static_cast<double>(meshes[k].triangles.size());
    EXPECT_GT(now, 0.65 * before) << k;
    EXPECT_LT(now, 0.9 * before) << k;
    for (const Corner& c : corners_of(meshes[k])) EXPECT_TRUE(corners.contains(c)) << k;
    const std::vector<std::uint16_t>& materials = meshes[k].triangle_material;
    EXPECT_EQ(std::set(materials.begin(), materials.end()).size(), 2u);
  }
}

TEST(ThinnerMeshes, ManyThreadsGiveTheMeshesOfOne) {
  RunContext one, eight;
  one.threads = 1, eight.threads = 8;
  const Mesh mesh = testing::bumpy_sphere(20, 40);
  EXPECT_EQ(thinner_meshes(mesh, one), thinner_meshes(mesh, eight));
}

TEST(ThinnerMeshes, AMeshWithoutAreaIsLeft) {
  Mesh flat = testing::bumpy_sphere(4, 8);
  for (Vec3f& p : flat.positions) p = {1, 1, 1};
  EXPECT_EQ(thinner_meshes(flat, {}), std::vector<Mesh>{flat});
}

}  // namespace texmesh::thinner_meshes_test
