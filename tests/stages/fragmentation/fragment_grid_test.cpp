#include "stages/fragmentation/fragment_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include "tests/stages/geometry/texel_triangles.h"
#include "tests/support/coverage_bits.h"

namespace texmesh::fragment_grid_test {

using namespace testing;  // NOLINT: fixtures

TEST(FragmentGrid, FollowsItsRules) {
  Random random{5};
  std::vector<std::array<std::uint32_t, 2>> sizes{
      {1, 1},         {32, 32},   {678, 2199}, {2048, 2048}, {4096, 4096}, {8192, 8192}, {65500, 1},
      {65500, 65500}, {130, 130}, {518, 429},  {16, 20000},  {4096, 2048}, {1024, 1024}, {512, 512}};
  const bool all = std::getenv("TEXMESH_FULL") != nullptr;
  for (int k = 0; k < (all ? 500 : 30); ++k)
    sizes.push_back({1 + random.next() % 9000, 1 + random.next() % 9000});
  for (const auto& [w, h] : sizes)
    for (const std::uint32_t most : {256u, 64u, 5u, 1u})
      for (const std::uint32_t least : {128u, 16u, 500u}) {
        if (!all && std::min(w, h) > 60000 && least != 128) continue;  // a second each
        const FragmentGrid g = choose_grid(w, h, {}, most, least);
        const auto axis = [&](std::uint32_t size, std::uint32_t side, std::uint32_t count) {
          EXPECT_EQ(side % 16, 0u);
          EXPECT_LE(side, 65488u);
          EXPECT_GE(std::uint64_t{side} * count, size);
          EXPECT_LT(std::uint64_t{side} * (count - 1), size);
          EXPECT_GE(side, std::min(least, size)) << g.reason;
        };
        axis(w, g.fragment_width_px, g.columns);
        axis(h, g.fragment_height_px, g.rows);
        EXPECT_LE(g.columns * g.rows, std::max(most, w > 65488 || h > 65488 ? 4u : 1u)) << g.reason;
        EXPECT_FALSE(g.reason.empty());
      }
  const auto grid = [](std::uint32_t w, std::uint32_t h) {
    const FragmentGrid g = choose_grid(w, h, {}, 256, 128);
    return std::array{g.columns, g.rows, g.fragment_width_px, g.fragment_height_px};
  };
  EXPECT_EQ(grid(1, 1), (std::array{1u, 1u, 16u, 16u}));
  EXPECT_EQ(grid(512, 512), (std::array{4u, 4u, 128u, 128u}));
  EXPECT_EQ(grid(1024, 1024), (std::array{8u, 8u, 128u, 128u}));
  EXPECT_EQ(grid(2048, 2048), (std::array{8u, 8u, 256u, 256u}));
  EXPECT_EQ(grid(4096, 4096), (std::array{16u, 16u, 256u, 256u}));
  EXPECT_EQ(grid(8192, 8192), (std::array{16u, 16u, 512u, 512u}));
  EXPECT_EQ(grid(678, 2199), (std::array{5u, 14u, 144u, 160u}));
}

TEST(FragmentGrid, LeastOverheadOfWhatIsCovered) {
  // Everything covered: the largest fragments. Islands far apart: small ones skip what lies between.
  const auto whole = coverage_where(2048, 2048, [](auto, auto) { return true; });
  EXPECT_EQ(choose_grid(2048, 2048, whole, 256, 128).fragment_width_px, 256u);
  EXPECT_EQ(choose_grid(2048, 2048, whole, 256, 128).reason, choose_grid(2048, 2048, {}, 256, 128).reason);
  const auto islands = coverage_where(4096, 4096, [](std::uint32_t x, std::uint32_t y) {
    return x % 512 < 100 && y % 512 < 100 && x < 4000;
  });
  // 64 islands: 256 px fragments, 128 would be more than 256 in all but cost less; the limit holds.
  EXPECT_EQ(choose_grid(4096, 4096, islands, 256, 128).fragment_width_px, 256u);
  const FragmentGrid fine = choose_grid(
      2048, 2048,
      coverage_where(2048, 2048,
                     [](std::uint32_t x, std::uint32_t y) { return x % 256 < 100 && y % 256 < 100; }),
      256, 128);
  EXPECT_EQ(fine.fragment_width_px, 128u) << fine.reason;
  EXPECT_NE(fine.reason.find("64 stored"), std::string::npos) << fine.reason;
  EXPECT_NE(fine.reason.find("least overhead of"), std::string::npos) << fine.reason;
  EXPECT_NE(
      fine.reason.find("overhead weighed as 8.1 kB: 64 fragments at 64 B, 408.5k uncovered texels at 0.01 B"),
      std::string::npos)
      << fine.reason;
}

TEST(FragmentGrid, NoOtherGridOfTheCandidatesCostsLess) {
  Random random{21};
  for (int round = 0; round < 12; ++round) {
    const std::uint32_t w = 700 + random.next() % 1500, h = 700 + random.next() % 1500;
    const auto bits = coverage_where(w, h, [&, seed = round](std::uint32_t x, std::uint32_t y) {
      return ((x / 97) * 7 + (y / 61) * 13 + static_cast<std::uint32_t>(seed)) % 5 < 2;
    });
    // Cost by brute force over texels.
    const auto cost = [&](std::uint32_t fw, std::uint32_t fh) {
      const std::uint32_t columns = (w + fw - 1) / fw, rows = (h + fh - 1) / fh;
      std::vector<std::uint32_t> covered(columns * rows);
      std::uint64_t texels = 0, stored = 0;
      for (std::uint32_t y = 0; y < h; ++y)
        for (std::uint32_t x = 0; x < w; ++x)
          if (is_covered(bits, w, x, y)) ++covered[y / fh * columns + x / fw], ++texels;
      for (const auto n : covered) stored += n > 0;
      return std::pair{6400 * stored + (stored * fw * fh - texels), stored};
    };
    const FragmentGrid g = choose_grid(w, h, bits, 256, 128);
    const auto [least, stored] = cost(g.fragment_width_px, g.fragment_height_px);
    for (std::uint32_t side = 128; side <= 256; side += 16) {
      const FragmentGrid other = choose_grid(w, h, {}, 256, side);  // a grid near that side
      if (other.columns * other.rows > 256 || other.fragment_width_px > 256 || other.fragment_height_px > 256)
        continue;
      const auto [others, others_stored] = cost(other.fragment_width_px, other.fragment_height_px);
      if (others_stored >= 64 && stored >= 64)
        EXPECT_LE(least, others + 6400) << g.reason << " / " << other.reason;
    }
  }
}

TEST(AreaSpreader, SpreadsAsManySamplesDo) {
  Random random{9};
  for (int round = 0; round < 60; ++round) {
    const FragmentGrid grid{40, 56, 16, 16, 3, 4, ""};
    const Wrap s = kWraps[random.next() % 3], t = kWraps[random.next() % 3];
    const Corners triangle = random_triangle(random, 40, round % 2 ? 20 : 150);
    std::vector<double> got(12), expected(12);
    AreaSpreader(grid).add(triangle, s, t, 2, got);
    EXPECT_NEAR(std::accumulate(got.begin(), got.end(), 0.0), 2, 1e-9);
    const int n = 300;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        double a = (i + 0.5) / n, b = (j + 0.5) / n;
        if (a + b > 1) a = 1 - a, b = 1 - b;
        const Vec2d p = triangle[0] * a + triangle[1] * b + triangle[2] * (1 - a - b);
        expected[fragment_at(grid, p, s, t)] += 2.0 / (n * n);
      }
    // A triangle without area has its samples along the edge in another density; only the sum is promised
    // there.
    if (std::fabs(cross(triangle[1] - triangle[0], triangle[2] - triangle[0])) < 1e-6) continue;
    for (std::size_t f = 0; f < 12; ++f) EXPECT_NEAR(got[f], expected[f], 0.02) << round << ' ' << f;
  }
}

