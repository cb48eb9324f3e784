#include "tools/cli/check/check_gate.h"

#include <gtest/gtest.h>

#include <limits>

namespace texmesh::atlas_gate_test {

AtlasDiagnosis two_textures() {
  AtlasDiagnosis d;
  d.atlases.resize(2);
  d.atlases[0].name = "texture 0 (a)", d.atlases[1].name = "texture 1";
  for (NamedAtlas& a : d.atlases) {
    a.charts = 10, a.triangle_floor = 30;
    a.cover = 0.5, a.thin_share = 0.1, a.overlap = 0.2, a.flat_surface = 0.01;
    a.density = {1, 2, 3, 4}, a.stretch = {1, 1.2, 2, 3};
    a.seam_colours = SeamColours{5, 9, 1};
  }
  return d;
}

TEST(AtlasGate, WithoutLimitsThereIsNothingToBreak) {
  EXPECT_TRUE(check_atlases(two_textures(), {}).empty());
}

TEST(AtlasGate, EveryLimitIsKeptAtItsValueAndBrokenBeyond) {
  const AtlasDiagnosis d = two_textures();
  const AtlasLimits exact{20, 60, 0.5, 0.1, 0.2, 0.01, 3, 2, 5};
  EXPECT_EQ(check_atlases(d, exact).size(), 2u + 2 * 7);
  EXPECT_TRUE(gate_failures(check_atlases(d, exact)).empty());
  const AtlasLimits strict{19, 59, 0.51, 0.09, 0.19, 0.009, 2.9, 1.9, 4.9};
  const std::vector<std::string> reasons = gate_failures(check_atlases(d, strict));
  ASSERT_EQ(reasons.size(), 2u + 2 * 7);
  EXPECT_EQ(reasons[0], "charts: 20, expected at most 19");
  EXPECT_EQ(reasons[2], "texture 0 (a): cover: 0.5, expected at least 0.51");
}

TEST(AtlasGate, OneBadTextureIsEnoughAndNanKeepsNoLimit) {
  AtlasDiagnosis d = two_textures();
  d.atlases[0].cover = 0.9;
  AtlasLimits limits;
  limits.min_cover = 0.8;
  EXPECT_EQ(gate_failures(check_atlases(d, limits)).size(), 1u);
  limits = {};
  limits.max_stretch = 10;
  d.atlases[1].stretch.p95 = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(gate_failures(check_atlases(d, limits)).size(), 1u);
}

TEST(AtlasGate, NoAtlasAndNoSeamsKeepEveryLimit) {
  AtlasLimits limits;
  limits.min_cover = 1, limits.max_charts = 0, limits.max_seam_difference = 0;
  EXPECT_TRUE(gate_failures(check_atlases({}, limits)).empty());
  AtlasDiagnosis d = two_textures();
  d.atlases.resize(1);
  d.atlases[0].seam_colours.reset();
  limits = {};
  limits.max_seam_difference = 0;
  EXPECT_TRUE(check_atlases(d, limits).empty());
}

}  // namespace texmesh::atlas_gate_test
