#include "delivery/cpp/decide/fragment_list.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "delivery/cpp/client/delivery_plan.h"
#include "format/base/errors.h"
#include "format/rules/allocation.h"
#include "format/rules/size_curve.h"
#include "tests/support/packages.h"

namespace texmesh::fragment_list_test {

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

  TextureLoss loss(package, ListOptions{}.displayed_px);
  const TextureBudget budget = texture_for_budget(loss, {}, 1 << 20);
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

TEST(FragmentList, OnlyPrintedListsLeaveTheHighestRungs) {
  testing::PackageParts parts = testing::make_package_parts();
  std::vector<std::uint8_t>& quality = parts.tables.planes[0].rung_quality;
  parts.textures[0].rung_quality.back() = 100;
  quality.back() = 100;
  PackageReader package(open_container(memory_source(parts.build())));
  ListOptions options;
  ASSERT_FALSE(fragment_list(package, full_size(package), options).offers.empty());
  for (const FragmentOffer& f : fragment_list(package, full_size(package), options).offers)
    EXPECT_EQ(f.high_rung, quality.size() - 1) << "it may be the source's own";
  options.thesis = true;
  for (const FragmentOffer& f : fragment_list(package, full_size(package), options).offers)
    EXPECT_LT(f.high_rung, quality.size() - 1);
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

double planned_bytes_of(const FragmentList& list) {
  double sum = 0;
  for (const FragmentOffer& f : list.offers) sum += f.planned_bytes;
  return sum;
}

TEST(FragmentList, AsPrintedHoldsEveryFragmentAndCountsEtaFromGamma) {
  PackageReader package = open_with({0.125f, 0.125f, 0.125f, 0});  // no rung shows more than the preview
  ListOptions options;
  options.thesis = true;
  options.gamma = 0.4;
  const FragmentList list = fragment_list(package, full_size(package), options);
  const PlaneTables& t = package.tables().planes[0];
  ASSERT_EQ(list.offers.size(), t.order.size());
  const std::vector<float> eta = eta_of(t, 0), quality = quality_of(t, 0, 0.4);
  std::size_t nearest = 0;
  for (std::size_t i = 0; i < list.offers.size(); ++i) {
    EXPECT_NEAR(list.offers[i].eta, eta[list.fragments[i].fragment] - 0.4, 1e-7);
    if (std::abs(list.offers[i].eta) < std::abs(list.offers[nearest].eta)) nearest = i;
  }
  for (std::size_t i = 0; i < list.offers.size(); ++i) {
    const std::uint32_t f = list.fragments[i].fragment;
    const double asked = i == nearest ? t.quality[0] : quality[f];  // F-bar has Q_i itself
    EXPECT_NEAR(list.offers[i].planned_bytes, interpolated_bytes(t, f, asked), 1e-9) << i;
  }
}

TEST(FragmentList, GammaIsThatOfTheListThatComesToTheBytes) {
  PackageReader package = open_with({0.5f, 0.5f, 0.5f, 0});
  const std::vector<PlaneChoice> planes = full_size(package);
  ListOptions options;
  options.thesis = true;
  const auto bytes_at = [&](double gamma) {
    const PlaneTables& t = package.tables().planes[0];
    const std::vector<float> quality = quality_of(t, 0, gamma);
    double sum = 0;
    for (const std::uint16_t f : t.order) sum += interpolated_bytes(t, f, quality[f]);
    return sum;
  };
  const double most = bytes_at(0), least = bytes_at(1);
  ASSERT_GT(most, least);
  EXPECT_EQ(gamma_for_bytes(package, planes, 0, most + 1), 0);
  EXPECT_EQ(gamma_for_bytes(package, planes, 0, least - 1), 1);
  const double middle = (most + least) / 2;
  EXPECT_NEAR(bytes_at(gamma_for_bytes(package, planes, 0, middle)), middle, 1e-3 * middle);
  EXPECT_THROW(gamma_for_bytes(package, planes, 1, middle), InputError) << "no scale";
}

TEST(FragmentList, ThePolicyTakesTheRulesScaleAndTheListThatTimePays) {
  PackageReader package = open_with({0.5f, 0.5f, 0.5f, 0});
  DeliveryRequest request = as_printed({});
  EXPECT_EQ(request.rule, StepRule::kDistance);
  EXPECT_EQ(request.htc.window, 1);
  EXPECT_TRUE(request.htc.hard_limits);
  request.network.link = BandwidthTrace::constant(1e6);
  const DeliveryPlan plan = plan_delivery(package, request);
  EXPECT_EQ(plan.scale, wanted_scale(package, request));
  EXPECT_EQ(plan.planes.size(), 1u);
  EXPECT_EQ(plan.planes[0].plane, 0u);
  EXPECT_EQ(plan.textures.skipped, 0u);
  EXPECT_GE(plan.gamma, 0);
  EXPECT_EQ(list_of(package, request, plan).offers.size(), plan.textures.rungs.size());
  EXPECT_EQ(plan.textures.steps[0].target_bytes,
            list_of(package, request, plan).offers[plan.textures.steps[0].offer].planned_bytes);
  EXPECT_GT(planned_bytes_of(list_of(package, request, plan)), 0);
}

}  // namespace texmesh::fragment_list_test
