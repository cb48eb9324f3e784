#include "stages/image/pixel_window.h"

#include <gtest/gtest.h>

#include "format/base/errors.h"

namespace texmesh::check_pixels_test {

TEST(CheckPixels, OfEveryPlaneWholeFragmentsOfItsChannels) {
  TexturePlane plane;
  plane.channels = 1;
  plane.width_px = 20;  // of 32
  plane.height_px = 10;
  plane.fragment_width_px = plane.fragment_height_px = 16;
  plane.columns = 2;
  plane.rows = 1;
  Fragments fragments;
  fragments.planes = {plane};
  const Pixels good{32, 16, 1, std::vector<std::uint8_t>(32 * 16)};
  EXPECT_NO_THROW(check_pixels("test", {}, {}));
  EXPECT_NO_THROW(check_pixels("test", fragments, {good}));
  EXPECT_THROW(check_pixels("test", fragments, {}), StageError);
  EXPECT_THROW(check_pixels("test", fragments, {good, good}), StageError);
  const auto refused = [&](auto change) {
    Pixels pixels = good;
    change(pixels);
    EXPECT_THROW(check_pixels("test", fragments, {pixels}), StageError);
  };
  refused([](Pixels& p) { p.width_px = 20; });
  refused([](Pixels& p) { p.height_px = 32; });
  refused([](Pixels& p) { p.channels = 3; });
  refused([](Pixels& p) { p.data.pop_back(); });
}

}  // namespace texmesh::check_pixels_test
