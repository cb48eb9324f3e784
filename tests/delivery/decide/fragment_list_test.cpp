#include "delivery/cpp/decide/fragment_list.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "delivery/cpp/client/delivery_plan.h"
#include "format/documents/rate_distortion.h"
#include "tests/support/packages.h"

namespace texmesh {
namespace {

/// Three stored fragments, 1 - SSIM 0.25 at both rungs; `skipped` is what the preview has.
PackageReader open_with(const std::vector<float>& skipped) {
  testing::PackageParts parts = testing::make_package_parts();
  parts.tables.planes[0].skip_dssim = skipped;
  return PackageReader(open_container(memory_source(parts.build())));
}

TEST(FragmentList, LeavesToThePreviewWhatNoRungShowsBetter) {
  PackageReader package = open_with({0.5f, 0.125f, 0.25f, 0});
  const FragmentList list = fragment_list(package, full_size(package), {});
  ASSERT_EQ(list.fragments.size(), 1u);  // of 1 the preview shows more, of 2 as much
  EXPECT_EQ(list.fragments[0].fragment, 0u);
  const PlaneTables& t = package.tables().planes[0];
  const std::vector<float> w = surface_weights(t);
  EXPECT_NEAR(list.total_weight, w[0] + w[1] + w[2], 1e-6);
  EXPECT_NEAR(list.preview_loss, 0.125 * w[1] + 0.25 * w[2], 1e-6);

  const TextureBudget budget = texture_for_budget(package, 1e4, {}, 1 << 20);
  EXPECT_EQ(budget.rungs, std::vector<std::int32_t>{0}) << "the upper rung shows no more";
  EXPECT_NEAR(budget.dssim, (0.25 * w[0] + list.preview_loss) / list.total_weight, 1e-6);
}

TEST(FragmentList, HasAllFragmentsWherePreviewsAreNotMeasured) {
  PackageReader package = open_with({});
  const FragmentList list = fragment_list(package, full_size(package), {});
  EXPECT_EQ(list.fragments.size(), 3u);
  EXPECT_EQ(list.preview_loss, 0);
}

TEST(FragmentList, NothingIsFetchedWhereThePreviewsShowMost) {
  PackageReader package = open_with({0.125f, 0.125f, 0.125f, 0});
  EXPECT_TRUE(fragment_list(package, full_size(package), {}).offers.empty());
  DeliveryRequest request;
  request.network.link = {{0}, {1e6}};
  const DeliveryPlan plan = plan_delivery(package, request);
  EXPECT_EQ(plan.texture_bytes, 0u);
  EXPECT_NEAR(plan.texture_dssim, 0.125, 1e-3);
}

}  // namespace
}  // namespace texmesh
