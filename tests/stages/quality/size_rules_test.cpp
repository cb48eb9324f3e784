#include "stages/quality/table_fit.h"

#include "tests/stages/quality/quality_samples.h"

namespace texmesh::size_rules_test {

/// What fewer_heights() says of the textured sheet when half of the largest height shows so many texels per
/// pixel along a line, as a logarithm of base 2.
std::size_t fewer_at(const testing::Sample& s, double texel_level) {
  const ShownTextures shown = find_shown(s.materials, s.fragments, s.scales.mesh);
  const TextureData data = texture_data(s.images, s.fragments, s.pixels, s.ladder, s.previews, s.tables);
  const std::vector<PlanesOfGroup> groups = find_groups(shown, s.fragments);
  // 256 x 256 texels on a surface of 1.
  const TextureSampler sampler{data, shown, groups, 4, 1};
  const double half_px = 256 * std::exp2(-texel_level);
  QualityOptions options;
  options.largest_px = 512;
  constexpr std::size_t kFewTriangles = 2;
  return fewer_heights(sampler, kFewTriangles, options.largest_px / 2 / half_px, options);
}

TEST(SizeRules, TexelsOfSevenTenthsOfAPixelAreEnlarged) {
  const testing::Sample s = testing::sample_sheet(true);
  EXPECT_EQ(fewer_at(s, 0.55), 0u);
  EXPECT_EQ(fewer_at(s, 0.45), 1u);
  EXPECT_EQ(fewer_at(s, -0.45), 1u) << "in a quarter of the largest height they are smaller";
  EXPECT_EQ(fewer_at(s, -0.55), 2u) << "never less than a quarter of it";
  EXPECT_EQ(fewer_at(s, -1.55), 2u);
}

TEST(SizeRules, WithoutMipsOnlyTexelsOfAPixelAre) {
  testing::Sample s = testing::sample_sheet(true);
  for (const Minification sharp : {Minification::kNearest, Minification::kLinear}) {
    s.materials[0].base_colour_texture.minification = sharp;
    EXPECT_EQ(fewer_at(s, 0.45), 0u);
    EXPECT_EQ(fewer_at(s, 0.05), 0u);
    EXPECT_EQ(fewer_at(s, -0.05), 1u);
    EXPECT_EQ(fewer_at(s, -0.95), 1u);
    EXPECT_EQ(fewer_at(s, -1.05), 2u);
  }
}

}  // namespace texmesh::size_rules_test
