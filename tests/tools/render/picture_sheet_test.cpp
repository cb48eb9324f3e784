// Views of a model on one sheet.
#include "tools/render/rendered_model.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/render/shade.h"
#include "tests/support/meshes.h"

namespace texmesh::testing::picture_sheet_test {

RenderedModel ball() {
  Material grey;
  grey.base_colour = {0.5f, 0.5f, 0.5f, 1};
  grey.metallic = 0;
  return untextured_model(sphere(16, 24), {grey});
}

PictureSheet sheet_of(int count, std::uint32_t side_px, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return render_sheet(ball(), environment_of(RenderLight::kStudio, context), count, side_px, context);
}

TEST(PictureSheet, GridsAreAsSquareAsTheViewsAllow) {
  for (const auto& [count, columns, rows] :
       {std::array{1, 1, 1}, {2, 2, 1}, {3, 2, 2}, {4, 2, 2}, {5, 3, 2}, {7, 3, 3}, {12, 4, 3}}) {
    const PictureSheet sheet = sheet_of(count, 8);
    EXPECT_EQ(sheet.columns, static_cast<std::uint32_t>(columns)) << count;
    EXPECT_EQ(sheet.rows, static_cast<std::uint32_t>(rows)) << count;
    EXPECT_EQ(sheet.pixels.width_px, 8u * sheet.columns);
    EXPECT_EQ(sheet.pixels.height_px, 8u * sheet.rows);
    EXPECT_EQ(sheet.views.size(), static_cast<std::size_t>(count));
  }
}

TEST(PictureSheet, ViewsStandWhereTheSheetSays) {
  const PictureSheet sheet = sheet_of(3, 32);
  const RenderedModel model = ball();
  const RenderEnvironment environment = environment_of(RenderLight::kStudio, {});
  for (const SheetView& view : sheet.views) {
    const Picture alone = shade(model.scene(), look(model.scene(), view.camera, 32, {}), {}, environment, {});
    const Pixels pixels = encode_srgb(alone);
    for (std::uint32_t y = 0; y < 32; ++y)
      ASSERT_TRUE(
          std::equal(pixels.at(0, y), pixels.at(0, y) + 96, sheet.pixels.at(view.left_px, view.top_px + y)));
    // A ball fills 0.96 of the side.
    EXPECT_NEAR(view.covered_px, 3.1416 * 15.4 * 15.4, 80);
  }
  // The fourth cell is empty.
  const Pixels background = encode_srgb({1, {environment.background}, {0}});
  for (const auto& [x, y] : {std::pair{32u, 32u}, {63u, 63u}, {48u, 48u}})
    EXPECT_TRUE(std::equal(background.data.begin(), background.data.end(), sheet.pixels.at(x, y)));
}

TEST(PictureSheet, SameBytesForAnyThreadCount) {
  EXPECT_EQ(sheet_of(2, 64, 1).pixels.data, sheet_of(2, 64, 8).pixels.data);
}

TEST(PictureSheet, WhiteLightMakesAWhiteBallVanishIntoWhite) {
  Material white;
  white.metallic = 0;
  const RenderedModel model = untextured_model(sphere(16, 24), {white});
  const PictureSheet sheet = render_sheet(model, environment_of(RenderLight::kWhite, {}), 1, 32, {});
  const std::uint8_t* middle = sheet.pixels.at(16, 16);
  const Vec3f full = tone_mapped({1, 1, 1});
  const Pixels expected = encode_srgb({1, {full}, {0}});
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(middle[k], expected.data[static_cast<std::size_t>(k)], 2);
}

TEST(PictureSheet, RefusesWhatNoSheetCanHold) {
  EXPECT_THROW(sheet_of(0, 8), std::invalid_argument);
  EXPECT_THROW(sheet_of(kMaxSheetViews + 1, 8), std::invalid_argument);
  EXPECT_THROW(sheet_of(1, 0), std::invalid_argument);
  EXPECT_THROW(sheet_of(4, kMaxSheetSide / 2 + 1), std::invalid_argument);
}

}  // namespace texmesh::testing::picture_sheet_test
