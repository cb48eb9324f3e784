#include "stages/geometry/distance.h"

#include <gtest/gtest.h>

namespace texmesh::scale_walk_test {

std::vector<std::array<std::uint32_t, 2>> at(const Spokes& spokes, std::uint32_t place) {
  std::vector<std::array<std::uint32_t, 2>> out;
  for (const Spokes::Spoke& s : spokes.at(place)) out.push_back({s.triangle, s.next});
  return out;
}

TEST(Spokes, EveryTriangleStandsAtItsThreePlacesInOrder) {
  // Wedges 3 and 4 are at the places of wedges 1 and 2.
  const std::vector<std::uint32_t> place{0, 1, 2, 1, 2, 4};
  const std::vector<Triangle> triangles{{0, 1, 2}, {4, 3, 5}};
  const Spokes spokes(6, triangles, [&](std::uint32_t w) { return place[w]; });
  using Found = std::vector<std::array<std::uint32_t, 2>>;
  EXPECT_EQ(at(spokes, 0), (Found{{0, 1}}));
  EXPECT_EQ(at(spokes, 1), (Found{{0, 2}, {1, 4}}));
  EXPECT_EQ(at(spokes, 2), (Found{{0, 0}, {1, 1}}));
  EXPECT_EQ(at(spokes, 3), Found{});
  EXPECT_EQ(at(spokes, 4), (Found{{1, 2}}));
  EXPECT_EQ(at(spokes, 5), Found{});
}

TEST(Spokes, NoTrianglesLeaveEveryPlaceEmpty) {
  const Spokes spokes(2, {}, [](std::uint32_t w) { return w; });
  EXPECT_TRUE(spokes.at(0).empty());
  EXPECT_TRUE(spokes.at(1).empty());
}

}  // namespace texmesh::scale_walk_test
