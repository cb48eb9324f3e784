#include "stages/charts/chart_parts.h"

#include <gtest/gtest.h>

#include "tests/support/meshes.h"

namespace texmesh::packing_grid_test {

ChartMask block(std::uint32_t width, std::uint32_t height) {
  ChartMask m{width, height, {}};
  for (std::uint32_t y = 0; y < height; ++y) m.runs.push_back({y, 0, width});
  return m;
}

/// The same search, place by place and cell by cell.
std::optional<PackingGrid::Place> slow_first_free(const std::vector<std::vector<int>>& taken,
                                                  const ChartMask& mask) {
  for (std::uint32_t y = 0; y + mask.height <= taken.size(); ++y)
    for (std::uint32_t x = 0; x + mask.width <= taken[0].size(); ++x) {
      bool free = true;
      for (const ChartMask::Run& run : mask.runs)
        for (std::uint32_t i = 0; i < run.count; ++i) free &= !taken[y + run.row][x + run.first + i];
      if (free) return PackingGrid::Place{x, y};
    }
  return std::nullopt;
}

TEST(PackingGrid, FindsWhatACellByCellSearchFinds) {
  testing::Random random{3};
  for (const std::uint32_t width : {7u, 64u, 65u, 130u}) {
    PackingGrid grid(width, 40, 0);
    std::vector<std::vector<int>> taken(40, std::vector<int>(width, 0));
    for (int i = 0; i < 120; ++i) {
      ChartMask mask{1 + random.next() % std::min(width, 70u), 1 + random.next() % 9, {}};
      for (std::uint32_t y = 0; y < mask.height; ++y) {
        const std::uint32_t first = random.next() % mask.width,
                            count = 1 + random.next() % (mask.width - first);
        mask.runs.push_back({y, first, count});
        if (first + count + 1 < mask.width) mask.runs.push_back({y, first + count + 1, 1});
      }
      const auto expected = slow_first_free(taken, mask), found = grid.first_free(mask, 1000);
      ASSERT_EQ(found.has_value(), expected.has_value());
      if (!found) continue;
      ASSERT_EQ(found->x, expected->x);
      ASSERT_EQ(found->y, expected->y);
      grid.take(mask, *found);
      for (const ChartMask::Run& run : mask.runs)
        for (std::uint32_t k = 0; k < run.count; ++k) taken[found->y + run.row][found->x + run.first + k] = 1;
    }
  }
}

TEST(PackingGrid, KeepsTheGutterAndUsesTheBorder) {
  PackingGrid grid(10, 10, 2);
  for (const auto& [x, y] : {std::pair{0u, 0u}, {6u, 0u}, {0u, 6u}, {6u, 6u}}) {
    const auto place = grid.first_free(block(4, 4), 100);
    ASSERT_TRUE(place);
    EXPECT_EQ(place->x, x);
    EXPECT_EQ(place->y, y);
    grid.take(block(4, 4), *place);
  }
  EXPECT_FALSE(grid.first_free(block(1, 1), 100));
}

TEST(PackingGrid, WhatIsTooLargeHasNoPlace) {
  PackingGrid grid(10, 5, 0);
  EXPECT_TRUE(grid.first_free(block(10, 5), 0));
  EXPECT_FALSE(grid.first_free(block(11, 1), 9));
  EXPECT_FALSE(grid.first_free(block(1, 6), 9));
  grid.take(block(10, 1), {0, 0});
  EXPECT_FALSE(grid.first_free(block(1, 1), 0));
  EXPECT_TRUE(grid.first_free(block(1, 1), 1));
}

TEST(ChartMask, HoldsTheCellsThatTrianglesTouch) {
  const std::array<Vec2d, 3> t{Vec2d{0, 0}, Vec2d{3, 0}, Vec2d{0, 3}};
  const ChartMask mask = mask_of({{t}}, 3, 3);
  EXPECT_EQ(mask.cell_count(), 6u);
  const ChartMask turned = quarter_turned(mask);
  EXPECT_EQ(turned.cell_count(), 6u);
  ASSERT_EQ(turned.runs.size(), 3u);
  EXPECT_EQ(turned.runs[0].count, 3u);  // (x, y) -> (3 - y, x): the full column becomes the full row
  EXPECT_EQ(turned.runs[2].first, 2u);
  const std::array<Vec2d, 3> sliver{Vec2d{0, 0.4}, Vec2d{4, 0.4}, Vec2d{4, 0.41}};
  EXPECT_EQ(mask_of({{sliver}}, 4, 1).cell_count(), 4u);
}

}  // namespace texmesh::packing_grid_test
