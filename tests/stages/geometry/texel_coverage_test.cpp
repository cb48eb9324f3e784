#include "stages/geometry/texel_coverage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/stages/geometry/texel_triangles.h"

namespace texmesh::texel_coverage_test {

using namespace testing;  // NOLINT: fixtures

std::vector<std::uint8_t> coverage_of(const Corners& triangle, std::uint32_t w, std::uint32_t h, Wrap s,
                                      Wrap t) {
  TexelCoverage coverage(w, h, s, t);
  coverage.add(triangle);
  return coverage.release_bits();
}

/// Separating axes: does the triangle meet the square of half-side `half` around (x, y)?
bool meets(const Corners& triangle, double x, double y, double half) {
  const Vec2d square[4] = {
      {x - half, y - half}, {x + half, y - half}, {x + half, y + half}, {x - half, y + half}};
  Vec2d axes[5] = {{1, 0}, {0, 1}};
  for (int e = 0; e < 3; ++e) {
    const Vec2d d = triangle[static_cast<std::size_t>((e + 1) % 3)] - triangle[static_cast<std::size_t>(e)];
    axes[2 + e] = {-d.y, d.x};
  }
  for (const Vec2d axis : axes) {
    double t0 = HUGE_VAL, t1 = -HUGE_VAL, s0 = HUGE_VAL, s1 = -HUGE_VAL;
    for (const Vec2d p : triangle) t0 = std::min(t0, dot(axis, p)), t1 = std::max(t1, dot(axis, p));
    for (const Vec2d p : square) s0 = std::min(s0, dot(axis, p)), s1 = std::max(s1, dot(axis, p));
    if (t1 < s0 || s1 < t0) return false;
  }
  return true;
}

TEST(TexelCoverage, CoversEverySampleAndNothingThatIsNotNear) {
  Random random{1};
  for (int round = 0; round < 600; ++round) {
    const std::uint32_t w = 1 + random.next() % 21, h = 1 + random.next() % 19;
    const Wrap s = kWraps[random.next() % 3], t = kWraps[random.next() % 3];
    const double span = round % 3 == 0 ? 2 : round % 3 == 1 ? 12 : 3.5 * h;
    const Corners triangle = random_triangle(random, 20, span);
    const auto bits = coverage_of(triangle, w, h, s, t);
    for (int k = 0; k < 400; ++k) {
      double a = random.uniform(), b = random.uniform();
      if (a + b > 1) a = 1 - a, b = 1 - b;
      if (k < 3) a = k == 0, b = k == 1;
      const Vec2d p = triangle[0] * a + triangle[1] * b + triangle[2] * (1 - a - b);
      const auto x = static_cast<std::int64_t>(std::floor(p.x - 0.5)),
                 y = static_cast<std::int64_t>(std::floor(p.y - 0.5));
      for (int dy = 0; dy < 2; ++dy)
        for (int dx = 0; dx < 2; ++dx)
          ASSERT_TRUE(is_covered(bits, w, wrapped(x + dx, w, s), wrapped(y + dy, h, t))) << round;
    }
    // Every covered texel has a copy whose footprint the triangle meets. Clamped border texels reach to
    // infinity.
    std::vector<bool> allowed(w * h);
    const std::int64_t reach = 160;
    for (std::int64_t y = -reach; y < reach; ++y)
      for (std::int64_t x = -reach; x < reach; ++x)
        if (meets(triangle, static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5, 1 + 1e-5))
          allowed[wrapped(y, h, t) * w + wrapped(x, w, s)] = true;
    for (std::uint32_t y = 0; y < h; ++y)
      for (std::uint32_t x = 0; x < w; ++x)
        ASSERT_TRUE(!is_covered(bits, w, x, y) || allowed[y * w + x]) << round << ' ' << x << ' ' << y;
  }
}

TEST(TexelCoverage, HugeTilingsCoverAll) {
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kMirror}) {
    TexelCoverage coverage(2048, 2048, wrap, wrap);
    for (int k = 0; k < 1000; ++k)
      coverage.add({Vec2d{-721.0 * 2048, 3}, Vec2d{1553.0 * 2048, 70}, Vec2d{12, 1553.0 * 2048}});
    EXPECT_EQ(std::count(coverage.bits().begin(), coverage.bits().end(), 0xff), 2048 * 256);
    // High and thin: only its columns, although a thousand tiles high.
    TexelCoverage thin(2048, 2048, wrap, wrap);
    for (int k = 0; k < 1000; ++k) thin.add({Vec2d{100, 0}, Vec2d{101, 0}, Vec2d{100, 1000.0 * 2048}});
    EXPECT_TRUE(is_covered(thin.bits(), 2048, 100, 1024));
    EXPECT_FALSE(is_covered(thin.bits(), 2048, 104, 1024));
  }
  for (const Wrap wrap : kWraps)
    for (const double far : {1e12, 1e30, 1e300}) {
      TexelCoverage coverage(64, 64, wrap, wrap);
      coverage.add({Vec2d{-far, -far}, Vec2d{far, -far}, Vec2d{0, far}});
      EXPECT_EQ(std::count(coverage.bits().begin(), coverage.bits().end(), 0xff), 64 * 8);
    }
}

TEST(TexelCoverage, MoreThanFourTilesHighIsNotTraced) {
  // From 140 at the top to 100 at the foot: traced it ends near 132 in row 200 of the first tile, as a box it
  // does not.
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kMirror})
    for (const double tiles : {3.9, 4.1}) {
      const double foot = tiles * 256;
      const auto bits = coverage_of({Vec2d{100, 0}, Vec2d{140, 0}, Vec2d{100, foot}}, 256, 256, wrap, wrap);
      EXPECT_TRUE(is_covered(bits, 256, 125, 200));
      EXPECT_EQ(is_covered(bits, 256, 138, 200), tiles > 4);
    }
}

TEST(TexelMap, AppliesScaleThenRotationThenOffset) {
  const double quarter = 1.5707963267948966;
  const TexelMap map({{0.5f, 0.25f}, {2, 3}, static_cast<float>(quarter)}, 100, 10);
  const Vec2d p = map({0.5f, 0.125f});  // scaled (1, 0.375), turned (0.375, -1), moved (0.875, -0.75)
  EXPECT_NEAR(p.x, 87.5, 1e-4);
  EXPECT_NEAR(p.y, -7.5, 1e-4);
}

}  // namespace texmesh::texel_coverage_test
