#include "stages/proxies/make_proxy.h"

#include <gtest/gtest.h>

#include "tests/support/meshes.h"

namespace texmesh::make_proxy_test {

struct Parts {
  Mesh mesh;
  ShownMaterials shown{{RenderMaterial{}}, {}};
  MaterialGroups groups{find_groups(mesh, shown.materials)};
  BakeSource source{mesh, shown, groups};
  CoarseSurfaces surfaces{mesh, groups, 60, static_cast<std::uint32_t>(mesh.triangles.size()), {}};
  ProxyCosts costs{};
};

TEST(CoarseSurfaces, GivesTheFinestSurfaceThatIsCoarseEnough) {
  Parts w{testing::bumpy_sphere(40, 80)};
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

std::optional<MadeProxy> make(Parts& w, int bytes, const ProxyForm& form) {
  auto baked = bake_proxy(w.source, w.groups, w.surfaces, w.costs, bytes, form, {});
  return baked ? finish_proxy(*baked, w.groups, static_cast<std::uint64_t>(bytes), form) : std::nullopt;
}

TEST(MakeProxy, MoreOfTheBytesForTheMeshMeanMoreTrianglesAndFewerTexels) {
  Parts w{testing::bumpy_sphere(60, 120)};
  const auto little = make(w, 20000, {0.4, {}, {}, true}), much = make(w, 20000, {0.7, {}, {}, true});
  ASSERT_TRUE(little && much);
  EXPECT_GT(much->proxy.triangles, little->proxy.triangles);
  EXPECT_LT(much->proxy.textures[0].width_px, little->proxy.textures[0].width_px);
  for (const auto& made : {little, much}) EXPECT_LE(made->proxy.glb.size(), 20400u);
}

TEST(MakeProxy, DracoAndFlatTrianglesHoldMoreTrianglesInTheSameBytes) {
  Parts w{testing::bumpy_sphere(100, 200)};
  const ProxyForm meshopt{0.6, {}, {false, 12}, true}, draco{0.6, {}, {true, 12}, true},
      flat{0.6, {}, {false, 12}, false};
  const auto by_meshopt = make(w, 20000, meshopt), by_draco = make(w, 20000, draco),
             no_normals = make(w, 20000, flat);
  ASSERT_TRUE(by_meshopt && by_draco && no_normals);
  EXPECT_GT(by_draco->proxy.triangles, by_meshopt->proxy.triangles * 3 / 2);
  EXPECT_GT(no_normals->proxy.triangles, by_meshopt->proxy.triangles);
  EXPECT_TRUE(no_normals->shown.mesh.normals.empty());
}

TEST(MakeProxy, WhatTexturesTookTeachesTheNextSide) {
  const auto side_after = [](double factor, int quality) {
    Parts w{testing::bumpy_sphere(60, 120)};
    const ProxyForm form{0.5, {}, {}, true};
    auto made = make(w, 20000, form);
    ProxyTexture& colour = made.value().proxy.textures[0];
    colour.bytes = static_cast<std::uint64_t>(factor * 2.4 / 8 * 0.58 * colour.width_px * colour.height_px);
    made->quality = quality;
    w.costs.texel_bits = texel_bits_of(*made).value();
    return make(w, 20000, form).value().proxy.textures[0].width_px;
  };
  const std::uint32_t as_expected = side_after(1, 50);
  EXPECT_GT(side_after(0.4, 50), as_expected);
  EXPECT_LT(side_after(2.5, 50), as_expected);
  // The same bytes at a better quality say that the middle one takes fewer.
  EXPECT_GT(side_after(1, 90), as_expected);
  EXPECT_EQ(side_after(1e-6, 50), side_after(1e-3, 50)) << "a plain colour's texture has an end";
}

TEST(MakeProxy, NothingWhereEvenTheCoarsestDoesNotFit) {
  Parts w{testing::bumpy_sphere(30, 60)};
  EXPECT_FALSE(make(w, 1500, {}));
}

}  // namespace texmesh::make_proxy_test
