#include "stages/base/first_use_table.h"

#include <gtest/gtest.h>

#include <vector>

namespace texmesh::first_use_table_test {

/// Numbers of values, by a hash that the test chooses.
std::vector<std::uint32_t> numbers_of(const std::vector<int>& values, std::size_t expected,
                                      std::uint64_t (*hash)(int)) {
  FirstUseTable table(expected);
  std::vector<int> first;
  std::vector<std::uint32_t> out;
  for (const int v : values) {
    out.push_back(table.number_of(
        hash(v), [&](std::uint32_t n) { return first[n] == v; },
        [&](std::uint32_t n) { return hash(first[n]); }));
    if (out.back() == first.size()) first.push_back(v);
    EXPECT_EQ(table.size(), first.size());
  }
  return out;
}
std::uint64_t mixed(int v) { return hash_with(0, static_cast<std::uint64_t>(v)); }
std::uint64_t all_the_same(int) { return 7; }

TEST(FirstUseTable, EqualRecordsHaveOneNumberInTheOrderOfFirstUse) {
  const std::vector<std::uint32_t> want{0, 1, 0, 2, 1, 3};
  EXPECT_EQ(numbers_of({5, -1, 5, 0, -1, 6}, 0, mixed), want);
  EXPECT_EQ(numbers_of({5, -1, 5, 0, -1, 6}, 6, mixed), want);
}

TEST(FirstUseTable, RecordsOfOneHashAreToldApart) {
  std::vector<int> values;
  for (int i = 0; i < 1500; ++i) values.push_back(i % 750);
  const std::vector<std::uint32_t> numbers = numbers_of(values, 0, all_the_same);
  for (std::size_t i = 0; i < values.size(); ++i)
    EXPECT_EQ(numbers[i], static_cast<std::uint32_t>(values[i])) << i;
}

TEST(FirstUseTable, GrowsAndFindsWhatItHad) {
  std::vector<int> values;
  for (int round = 0; round < 2; ++round)
    for (int i = 0; i < 20'000; ++i) values.push_back(i * 3);
  const std::vector<std::uint32_t> numbers = numbers_of(values, 0, mixed);
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_EQ(numbers[i], i % 20'000) << i;
}

}  // namespace texmesh::first_use_table_test
