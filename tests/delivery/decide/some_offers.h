#pragma once
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "tests/delivery/made_links.h"

namespace texmesh::testing {

/// n fragments with falling eta; rungs of 100, 200, 400 .. bytes times a size of their own.
inline std::vector<FragmentOffer> some_offers(std::size_t n, std::uint64_t seed = 1) {
  MadeNumbers random(seed);
  std::vector<FragmentOffer> offers(n);
  for (FragmentOffer& f : offers) {
    const double size = 0.5 + random.uniform();
    f.eta = random.uniform();
    f.loss.push_back(1);
    for (int r = 0; r < 8; ++r) {
      f.bytes.push_back(static_cast<std::uint32_t>(100 * size * (1 << r)));
      f.loss.push_back(0.5 / (1 << r));
    }
    f.planned_bytes = 800 * size;
  }
  return offers;
}

/// What limits of quality cost that keep a transfer from the bottom of the ladder and from skips: `simulate`
/// plays offers with options over a link whose rate drops to a tenth after two fifths of the limit.
template <class Simulate>
void expect_hard_limits_cost(std::vector<FragmentOffer> offers, HtcOptions options,
                             const BandwidthTrace& drop, const Simulate& simulate) {
  options.hard_limits = true;
  for (FragmentOffer& f : offers) f.low_rung = 2;
  const SimulationResult r = simulate(offers, options, drop);
  EXPECT_EQ(r.skipped, 0u);
  for (const std::int32_t rung : r.rungs) EXPECT_GE(rung, 2);
  EXPECT_GT(r.late_s, 0.5 * options.time_limit_s);
}

}  // namespace texmesh::testing
