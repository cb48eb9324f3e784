#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "format/documents/tables.h"
#include "format/rules/allocation.h"
#include "tests/format/documents/tables_fixture.h"

namespace texmesh::rate_distortion_test {

using testing::make_tables;

struct Random {
  std::uint32_t state;
  std::uint32_t next() { return (state = state * 1664525u + 1013904223u) >> 8; }
};

std::uint64_t bytes_spent(const std::vector<RdCurve>& curves, const std::vector<std::uint32_t>& ways) {
  std::uint64_t sum = 0;
  for (std::size_t c = 0; c < curves.size(); ++c) sum += curves[c].bytes[ways[c]];
  return sum;
}

std::uint64_t loss_left(const std::vector<RdCurve>& curves, const std::vector<std::uint32_t>& ways) {
  std::uint64_t sum = 0;
  for (std::size_t c = 0; c < curves.size(); ++c) sum += curves[c].loss[ways[c]];
  return sum;
}

/// The least loss for at most `budget` bytes, by trying everything.
std::uint64_t least_loss(const std::vector<RdCurve>& curves, std::uint64_t budget) {
  std::uint64_t best = ~std::uint64_t{0};
  std::vector<std::uint32_t> ways(curves.size(), 0);
  for (;;) {
    if (bytes_spent(curves, ways) <= budget) best = std::min(best, loss_left(curves, ways));
    std::size_t c = 0;
    while (c < curves.size() && ++ways[c] == curves[c].bytes.size()) ways[c++] = 0;
    if (c == curves.size()) return best;
  }
}

std::vector<RdCurve> random_curves(std::uint32_t seed, std::size_t count, std::size_t ways) {
  Random random{seed};
  std::vector<RdCurve> curves(count);
  for (RdCurve& c : curves) {
    c.bytes = {0};
    c.loss = {1000 + random.next() % 1000};
    for (std::size_t k = 1; k < ways; ++k) {
      c.bytes.push_back(c.bytes.back() + 1 + random.next() % 300);
      // Mostly falling, sometimes not: rungs that are no better than the one before.
      c.loss.push_back(c.loss.back() * (random.next() % 60 + 45) / 100);
    }
  }
  return curves;
}

TEST(RateDistortion, NoChoiceOfTheSameBytesLosesLess) {
  for (std::uint32_t seed = 1; seed <= 30; ++seed) {
    const auto curves = random_curves(seed, 4, 5);
    std::uint64_t most = 0;
    for (const RdCurve& c : curves) most += c.bytes.back();
    int exact = 0;
    for (std::uint64_t budget = 0; budget <= most; budget += 7) {
      const auto ways = spend_bytes(curves, budget);
      const std::uint64_t spent = bytes_spent(curves, ways);
      ASSERT_LE(spent, budget);
      // Where the budget buys a whole number of steps, the choice is the best there is for it.
      const auto again = spend_bytes(curves, spent);
      ASSERT_EQ(bytes_spent(curves, again), spent);
      if (loss_left(curves, again) == least_loss(curves, spent)) ++exact;
    }
    EXPECT_GT(exact, 0);
  }
}

TEST(RateDistortion, HullPointsAreOptimal) {
  // Points of the joint hull: for any price, each curve's way of least loss + price x bytes.
  for (std::uint32_t seed = 40; seed <= 60; ++seed) {
    const auto curves = random_curves(seed, 4, 5);
    for (const double price : {0.05, 0.3, 1.0, 2.5, 7.0, 20.0}) {
      std::uint64_t bytes = 0;
      for (const RdCurve& c : curves) {
        std::size_t best = 0;
        for (std::size_t w = 1; w < c.bytes.size(); ++w) {
          const double a = static_cast<double>(c.loss[w]) + price * c.bytes[w];
          if (a < static_cast<double>(c.loss[best]) + price * c.bytes[best]) best = w;
        }
        bytes += c.bytes[best];
      }
      EXPECT_EQ(loss_left(curves, spend_bytes(curves, bytes)), least_loss(curves, bytes))
          << seed << " " << price;
    }
  }
}

TEST(RateDistortion, BoundariesAndDegenerateCurves) {
  EXPECT_TRUE(spend_bytes({}, 100).empty());
  const std::vector<RdCurve> curves{
      {{0, 10, 20, 30}, {100, 99, 10, 9}},  // way 1 lies above the hull
      {{0, 10}, {5, 5}},                    // nothing to gain
      {{0, 0, 7}, {50, 60, 0}},             // a way that costs nothing and is worse
      {{0}, {1}},                           // nothing but skipping
  };
  EXPECT_EQ(spend_bytes(curves, 0), (std::vector<std::uint32_t>{0, 0, 0, 0}));
  EXPECT_EQ(spend_bytes(curves, 6), (std::vector<std::uint32_t>{0, 0, 0, 0}));
  EXPECT_EQ(spend_bytes(curves, 7), (std::vector<std::uint32_t>{0, 0, 2, 0}));
  EXPECT_EQ(spend_bytes(curves, 26), (std::vector<std::uint32_t>{0, 0, 2, 0}));
  EXPECT_EQ(spend_bytes(curves, 27), (std::vector<std::uint32_t>{2, 0, 2, 0}));
  EXPECT_EQ(spend_bytes(curves, ~std::uint64_t{0}), (std::vector<std::uint32_t>{3, 0, 2, 0}));
  // A dear step that does not fit ends its own curve only.
  const std::vector<RdCurve> two{{{0, 1000}, {100000, 0}}, {{0, 10}, {10, 0}}};
  EXPECT_EQ(spend_bytes(two, 999), (std::vector<std::uint32_t>{0, 1}));
  // Equal slopes: the first curve first.
  const std::vector<RdCurve> twins{{{0, 10}, {10, 0}}, {{0, 10}, {10, 0}}};
  EXPECT_EQ(spend_bytes(twins, 10), (std::vector<std::uint32_t>{1, 0}));
}

PlaneTables falling_tables() {
  PlaneTables t = make_tables(4, 4, 5, 3);
  const std::size_t n = t.fragment_count();
  for (std::size_t f = 0; f < n; ++f)
    for (std::size_t r = 0; r < 5; ++r)
      t.dssim[r * n + f] =
          t.size_bytes[r * n + f] == 0 ? 0 : 0.4f / static_cast<float>((r + 1) * (f % 3 + 1));
  return t;
}

TEST(RateDistortion, OfTables) {
  const PlaneTables t = falling_tables();
  const std::vector<std::int16_t> none = allocate_rd(t, 0), all = allocate_rd(t, 1u << 30);
  for (std::size_t f = 0; f < t.fragment_count(); ++f) {
    EXPECT_EQ(none[f], kSkipped);
    EXPECT_EQ(all[f], f + 1 < t.fragment_count() ? 4 : kSkipped);  // the last one is not stored
  }
  double before = surface_dssim(t, none);
  for (const std::uint64_t budget : {3000u, 6000u, 9000u, 12000u, 15000u}) {
    const auto rungs = allocate_rd(t, budget);
    EXPECT_LE(sum_of(bytes_of(t, rungs)), budget);
    EXPECT_LT(surface_dssim(t, rungs), before);
    before = surface_dssim(t, rungs);
    // What the file stores in 16 bits gives the same choice as what the compiler had.
    EXPECT_EQ(allocate_rd(read_tables(write_tables({{t}})).planes[0], budget), rungs);
  }
}

TEST(RateDistortion, WeightsDecideWhoIsServed) {
  const PlaneTables t = falling_tables();
  for (const std::size_t favourite : {0u, 7u, 14u}) {
    std::vector<float> weights(t.fragment_count(), 0.0f);
    weights[favourite] = 0.25f;
    const auto rungs = allocate_rd(t, 1u << 30, weights);
    for (std::size_t f = 0; f < rungs.size(); ++f) EXPECT_EQ(rungs[f] != kSkipped, f == favourite);
  }
  EXPECT_EQ(sum_of(bytes_of(t, allocate_rd(t, 1u << 30, std::vector<float>(16, 0.0f)))), 0u);
}

TEST(SurfaceWeights, AreSurfaceButForStretchedTexels) {
  PlaneTables t = make_tables(4, 4, 1, 1);
  for (std::size_t f = 0; f < 15; ++f) {
    t.covered_texels[f] = 1000;
    t.surface_fraction[f] = 0.05f;
  }
  std::vector<float> even(15, 0.05f);
  even.push_back(0);
  for (std::size_t f = 0; f < 16; ++f) EXPECT_FLOAT_EQ(surface_weights(t)[f], even[f]);
  t.covered_texels[3] = 10;  // 0.07 % of the texels hold a third of the surface
  t.surface_fraction[3] = 0.4f;
  EXPECT_FLOAT_EQ(surface_weights(t)[3], 10 * 0.05f / 1000);
  EXPECT_FLOAT_EQ(surface_weights(t)[4], 0.05f);
  t.covered_texels[3] = 1000;  // 7 %: not a few stretched ones
  EXPECT_FLOAT_EQ(surface_weights(t)[3], 0.4f);
  std::fill(t.covered_texels.begin(), t.covered_texels.end(), 0u);
  for (const float w : surface_weights(t)) EXPECT_EQ(w, 0);
}

TEST(RungsOf, FollowTheAllocation) {
  PlaneTables t = falling_tables();
  for (const std::uint8_t allocation : {0, 1, 2}) {
    t.allocation = allocation;
    const auto rungs = rungs_of(t, 1, 0.5);
    const auto quality = quality_of(t, 1, 0.5);
    std::uint64_t budget = 0;
    for (const std::uint16_t f : t.order) budget += t.size_bytes[nearest_rung(t, quality[f]) * 16 + f];
    if (allocation < 2)
      EXPECT_EQ(sum_of(bytes_of(t, rungs)), budget);
    else
      EXPECT_EQ(rungs, allocate_rd(t, budget));
    EXPECT_EQ(rungs[15], kSkipped);
  }
}

}  // namespace texmesh::rate_distortion_test
