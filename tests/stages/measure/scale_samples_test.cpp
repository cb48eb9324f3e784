#include "stages/measure/fragment_meter.h"

#include <gtest/gtest.h>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh::scale_samples_test {

TEST(ScaleSamples, PlacesAreCentresOfTexelsAndStopAtTheEnds) {
  // Four texels over two: their centres lie at -1/4, 1/4, 3/4 and 5/4 of the coarse ones.
  const std::vector<BilinearPlace> places = bilinear_places(0, 6, 4, 2);
  ASSERT_EQ(places.size(), 6u);
  const std::uint32_t want[6][3] = {{0, 1, 0}, {0, 1, 64}, {0, 1, 192}, {1, 1, 0}, {1, 1, 0}, {1, 1, 0}};
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_EQ(places[k].first, want[k][0]) << k;
    EXPECT_EQ(places[k].second, want[k][1]) << k;
    EXPECT_EQ(places[k].part, want[k][2]) << k;
  }
  EXPECT_EQ(bilinear_places(2, 1, 4, 2)[0].part, 192u);
  EXPECT_EQ(bilinear_places(0, 1, 1, 1)[0].second, 0u);
}

TEST(ScaleSamples, APatchIsReadWhereItLies) {
  const SamplePatch patch{{1, 1, 2, 2}, {{10, 20, 30, 40}, {0, 255, 0, 255}}};
  const std::vector<BilinearPlace> across{{1, 2, 0}, {1, 2, 128}, {2, 2, 0}}, down{{1, 2, 0}, {1, 2, 128}};
  EXPECT_EQ(scaled_up(patch, across, down), (Samples{{10, 15, 20, 20, 25, 30}, {0, 128, 255, 0, 128, 255}}));
}

TEST(ScaleSamples, APreviewShowsLumaOfColoursAndEveryChannelOfData) {
  Pixels pixels{2, 1, 3, {200, 200, 200, 200, 200, 200}};
  const Bytes file = encode_jpeg(pixels, 100, Subsampling::k444);
  TexturePlane plane;
  plane.width_px = 16;
  plane.height_px = 8;
  EXPECT_EQ(preview_samples(plane, file).samples.size(), 1u);
  plane.role = TextureRole::kNormal;
  const SamplePatch preview = preview_samples(plane, file);
  EXPECT_EQ(preview.rectangle, (TexelRectangle{0, 0, 2, 1}));
  const Samples shown = show_preview(plane, preview, {4, 2, 3, 2});
  ASSERT_EQ(shown.size(), 3u);
  ASSERT_EQ(shown[2].size(), 6u);
  for (const std::uint8_t value : shown[2]) EXPECT_NEAR(value, 200, 2);
  EXPECT_THROW(preview_samples(plane, Bytes(file.begin(), file.end() - 2)), FormatError);
}

}  // namespace texmesh::scale_samples_test
