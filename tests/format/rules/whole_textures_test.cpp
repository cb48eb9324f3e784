#include "format/rules/whole_textures.h"

#include <gtest/gtest.h>

#include "format/rules/picture_prediction.h"

namespace texmesh::whole_textures_test {

PictureLosses same(std::vector<float> flip) { return {flip, flip, flip}; }

/// A square object that has a texture of 1,024 px in one fragment, with mips and two rungs.
class WholeTextures : public ::testing::Test {
 protected:
  void SetUp() override {
    const TextureLosses losses{
        {0.02f, 0.2f}, same({0.02f, 0.1f}), same({0.4f}), same({0.01f, 0}), same({0.04f, 0.1f, 0.2f})};
    quality_.geometry = {same({0, 0.05f})};
    quality_.groups = {{PlaneGroup::kColour, {losses}}};
    for (std::uint32_t mip = 0; mip < 4; ++mip) add_plane(0, mip, "base-colour");
  }
  void add_plane(std::uint32_t image, std::uint32_t mip, const char* role) {
    TextureInfo info;
    info.image = image, info.mip = mip, info.role = role;
    info.base = mip == 0 ? 0 : static_cast<std::uint32_t>(textures_.size()) - mip;
    textures_.push_back(info);
    const std::uint32_t side = 1024u >> mip;
    PlaneTables t;
    t.columns = t.rows = 1;
    t.rung_quality = {20, 80};
    t.order = {0};
    t.size_bytes = {side * side / 16, side * side / 4};
    t.dssim = {0.2f, 0.02f};
    t.skip_dssim = {0.4f};
    t.covered_texels = {side * side};
    t.surface_fraction = {1};
    tables_.push_back(t);
  }
  std::vector<WholeTexture> least(double displayed_px, double most_flip, int scale = 0) const {
    return least_textures({quality_, textures_, tables_, 1, 1}, scale, displayed_px, most_flip);
  }
  std::uint32_t bytes(const WholeTexture& t) const {
    return t.rung == WholeTexture::kPreview ? 0 : tables_[t.plane].size_bytes[t.rung];
  }

  QualityTable quality_{1, {256}, {0, 8}, {}, {}, 2, 0};
  std::vector<TextureInfo> textures_;
  std::vector<PlaneTables> tables_;
};

TEST_F(WholeTextures, PreviewsWhereTheyDo) {
  EXPECT_EQ(least(256, 0.41), (std::vector<WholeTexture>{{0, 0, WholeTexture::kPreview}}));
  EXPECT_NE(least(256, 0.39)[0].rung, WholeTexture::kPreview);
}

TEST_F(WholeTextures, LessLossTakesMoreBytes) {
  std::uint32_t before = 0;
  for (const double most : {0.3, 0.2, 0.11, 0.06, 0.03}) {
    const std::vector<WholeTexture> t = least(256, most);
    ASSERT_EQ(t.size(), 1u);
    EXPECT_GE(bytes(t[0]), before) << most;
    before = bytes(t[0]);
  }
  EXPECT_GT(before, 0u);
  EXPECT_EQ(least(256, 0).at(0), (WholeTexture{0, 2, 1})) << "clients show mip 2; no rung is better than 1";
}

TEST_F(WholeTextures, TheScaleSpendsAPartOfTheLoss) {
  EXPECT_GE(bytes(least(256, 0.06, 8)[0]), bytes(least(256, 0.06, 0)[0]));
  EXPECT_EQ(least(256, 0.04, 8), least(256, 0)) << "the scale alone loses .05: the least FLIP";
}

TEST_F(WholeTextures, LargerPicturesNeedFinerPlanes) {
  EXPECT_EQ(least(1024, 0).at(0).plane, 0u);
  EXPECT_EQ(least(512, 0).at(0).plane, 1u);
  EXPECT_EQ(least(4096, 0).at(0).plane, 0u) << "there is no finer one";
}

TEST_F(WholeTextures, ImagesWithAlphaAreLeftOut) {
  add_plane(1, 0, "base-colour");
  add_plane(1, 0, "alpha");
  EXPECT_EQ(least(256, 0.06).size(), 1u);
}

TEST_F(WholeTextures, OfAnObjectWithoutTexturesThereAreNone) {
  textures_.clear(), tables_.clear();
  EXPECT_TRUE(least(256, 0.06).empty());
}

}  // namespace texmesh::whole_textures_test
