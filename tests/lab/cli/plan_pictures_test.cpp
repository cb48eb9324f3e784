#include "lab/cli/plan_pictures.h"

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "tools/extract/package_model.h"
#include "tools/render/rendered_model.h"

namespace texmesh::plan_pictures_test {

PackageReader open_scan() {
  return PackageReader(open_store(std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh"));
}

/// Every fragment of the full-size planes at one rung.
ShownPackage uniform(PackageReader& package, int scale, std::int32_t rung) {
  ShownPackage shown{scale, {}};
  for (const PlaneChoice& choice : full_size(package)) {
    const PlaneTables& t = package.tables().planes[choice.plane];
    const std::int32_t top = static_cast<std::int32_t>(t.rung_count()) - 1;
    shown.planes.push_back({choice, std::vector<std::int32_t>(t.fragment_count(), std::min(rung, top))});
  }
  return shown;
}

TEST(PlanPictures, ShownPlanesAreTheirRungs) {
  PackageReader package = open_scan();
  const TextureInfo& info = package.textures()[0];
  const PlaneTables& t = package.tables().planes[0];
  std::vector<std::int32_t> rungs(t.fragment_count(), -1);
  const std::uint16_t one = t.order[0];
  rungs[one] = 1;
  const Pixels shown = read_shown_plane(package, 0, 0, rungs, {});
  const Pixels whole = read_plane(package, 0, 1, {});
  ASSERT_EQ(shown.data.size(), whole.data.size());
  const std::uint32_t x = one % info.columns * info.fragment_width_px + 5,
                      y = one / info.columns * info.fragment_height_px + 5;
  for (std::uint32_t c = 0; c < info.channels; ++c) EXPECT_EQ(shown.at(x, y)[c], whole.at(x, y)[c]);
  EXPECT_NE(shown.data, whole.data) << "the others are the preview's";
  EXPECT_THROW(read_shown_plane(package, 0, 0, std::vector<std::int32_t>(1), {}), std::invalid_argument);
}

TEST(PlanPictures, LessOfItDiffersMore) {
  PackageReader package = open_scan();
  PlanPictures pictures(package, "", 2, {});
  const int coarsest = package.manifest().scales.back().scale;
  const RenderedFlip best = pictures.measure(uniform(package, 0, 99), 128),
                     low = pictures.measure(uniform(package, 0, 0), 128),
                     preview = pictures.measure(uniform(package, 0, -1), 128),
                     coarse = pictures.measure(uniform(package, coarsest, 0), 128);
  EXPECT_LT(best.whole, 0.002) << "but for what no fragment stores";
  EXPECT_EQ(best.geometry, 0);
  EXPECT_GT(low.whole, best.whole);
  EXPECT_GT(preview.whole, low.whole);
  EXPECT_EQ(coarse.textures, low.textures);
  EXPECT_GT(coarse.geometry, 0);
  EXPECT_GT(coarse.whole, std::max(coarse.geometry, coarse.textures) * 0.9);
  RunContext eight;
  eight.threads = 8;
  EXPECT_EQ(PlanPictures(package, "", 2, eight).measure(uniform(package, coarsest, 0), 128).whole,
            coarse.whole);
}

TEST(PlanPictures, ShowsWhatAPlanDecided) {
  PackageReader package = open_scan();
  DeliveryRequest request;
  request.displayed_px = 128;
  const DeliveryPlan plan = plan_budget(package, request, 100000);
  const ShownPackage shown = shown_by(package, plan, list_of(package, request, plan));
  EXPECT_EQ(shown.scale, plan.scale);
  ASSERT_EQ(shown.planes.size(), plan.planes.size());
  std::size_t fetched = 0;
  for (const ShownPlane& p : shown.planes)
    fetched +=
        static_cast<std::size_t>(std::ranges::count_if(p.rungs, [](std::int32_t r) { return r >= 0; }));
  EXPECT_EQ(fetched, plan.textures.rungs.size() - plan.textures.skipped);
}

TEST(PlanPictures, AProxyIsMeasuredAsItIs) {
  PackageReader package(open_store(std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-proxies.texmesh"));
  DeliveryPlan plan;
  plan.scale = package.manifest().scales.back().scale;
  plan.proxy = 0;
  const ShownPackage shown = shown_by(package, plan, {});
  EXPECT_EQ(shown.proxy, 0u);
  const RenderedFlip measured = PlanPictures(package, "", 2, {}).measure(shown, 128);
  EXPECT_GT(measured.whole, 0);
  const double stated = package.manifest().proxies[0].flip.front();
  EXPECT_NEAR(measured.whole, stated, 0.1) << "two views for the manifest's many";
  EXPECT_EQ(measured.textures, measured.whole);
  EXPECT_EQ(measured.geometry, 0);
  ShownPackage none = shown;
  none.proxy = 99;
  EXPECT_THROW(PlanPictures(package, "", 2, {}).measure(none, 128), InputError);
}

TEST(PlanPictures, AScaleMayHaveLostTheLastTriangleOfATexture) {
  int fewer = 0;
  for (const char* name : {"scan", "nodes", "alpha", "planes"}) {
    SCOPED_TRACE(name);
    PackageReader package(
        open_store(std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-" + name + ".texmesh"));
    const int coarsest = package.manifest().scales.back().scale;
    fewer += bare_scale(package, coarsest, {}).texture_images.size() <
             bare_scale(package, 0, {}).texture_images.size();
    EXPECT_GT(PlanPictures(package, "", 1, {}).measure(uniform(package, coarsest, 0), 64).whole, 0);
  }
  EXPECT_GT(fewer, 0) << "no package tries it";
}

}  // namespace texmesh::plan_pictures_test
