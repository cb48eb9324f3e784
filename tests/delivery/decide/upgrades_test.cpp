// Better rungs after the time limit, in the order of their worth.
#include "delivery/cpp/decide/harmonic_time.h"

#include <gtest/gtest.h>

#include "tests/delivery/decide/some_offers.h"

namespace texmesh::upgrades_test {

using testing::some_offers;

TEST(Upgrades, GoByGainPerByteAndEndAtTheTop) {
  const std::vector<FragmentOffer> offers = some_offers(30);
  std::vector<std::int32_t> rungs(30);
  for (std::size_t i = 0; i < 30; ++i) rungs[i] = static_cast<std::int32_t>(i % 9) - 1;
  for (const bool incremental : {false, true}) {
    std::vector<std::int32_t> now = rungs;
    for (const Upgrade& u : upgrades_in_order(offers, rungs, incremental)) {
      EXPECT_GT(u.rung, now[u.offer]);
      std::uint64_t bytes = 0;
      for (std::int32_t r = incremental ? now[u.offer] + 1 : u.rung; r <= u.rung; ++r)
        bytes += offers[u.offer].bytes[static_cast<std::size_t>(r)];
      EXPECT_EQ(u.bytes, bytes);
      now[u.offer] = u.rung;
    }
    for (const std::int32_t r : now) EXPECT_EQ(r, 7);
  }
}

}  // namespace texmesh::upgrades_test
