// Plans over packages with proxies; plans over scales alone are held by delivery/vectors.
#include "delivery/cpp/client/delivery_plan.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "format/documents/package_writer.h"
#include "format/documents/thesis_tables.h"
#include "format/rules/proxy_choice.h"
#include "tests/format/container/package_fixture.h"

namespace texmesh::delivery_plan_test {

constexpr std::uint64_t kMeshBytes = 100'000, kLargeMeshBytes = 1'000'000, kSmallBytes = 20'000,
                        kLargeBytes = 60'000;

/// make_package() with meshes of 100 kB and, where asked for, proxies of 20 and 60 kB: FLIP .04 and .02 at
/// 128 px, .2 and .06 at 512 px, P95 three times that; or .9 and .6 everywhere beside meshes of 1 MB, or 1.
/// Scales lose 0, .1 and .2 at 128 px.
enum class Proxies : std::uint8_t { kNone, kGood, kFair, kBad };
Bytes make_package(Proxies proxies) {
  const Bytes plain = testing::make_package(1, proxies == Proxies::kFair ? kLargeMeshBytes : kMeshBytes);
  if (proxies == Proxies::kNone) return plain;
  PackageReader package(open_container(memory_source(plain)));
  Manifest m = package.manifest();
  m.proxy_sizes_px = {128, 512};
  std::vector<PackageEntry> entries;
  for (const EntryRef& e : package.index())
    if (e.path != kTexturesPath) entries.push_back({e.path, package.entry(e)});
  for (const std::uint64_t bytes : {kSmallBytes, kLargeBytes}) {
    const bool large = bytes == kLargeBytes;
    entries.push_back({proxy_path(large ? 1 : 0), Bytes(bytes, 7)});
    m.proxies.push_back(
        {{}, 1, 3, 0, {large ? 0.02 : 0.04, large ? 0.06 : 0.2}, {large ? 0.06 : 0.12, large ? 0.18 : 0.6}});
    if (proxies == Proxies::kFair) {
      const double flip = large ? 0.6 : 0.9;
      m.proxies.back().flip = m.proxies.back().flip_p95 = {flip, flip};
    }
    if (proxies == Proxies::kBad) m.proxies.back().flip = m.proxies.back().flip_p95 = {1, 1};
  }
  return write_package(m, package.textures(), entries);
}
PackageReader open_package(Proxies proxies) {
  static const Bytes none = make_package(Proxies::kNone), good = make_package(Proxies::kGood),
                     fair = make_package(Proxies::kFair), bad = make_package(Proxies::kBad);
  const Bytes& bytes = proxies == Proxies::kNone   ? none
                       : proxies == Proxies::kGood ? good
                       : proxies == Proxies::kFair ? fair
                                                   : bad;
  return PackageReader(open_container(memory_source(bytes)));
}

/// make_package() with perceptual values of S_0, S_4 and S_9, or of S_0 and S_9 alone.
Bytes package_with_values(bool all) {
  PackageReader package(open_container(memory_source(testing::make_package(1))));
  std::vector<PackageEntry> entries;
  for (const EntryRef& e : package.index())
    if (e.path != kTexturesPath) entries.push_back({e.path, package.entry(e)});
  ThesisTables values;
  PerceptualTable& t = values.perceptual;
  t.scale = {0, 4, 9}, t.triangles = {100, 96, 91}, t.collapses = {0, 2, 5};
  t.average = t.largest = t.least = t.deviation = {0, 0.02f, 0.04f};
  t.p95 = t.chain_average = t.chain_largest = t.chain_least = {0.02f, 0.05f, 0.04f};
  if (!all) {
    t.scale = {0, 9}, t.triangles = {100, 91}, t.collapses = {0, 7};
    t.average = t.largest = t.least = t.deviation = {0, 0.05f};
    t.p95 = t.chain_average = t.chain_largest = t.chain_least = {0.05f};
  }
  entries.push_back({kThesisPath, write_thesis(values)});
  return write_package(package.manifest(), package.textures(), entries);
}

DeliveryRequest request(double displayed_px, double bytes_s, double limit_s = 5) {
  DeliveryRequest r;
  r.displayed_px = displayed_px;
  r.time_limit_s = limit_s;
  r.network.link = BandwidthTrace::constant(bytes_s);
  return r;
}

TEST(DeliveryPlan, AThumbnailNeedsTheSmallestProxyAlone) {
  PackageReader package = open_package(Proxies::kGood);
  const DeliveryPlan plan = plan_delivery(package, request(100, 1e6));
  EXPECT_EQ(plan.proxy, 0u);
  EXPECT_EQ(plan.bytes(), kStartBytes);  // one request
  EXPECT_TRUE(plan.planes.empty());
  EXPECT_DOUBLE_EQ(plan.flip, 0.04);
  EXPECT_DOUBLE_EQ(plan.first_picture_s, plan.complete_s);
  EXPECT_EQ(plan_delivery(package, request(180, 1e6)).proxy, 1u);
}

TEST(DeliveryPlan, AnOwnJndTakesTheCoarsestScaleThatLooksAlike) {
  const Bytes bytes = package_with_values(true);
  PackageReader package(open_container(memory_source(bytes)));
  const auto wanted = [&](double displayed_px, double jnd) {
    DeliveryRequest r = request(displayed_px, 1e6);
    r.jnd = jnd;
    return wanted_scale(package, r);
  };
  EXPECT_EQ(wanted(300, 0), 4);
  EXPECT_EQ(wanted(300, 0.03), 4);
  EXPECT_EQ(wanted(300, 0.045), 9);
  EXPECT_EQ(wanted(2000, 0.01), 0);
  EXPECT_EQ(wanted(2000, 0.045), 4);
  EXPECT_EQ(wanted(2000, 0.1), 9);
}

TEST(DeliveryPlan, AnOwnJndRefusesAPackageWhosePerceptualValuesDoNotKnowAScale) {
  const Bytes bytes = package_with_values(false);
  PackageReader package(open_container(memory_source(bytes)));
  DeliveryRequest r = request(300, 1e6);
  EXPECT_EQ(wanted_scale(package, r), 4);  // nothing asks for the values
  r.jnd = 0.1;
  try {
    wanted_scale(package, r);
    FAIL() << "a scale was chosen without values";
  } catch (const FormatError& e) {
    EXPECT_NE(std::string(e.what()).find("expected scale 4, found none [R16]"), std::string::npos)
        << e.what();
  }
}

TEST(DeliveryPlan, AScaleOrAnotherRuleIsAskedForByHand) {
  PackageReader package = open_package(Proxies::kGood);
  DeliveryRequest by_hand = request(100, 1e6);
  by_hand.scale = 4;
  EXPECT_EQ(plan_delivery(package, by_hand).proxy, std::nullopt);
  EXPECT_EQ(plan_delivery(package, by_hand).scale, 4);
  EXPECT_EQ(plan_budget(package, by_hand, 1).proxy, std::nullopt);
  DeliveryRequest by_jnd = request(100, 1e7);
  by_jnd.rule = StepRule::kJnd;
  const DeliveryPlan plan = plan_delivery(package, by_jnd);
  EXPECT_LE(plan.flip, 0.04 + 1e-9);  // the proxy is a candidate still
}

TEST(DeliveryPlan, ASlowLinkShowsAProxyWhereScalesComeTooLate) {
  PackageReader package = open_package(Proxies::kGood);
  const DeliveryPlan slow = plan_delivery(package, request(512, 3e4));
  EXPECT_EQ(slow.proxy, 1u);  // 100 kB of mesh more take 3.3 s more
  EXPECT_LT(slow.complete_s, 5);
  EXPECT_EQ(plan_delivery(package, request(512, 2e4)).proxy, 0u);
  EXPECT_EQ(plan_delivery(package, request(512, 5e3)).proxy, 0u);  // late itself, but nothing comes sooner
}

TEST(DeliveryPlan, TimeThatIsLeftGoesIntoAFinerScale) {
  PackageReader package = open_package(Proxies::kNone);
  const auto scale = [&](const DeliveryRequest& r) { return plan_delivery(package, r).scale; };
  const DeliveryRequest fast = request(300, 1e6);
  EXPECT_EQ(wanted_scale(package, fast), 4) << "it is enough for the display";
  EXPECT_EQ(scale(fast), 0);
  EXPECT_NE(scale(request(300, 3e4)), 0) << "its mesh comes too late";
  DeliveryRequest other = fast;
  other.rule = StepRule::kJnd;
  EXPECT_EQ(scale(other), wanted_scale(package, other)) << "another rule";
  other = fast;
  other.memory_bytes = 1;
  EXPECT_EQ(scale(other), 9) << "no memory for it";
  const DeliveryRequest late = request(60, 3e4, 0.5);
  EXPECT_EQ(wanted_scale(package, late), 9);
  EXPECT_EQ(scale(late), 9) << "no time is left even behind the coarsest";
}

TEST(DeliveryPlan, AFinerMeshLeavesTexturesHalfOfTheTime) {
  PackageReader package = open_package(Proxies::kNone);
  int taken = 0, refused = 0;
  for (double bytes_s = 2e4; bytes_s < 1e6; bytes_s *= 1.05) {
    DeliveryRequest by_hand = request(60, bytes_s);
    const int scale = plan_delivery(package, by_hand).scale;
    by_hand.scale = 9;
    const DeliveryPlan enough = plan_delivery(package, by_hand);
    by_hand.scale = 0;
    const DeliveryPlan finer = plan_delivery(package, by_hand);
    if (finer.flip >= 0.9 * enough.flip || finer.mesh_s >= 5) continue;  // it would not pay
    const bool leaves_half = 5 - finer.mesh_s >= 0.5 * (5 - enough.mesh_s);
    ++(leaves_half ? taken : refused);
    EXPECT_EQ(scale == 0, leaves_half) << bytes_s;
  }
  EXPECT_GT(taken, 0);
  EXPECT_GT(refused, 0);
}

TEST(DeliveryPlan, AProxyThatLooksWorseIsNotShown) {
  PackageReader package = open_package(Proxies::kBad);
  for (const double px : {60.0, 512.0, 3000.0}) {
    EXPECT_EQ(plan_delivery(package, request(px, 1e6)).proxy, std::nullopt) << px;
    EXPECT_EQ(plan_budget(package, request(px, 0), 1'000'000).proxy, std::nullopt) << px;
  }
}

TEST(DeliveryPlan, NothingLooksWorseForHavingProxies) {
  PackageReader with = open_package(Proxies::kGood), without = open_package(Proxies::kNone);
  for (const double px : {60.0, 128.0, 300.0, 700.0})
    for (const std::uint64_t bytes : {30'000u, 50'000u, 120'000u, 250'000u, 400'000u}) {
      const DeliveryPlan a = plan_budget(with, request(px, 0), bytes),
                         b = plan_budget(without, request(px, 0), bytes);
      if (b.bytes() <= bytes)
        EXPECT_LE(a.flip, b.flip + 0.02) << px << ' ' << bytes;  // 45 kB more come first
      if (a.proxy) EXPECT_DOUBLE_EQ(a.flip, proxy_loss(with.manifest(), *a.proxy, px).flip);
    }
}

TEST(DeliveryPlan, ABudgetTakesTheProxyThatFits) {
  PackageReader package = open_package(Proxies::kGood);
  EXPECT_EQ(plan_budget(package, request(512, 0), kStartBytes).proxy, 0u);
  EXPECT_EQ(plan_budget(package, request(512, 0), kStartBytes + kLargeBytes).proxy, 1u);
  const DeliveryPlan too_few = plan_budget(package, request(512, 0), 1000);
  EXPECT_EQ(too_few.proxy, 0u);  // the least there is
  EXPECT_GT(too_few.bytes(), 1000u);
}

TEST(DeliveryPlan, BehindAProxyTheCoarsestMeshIsCountedToo) {
  PackageReader with = open_package(Proxies::kGood);
  DeliveryRequest r = request(700, 1e6);
  r.scale = 9;
  const DeliveryPlan coarsest = plan_delivery(with, r);
  const EntryRef& glb = with.manifest().scales.back().glb;
  EXPECT_GE(coarsest.bytes(), glb.offset + glb.bytes);
  r.scale = 4;
  EXPECT_EQ(plan_delivery(with, r).mesh_bytes, coarsest.mesh_bytes + kMeshBytes);
}

TEST(DeliveryPlan, ALargerProxyComesOnTheWayOnASlowLink) {
  PackageReader package = open_package(Proxies::kFair);
  std::string seen;
  bool stepped = false;
  for (const double px : {300.0, 512.0})
    for (const double bytes_s : {3e4, 6e4, 1e5, 1.5e5, 2e5, 3e5, 5e5, 1e6, 1e8}) {
      DeliveryRequest r = request(px, bytes_s, 8);
      const DeliveryPlan with = plan_delivery(package, r);
      r.proxy_steps = false;
      const DeliveryPlan without = plan_delivery(package, r);
      EXPECT_FALSE(without.step);
      if (bytes_s > 1e7) EXPECT_FALSE(with.step) << "nobody would see it";
      seen += std::to_string(px) + ' ' + std::to_string(bytes_s) + (with.proxy ? " proxy " : " scale ") +
              std::to_string(with.flip) + ' ' + std::to_string(with.mesh_s) + (with.step ? " step\n" : "\n");
      if (!with.step) continue;
      stepped = true;
      EXPECT_EQ(*with.step, 1u);
      EXPECT_GT(with.step_s, with.first_picture_s);
      EXPECT_LT(with.step_s, with.mesh_s);
      EXPECT_EQ(with.step_bytes, proxy_bytes_beyond_start(package.manifest(), 1));
      if (!without.proxy && without.scale == with.scale) EXPECT_GT(with.mesh_s, without.mesh_s);
    }
  EXPECT_TRUE(stepped) << seen;
  DeliveryRequest by_hand = request(700, 1e5);
  by_hand.scale = 4;
  EXPECT_FALSE(plan_delivery(package, by_hand).step);
}

TEST(DeliveryPlan, MemoryIsKept) {
  PackageReader package = open_package(Proxies::kNone);
  const DeliveryPlan all = plan_delivery(package, request(2000, 1e8));
  const auto taken = [](const DeliveryPlan& p) { return p.gpu.all(); };
  EXPECT_GT(all.gpu.textures, 0u);
  std::uint64_t before = taken(all);
  double flip = all.flip;
  for (const double share : {1.0, 0.8, 0.5, 0.3}) {
    DeliveryRequest r = request(2000, 1e8);
    r.memory_bytes = share * static_cast<double>(taken(all));
    for (const DeliveryPlan& p : {plan_delivery(package, r), plan_budget(package, r, 1'000'000)}) {
      const bool fits = static_cast<double>(taken(p)) <= r.memory_bytes;
      EXPECT_EQ(fits, std::ranges::none_of(p.warnings,
                                           [](const std::string& w) {
                                             return w.find("bytes on the GPU") != std::string::npos;
                                           }))
          << share;
    }
    const DeliveryPlan p = plan_delivery(package, r);
    EXPECT_LE(taken(p), before) << share;
    EXPECT_GE(p.flip, flip - 1e-9) << share;
    before = taken(p);
    flip = p.flip;
  }
  DeliveryRequest none = request(2000, 1e8);
  none.memory_bytes = 1;
  EXPECT_EQ(plan_delivery(package, none).scale, package.manifest().scales.back().scale);
}

PackageReader open_golden() {
  return PackageReader(
      open_container(open_file_source(std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh")));
}

TEST(DeliveryPlan, FragmentsComeInGroupsThatHideRoundTrips) {
  PackageReader package = open_golden();
  DeliveryRequest r = request(800, 3e5, 2);
  r.network.rtt_s = 0.1;
  r.scale = 0;
  std::size_t groups = 0;
  r.play = [&](int, const std::vector<FragmentOffer>& offers, const HtcOptions& htc,
               const NetworkOptions& network) {
    groups = offers.size();
    return simulate(offers, htc, network);
  };
  const DeliveryPlan plan = plan_delivery(package, r);
  const std::size_t fragments = plan.textures.rungs.size();
  EXPECT_LT(groups, fragments);
  EXPECT_EQ(list_of(package, r, plan).offers.size(), fragments);
  EXPECT_EQ(plan.textures.steps.size(), fragments);
  std::uint64_t bytes = 0;
  for (const HtcStep& s : plan.textures.steps)
    if (s.rung >= 0) bytes += s.bytes;
  EXPECT_EQ(bytes, plan.textures.bytes);
  r.htc.window = 6;  // fragment by fragment
  EXPECT_EQ(plan_delivery(package, r).textures.rungs.size(), groups);
}

TEST(DeliveryPlan, WhatATransferSpendsBadlyIsChosenAgain) {
  PackageReader package = open_golden();
  DeliveryRequest r = request(800, 3e5, 2);
  r.scale = 0;
  std::vector<double> losses;
  r.play = [&](int, const std::vector<FragmentOffer>& offers, const HtcOptions& htc, NetworkOptions network) {
    if (losses.empty()) network.link = BandwidthTrace::constant(2e4);
    losses.push_back(simulate(offers, htc, network).loss);
    return simulate(offers, htc, network);
  };
  const DeliveryPlan plan = plan_delivery(package, r);
  ASSERT_EQ(losses.size(), 2u);
  EXPECT_EQ(plan.textures.loss, losses[1]);
}

}  // namespace texmesh::delivery_plan_test
