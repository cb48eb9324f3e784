#include "delivery/cpp/decide/fragment_list.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "delivery/cpp/client/delivery_plan.h"
#include "format/base/errors.h"
#include "format/rules/allocation.h"
#include "format/rules/rate_distortion.h"
#include "tests/support/packages.h"

namespace texmesh {
namespace {

/// What texels lose more at 1000 px than at the table's 256 px: their plane has no mips.
const double kLarger = std::pow(GroupCurve::kLossPerDoubling, std::log2(1000.0 / 256));

/// Three stored fragments, 1 - SSIM 0.25 at both rungs; `skipped` is what the preview has, which looks as
/// rungs with such texels do.
PackageReader open_with(const std::vector<float>& skipped) {
  testing::PackageParts parts = testing::make_package_parts();
  PlaneTables& t = parts.tables.planes[0];
  t.skip_dssim = skipped;
  if (!skipped.empty()) {
    const std::vector<float> w = surface_weights(t);
    const GroupCurve curve(parts.quality, PlaneGroup::kColour, 256);
    double sum = 0, total = 0;
    for (std::size_t f = 0; f < 3; ++f) {
      sum += static_cast<double>(w[f]) * curve.coded(static_cast<double>(skipped[f]));
      total += static_cast<double>(w[f]);
    }
    parts.quality.groups[0].sizes[0].preview.flip = {static_cast<float>(sum / total)};
  }
  return PackageReader(open_container(memory_source(parts.build())));
}

TEST(FragmentList, LeavesToThePreviewWhatNoRungShowsBetter) {
  PackageReader package = open_with({0.5f, 0.125f, 0.1875f, 0});
  const FragmentList list = fragment_list(package, full_size(package), {});
  ASSERT_EQ(list.fragments.size(), 1u);  // of 1 the preview shows more, of 2, too
  EXPECT_EQ(list.fragments[0].fragment, 0u);
  const PlaneTables& t = package.tables().planes[0];
  const std::vector<float> w = surface_weights(t);
  const GroupCurve curve(package.quality(), PlaneGroup::kColour, 1000);
  const double all = static_cast<double>(w[0]) + w[1] + w[2];
  EXPECT_NEAR(list.preview_loss[0], kLarger * (curve.coded(0.125) * w[1] + curve.coded(0.1875) * w[2]) / all,
              1e-6);
  EXPECT_NEAR(list.offers[0].loss[0], kLarger * curve.coded(0.5) * w[0] / all, 1e-6);
  EXPECT_NEAR(list.offers[0].loss[1], kLarger * curve.coded(0.25) * w[0] / all, 1e-6);

  const TextureBudget budget = texture_for_budget(package, {}, 1 << 20);
  EXPECT_EQ(budget.rungs, std::vector<std::int32_t>{0}) << "the upper rung shows no more";
  EXPECT_NEAR(budget.losses[0], kLarger * curve.coded(0.25) * w[0] / all + list.preview_loss[0], 1e-6);
  EXPECT_EQ(budget.flip, combined_flip(package.quality(), budget.losses)) << "S_0 loses nothing";
}

TEST(FragmentList, OffersAddUpToWhatTheGroupLoses) {
  PackageReader package = open_with({0.5f, 0.5f, 0.5f, 0});
  const FragmentList list = fragment_list(package, full_size(package), {});
  const GroupCurve curve(package.quality(), PlaneGroup::kColour, 1000);
  EXPECT_NEAR(losses_of(list, std::vector<std::int32_t>{-1, -1, -1})[0], kLarger * curve.coded(0.5), 1e-6);
  EXPECT_NEAR(losses_of(list, std::vector<std::int32_t>{1, 1, 1})[0], kLarger * curve.coded(0.25), 1e-6);

  ListOptions light;
  light.group_weights = {0.5, 1, 1};
  const FragmentList half = fragment_list(package, full_size(package), light);
  EXPECT_NEAR(half.offers[0].loss[0], list.offers[0].loss[0] / 2, 1e-12);
  EXPECT_NEAR(losses_of(half, std::vector<std::int32_t>{1, 1, 1})[0], kLarger * curve.coded(0.25), 1e-6)
      << "weights change what is bought, not what is lost";
}

TEST(FragmentList, TakesTheRowOfTheScalesNumber) {
  PackageReader package = open_with({0.5f, 0.5f, 0.5f, 0});
  ListOptions options;
  options.scale = 5;  // the second of the manifest
  const FragmentList list = fragment_list(package, full_size(package), options);
  const std::vector<float> eta = eta_of(package.tables().planes[0], 1);
  ASSERT_EQ(list.offers.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    const std::vector<double>& loss = list.offers[i].loss;
    EXPECT_NEAR(list.offers[i].eta, eta[list.fragments[i].fragment] * (loss[0] - loss[1]), 1e-9) << i;
  }
  options.scale = 1;  // a row, but no scale
  EXPECT_THROW(fragment_list(package, full_size(package), options), InputError);
}

TEST(FragmentList, NothingIsFetchedWhereThePreviewsShowMost) {
  PackageReader package = open_with({0.125f, 0.125f, 0.125f, 0});
  EXPECT_TRUE(fragment_list(package, full_size(package), {}).offers.empty());
  DeliveryRequest request;
  request.network.link = {{0}, {1e6}};
  const DeliveryPlan plan = plan_delivery(package, request);
  EXPECT_EQ(plan.texture_bytes, 0u);
  const GroupCurve curve(package.quality(), PlaneGroup::kColour, request.displayed_px);
  EXPECT_NEAR(plan.texture_flip, kLarger * curve.coded(0.125), 1e-6);
}

}  // namespace
}  // namespace texmesh
