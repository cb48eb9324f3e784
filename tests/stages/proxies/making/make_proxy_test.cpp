#include "stages/proxies/making/make_proxy.h"

#include <gtest/gtest.h>

#include "tests/support/meshes.h"

namespace texmesh::proxies {
namespace {

struct Workshop {
  Mesh mesh;
  ShownMaterials shown{{RenderMaterial{}}, {}};
  MaterialGroups groups{find_groups(mesh, shown.materials)};
  BakeSource source{mesh, shown, groups};
  SurfaceLadder surfaces{mesh, groups, 60, static_cast<std::uint32_t>(mesh.triangles.size()), {}};
  ProxyWorkshop shop{source, groups, surfaces};
};

TEST(SurfaceLadder, GivesTheFinestSurfaceThatIsCoarseEnough) {
  Workshop w{testing::bumpy_sphere(40, 80)};
  double last = 1e9;
  for (const double triangles : {4000.0, 1000.0, 300.0, 100.0}) {
    const ChartedSurface* charted = w.surfaces.at_most(triangles, {});
    ASSERT_NE(charted, nullptr);
    const auto count = static_cast<double>(charted->surface.triangles.size());
    EXPECT_LE(count, triangles);
    EXPECT_GT(count, triangles * 0.75);
    EXPECT_LT(count, last);
    EXPECT_EQ(charted->charts.chart_of.size(), charted->surface.triangles.size());
    last = count;
  }
  EXPECT_EQ(w.surfaces.at_most(1000, {}), w.surfaces.at_most(1000, {})) << "charts are made once";
}

TEST(ProxyWorkshop, MoreOfTheBytesForTheMeshMeanMoreTrianglesAndFewerTexels) {
  Workshop w{testing::bumpy_sphere(60, 120)};
  const auto little = w.shop.make(20000, {0.4, {}}, {}), much = w.shop.make(20000, {0.7, {}}, {});
  ASSERT_TRUE(little && much);
  EXPECT_GT(much->proxy.triangles, little->proxy.triangles);
  EXPECT_LT(much->proxy.textures[0].width_px, little->proxy.textures[0].width_px);
  for (const auto& made : {little, much}) EXPECT_LE(made->proxy.glb.size(), 20400u);
}

TEST(ProxyWorkshop, NothingWhereEvenTheCoarsestDoesNotFit) {
  Workshop w{testing::bumpy_sphere(30, 60)};
  EXPECT_FALSE(w.shop.make(1500, {}, {}));
}

}  // namespace
}  // namespace texmesh::proxies
