#include "stages/quality/shots.h"

#include <gtest/gtest.h>

namespace texmesh::quality {
namespace {

/// Scales of so many triangles.
struct Scenes {
  std::vector<std::vector<Triangle>> triangles;
  std::vector<RenderScene> scenes;
  explicit Scenes(const std::vector<std::size_t>& counts) {
    for (const std::size_t n : counts) triangles.emplace_back(n);
    for (const auto& t : triangles) scenes.push_back({nullptr, &t, nullptr, nullptr, 0});
  }
};

TEST(ShownScale, OfALargeScanIsOneWithSomeTrianglesAPixel) {
  const Scenes s({1'500'000, 700'000, 300'000, 60'000, 10'000});
  EXPECT_EQ(shown_scale(s.scenes, 0, 1024), 0u);
  EXPECT_EQ(shown_scale(s.scenes, 0, 400), 1u);
  EXPECT_EQ(shown_scale(s.scenes, 0, 256), 2u);
  EXPECT_EQ(shown_scale(s.scenes, 1, 256), 2u);
  EXPECT_EQ(shown_scale(s.scenes, 0, 64), 3u);
  EXPECT_EQ(shown_scale(s.scenes, 0, 32), 4u);
  EXPECT_EQ(shown_scale(s.scenes, 4, 1024), 4u);  // a coarser one is shown as it is
}

TEST(ShownScale, OfOthersIsTheScaleItself) {
  const Scenes s({1'000'000, 700'000, 300'000});
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(shown_scale(s.scenes, k, 32), k);
}

}  // namespace
}  // namespace texmesh::quality