TEST(AreaSpreader, TilingsBeyondAllBoundsCountEvenly) {
  const FragmentGrid grid{48, 32, 32, 32, 2, 1, ""};
  for (const double far : {1e6, 1e30}) {
    std::vector<double> got(2);
    AreaSpreader(grid).add({Vec2d{0, 0}, Vec2d{far, 0}, Vec2d{0, far}}, Wrap::kRepeat, Wrap::kRepeat, 3, got);
    EXPECT_NEAR(got[0], 2, 1e-9);
    EXPECT_NEAR(got[1], 1, 1e-9);
  }
}

TEST(AreaSpreader, MoreTilesOrCellsThanTheCapAreNotClipped) {
  const auto spread = [](const FragmentGrid& grid, const Corners& triangle) {
    std::vector<double> got(std::size_t{grid.columns} * grid.rows);
    AreaSpreader(grid).add(triangle, Wrap::kRepeat, Wrap::kRepeat, 1, got);
    return got;
  };
  // All of it lies in the upper row, which only clipping knows.
  const FragmentGrid four{64, 64, 32, 32, 2, 2, ""};
  const std::vector<double> exact = spread(four, {Vec2d{0, 4}, Vec2d{64 * 65 - 1, 4}, Vec2d{0, 20}});
  EXPECT_EQ(exact[2] + exact[3], 0);
  EXPECT_EQ(spread(four, {Vec2d{0, 4}, Vec2d{64 * 65 + 1, 4}, Vec2d{0, 20}}), std::vector<double>(4, 0.25));
  // 64 x 64 cells of one tile, whose lower right half is empty, and one column of cells more.
  const FragmentGrid fine{1024, 1024, 16, 16, 64, 64, ""};
  EXPECT_EQ(spread(fine, {Vec2d{0, 0}, Vec2d{1023, 0}, Vec2d{0, 1023}}).back(), 0);
  EXPECT_EQ(spread(fine, {Vec2d{0, 0}, Vec2d{1025, 0}, Vec2d{0, 1023}}),
            std::vector<double>(4096, 1.0 / 4096));
}

}  // namespace texmesh::fragment_grid_test
