#include <gtest/gtest.h>

#include "stages/render/environment.h"

namespace texmesh::studio_environment_test {

TEST(StudioEnvironment, IsWhatManyThreadsPrepare) {
  const RenderEnvironment built_in = studio_environment(),
                          prepared =
                              prepare_environment(studio_radiance, studio_key_light(), {8, {}, nullptr});
  EXPECT_EQ(built_in.irradiance, prepared.irradiance);
  ASSERT_EQ(built_in.levels.size(), prepared.levels.size());
  for (std::size_t l = 0; l < prepared.levels.size(); ++l) {
    EXPECT_EQ(built_in.levels[l].side, prepared.levels[l].side);
    EXPECT_EQ(built_in.levels[l].texels, prepared.levels[l].texels);
  }
  EXPECT_EQ(built_in.key.towards, studio_key_light().towards);
  EXPECT_EQ(built_in.background, prepared.background);
}

}  // namespace texmesh::studio_environment_test
