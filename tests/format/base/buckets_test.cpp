#include "format/base/buckets.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace texmesh::buckets_test {

TEST(Buckets, KeepTheOrderOfWhatIsPutIn) {
  const std::vector<std::uint32_t> digits{3, 1, 3, 0, 1, 3};
  const Buckets<std::uint32_t> places = in_buckets(5, [&](auto&& put) {
    for (std::uint32_t i = 0; i < digits.size(); ++i) put(digits[i], i);
  });
  const std::vector<std::vector<std::uint32_t>> expected{{3}, {1, 4}, {}, {0, 2, 5}, {}};
  for (std::size_t b = 0; b < expected.size(); ++b)
    EXPECT_TRUE(std::ranges::equal(places[b], expected[b])) << b;
  EXPECT_EQ(places.first, (std::vector<std::uint32_t>{0, 1, 3, 3, 6, 6}));
}

TEST(Buckets, NoneAreFine) {
  EXPECT_TRUE(in_buckets(0, [](auto&&) {}).items.empty());
  EXPECT_TRUE(in_buckets(2, [](auto&&) {})[1].empty());
}

}  // namespace texmesh::buckets_test
