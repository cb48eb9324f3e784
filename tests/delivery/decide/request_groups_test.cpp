#include "delivery/cpp/decide/request_groups.h"

#include <gtest/gtest.h>

#include <numeric>

namespace texmesh::request_groups_test {

/// Fragments of two planes, of 10 + i bytes at the lowest of two rungs.
FragmentList list_of_two_planes(std::uint32_t count) {
  FragmentList list;
  for (std::uint32_t i = 0; i < count; ++i) {
    FragmentOffer f;
    f.bytes = {10 + i, 40 + i};
    f.loss = {1.0 / (i + 1), 0.5 / (i + 1), 0.25 / (i + 1)};
    f.eta = i % 5;
    f.planned_bytes = 20;
    list.offers.push_back(f);
    list.fragments.push_back({i < count / 3 ? 4u : 7u, i});
    list.groups.push_back(PlaneGroup::kColour);
  }
  return list;
}

double sum_of(const std::vector<FragmentOffer>& offers, auto&& value) {
  return std::accumulate(offers.begin(), offers.end(), 0.0,
                         [&](double sum, const FragmentOffer& f) { return sum + value(f); });
}

TEST(RequestGroups, KeepAllBytesAndLossesInTheListsOrder) {
  const FragmentList list = list_of_two_planes(30);
  const GroupedOffers groups = grouped_offers(list, 100, 800);
  EXPECT_LT(groups.offers.size(), list.offers.size() / 2);
  ASSERT_EQ(groups.offers.size(), groups.counts.size());
  const auto highest = [](const FragmentOffer& f) { return f.bytes[1]; };
  const auto skipped = [](const FragmentOffer& f) { return f.loss[0]; };
  EXPECT_EQ(sum_of(groups.offers, highest), sum_of(list.offers, highest));
  EXPECT_NEAR(sum_of(groups.offers, skipped), sum_of(list.offers, skipped), 1e-12);
  std::size_t at = 0;
  for (std::size_t g = 0; g < groups.counts.size(); ++g)
    for (std::uint32_t k = 0; k < groups.counts[g]; ++k, ++at) {
      EXPECT_EQ(list.fragments[at].plane, list.fragments[at - k].plane);
      EXPECT_GE(groups.offers[g].eta, list.offers[at].eta);
    }
  EXPECT_EQ(at, list.offers.size());
}

TEST(RequestGroups, AreOneFragmentWhereRequestsCostNothingAndAPlaneWhereTheyCostAll) {
  const FragmentList list = list_of_two_planes(30);
  EXPECT_EQ(grouped_offers(list, 0, 800).offers.size(), 30u);
  EXPECT_EQ(grouped_offers(list, 1e9, 800).offers.size(), 2u);
  EXPECT_TRUE(grouped_offers({}, 100, 800).offers.empty());
}

TEST(RequestGroups, GrowWithTheRoundTripAndLeaveEnoughDecisions) {
  EXPECT_DOUBLE_EQ(group_bytes(250e3, 0.04, 4), 6000);
  EXPECT_DOUBLE_EQ(group_bytes(250e3, 1, 4), 250e3 * 4 / 48);
}

}  // namespace texmesh::request_groups_test
