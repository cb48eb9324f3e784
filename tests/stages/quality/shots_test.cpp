#include "stages/quality/shots.h"

#include <gtest/gtest.h>

#include "tests/support/meshes.h"

namespace texmesh::shots_test {

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

/// A ball, and the same ball of few triangles.
struct Balls {
  Mesh fine = testing::sphere(32, 48), coarse = testing::sphere(4, 6);
  ShotMaterials materials{RenderMaterial{}};
  Studio studio;
  Balls() {
    studio.frame = {{{0, 0, 0}, 1}, 2};
    studio.views = choose_views(4, 2);
    studio.rows.resize(4);
    studio.environment = studio_environment();
    for (const Mesh* mesh : {&fine, &coarse}) studio.scenes.push_back(render_scene(*mesh, materials, 0));
  }
  Losses take(const Shot& shot) {
    return SizePictures(studio, materials, 32, false).take({shot}, RunContext{}).front();
  }
};

TEST(Shots, ThatAreBeyondTheirLimitsAreNotTakenInFurtherViews) {
  Balls balls;
  const Losses all = balls.take({1, &balls.materials, ViewPart::kAll}),
               beyond = balls.take({1, &balls.materials, ViewPart::kAll, ShotLimits{0.001, 1}}),
               within = balls.take({1, &balls.materials, ViewPart::kAll, ShotLimits{1, 1}});
  for (std::size_t v = 0; v < 4; ++v) {
    EXPECT_GT(all[v].flip.pixels, 100u) << v;
    EXPECT_EQ(within[v].flip.mean(), all[v].flip.mean()) << v;
    EXPECT_EQ(beyond[v].flip.pixels, v == 0 ? all[v].flip.pixels : 0) << v;
  }
}

TEST(Shots, LimitsAreOfTheMeanAndOfThe95thPercentile) {
  Balls balls;
  const Loss loss = balls.take({1, &balls.materials, ViewPart::kAll}).front();
  const double mean = loss.flip.mean(), p95 = loss.flip.percentile(0.95);
  ASSERT_GT(mean, 0);
  EXPECT_TRUE((ShotLimits{mean, p95}.hold(loss)));
  EXPECT_FALSE((ShotLimits{0.99 * mean, p95}.hold(loss)));
  EXPECT_FALSE((ShotLimits{mean, 0.99 * p95}.hold(loss)));
  EXPECT_TRUE((ShotLimits{0, 0}.hold(Loss{})));  // what shows nothing
}

}  // namespace texmesh::shots_test
