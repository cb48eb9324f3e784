// Objects that share one link and one time limit.
#include "lab/transfer/several_objects.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "tests/format/container/package_fixture.h"

namespace texmesh::several_objects_test {

/// Packages with meshes of 100 kB.
struct Objects {
  std::vector<std::unique_ptr<PackageReader>> packages;
  std::vector<PageObject> list;
  explicit Objects(const std::vector<double>& displayed_px) {
    for (const double px : displayed_px) {
      packages.push_back(
          std::make_unique<PackageReader>(open_container(memory_source(testing::make_package(1, 100'000)))));
      list.push_back({packages.back().get(), px});
    }
  }
};

DeliveryRequest request(double bytes_s, double limit_s) {
  DeliveryRequest r;
  r.network.link = BandwidthTrace::constant(bytes_s);
  r.network.rtt_s = 0.02;
  r.time_limit_s = limit_s;
  return r;
}

TEST(SeveralObjects, OneObjectIsAPlanOfItsOwn) {
  const Objects one({500});
  DeliveryRequest r = request(1e6, 2);
  r.htc.window = 8;  // else the object's own plan has groups of fragments
  const PagePlan page = plan_page(one.list, r);
  DeliveryRequest alone = r;
  alone.displayed_px = 500;
  const DeliveryPlan plan = plan_delivery(*one.packages[0], alone);
  ASSERT_EQ(page.objects.size(), 1u);
  EXPECT_EQ(page.objects[0].scale, plan.scale);
  EXPECT_EQ(page.objects[0].bytes(), plan.bytes());
  EXPECT_DOUBLE_EQ(page.first_pictures_s, plan.first_picture_s);
  EXPECT_DOUBLE_EQ(page.meshes_s, plan.mesh_s);
  EXPECT_DOUBLE_EQ(page.flip, page.objects[0].flip);
  EXPECT_DOUBLE_EQ(page.alone_mean_flip, plan.flip);
}

TEST(SeveralObjects, AllOfThemHaveOneLimit) {
  const Objects four({800, 400, 400, 200});
  const PagePlan page = plan_page(four.list, request(2e6, 3));
  EXPECT_LE(page.first_pictures_s, page.meshes_s);
  EXPECT_LE(page.meshes_s, page.complete_s);
  EXPECT_LE(page.complete_s, 3.05);
  std::size_t fragments = 0;
  double flip = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_DOUBLE_EQ(page.objects[i].first_picture_s, page.first_pictures_s);
    fragments += page.objects[i].textures.rungs.size();
    flip += page.objects[i].flip * four.list[i].displayed_px * four.list[i].displayed_px / 1e6;
  }
  EXPECT_EQ(fragments, page.textures.rungs.size());
  EXPECT_NEAR(page.flip, flip, 1e-12);
  EXPECT_EQ(page.objects[1].flip, page.objects[2].flip);
}

TEST(SeveralObjects, WhatDoesNotFitKeepsItsFirstPicture) {
  const Objects two({1000, 20});
  const PagePlan page = plan_page(two.list, request(2e5, 3));  // the small one's part: 80 bytes/s
  EXPECT_EQ(page.first_picture_only, (std::vector<bool>{false, true}));
  EXPECT_EQ(page.objects[1].mesh_bytes + page.objects[1].table_bytes + page.objects[1].texture_bytes, 0u);
  EXPECT_TRUE(page.objects[1].textures.rungs.empty());
  EXPECT_LT(page.complete_s, 3.1);
}

TEST(SeveralObjects, NoLinkAndNoObject) {
  EXPECT_THROW(plan_page({}, request(1e6, 2)), std::invalid_argument);
  const Objects two({300, 300});
  DeliveryRequest dead = request(1e6, 2);
  dead.network.mirrors[0].dead_from_s = 0;
  const PagePlan page = plan_page(two.list, dead);
  EXPECT_TRUE(std::isinf(page.first_pictures_s));
  EXPECT_EQ(page.first_picture_only, (std::vector<bool>{true, true}));
  const PagePlan again = plan_page(two.list, request(1e6, 2)), same = plan_page(two.list, request(1e6, 2));
  EXPECT_EQ(again.textures.rungs, same.textures.rungs);
}

}  // namespace texmesh::several_objects_test
