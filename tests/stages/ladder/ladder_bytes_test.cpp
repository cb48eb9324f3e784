// What all rungs of a JPEG take beside it: mips and tables included, at most 1.9 times its bytes.
#include <gtest/gtest.h>

#include "stages/image/resize.h"
#include "stages/previews/previews.h"
#include "tests/stages/ladder/source_scenes.h"
#include "tests/support/meshes.h"

namespace texmesh::ladder_bytes_test {

using namespace testing;  // NOLINT: fixtures

/// Clouds of several sizes with grain, as photographs have them.
Bytes photograph(int side_px, int channels) {
  Random random{11};
  Bytes out;
  for (int y = 0; y < side_px; ++y)
    for (int x = 0; x < side_px; ++x) {
      const double waves = 40 * std::sin(x * 0.021 + y * 0.013) + 25 * std::sin(x * 0.11 - y * 0.07) +
                           12 * std::sin(x * 0.6 + 2 * std::sin(y * 0.4));
      const int grain = static_cast<int>(random.next() % 13) - 6;
      for (int c = 0; c < channels; ++c)
        out.push_back(
            static_cast<std::uint8_t>(std::clamp(128 + waves * (c == 1 ? 0.8 : 1) + grain, 0., 255.)));
    }
  return out;
}

/// The image's plane and its mips down to one fragment.
Scene chain_of(Image image, TextureRole role) {
  Scene out = scene_of(std::move(image), 128);
  out.plane().role = role;
  const auto none = [](std::uint32_t, std::uint32_t) { return false; };
  cover(out.plane(), none);
  while (out.fragments.planes.back().width_px > 128) {
    const TexturePlane& finer = out.fragments.planes.back();
    TexturePlane mip = finer;
    mip.mip = finer.mip + 1;
    mip.width_px /= 2, mip.height_px /= 2, mip.columns /= 2, mip.rows /= 2;
    cover(mip, none);
    mip.surface_fraction.assign(mip.fragment_count(), 1.0f / static_cast<float>(mip.fragment_count()));
    out.pixels.push_back(halved(out.pixels.back(), finer.width_px, finer.height_px,
                                is_colour(role)                ? Averaging::kLight
                                : role == TextureRole::kNormal ? Averaging::kNormals
                                                               : Averaging::kNumbers));
    out.fragments.planes.push_back(std::move(mip));
  }
  return out;
}

struct Case {
  Kind kind;
  TextureRole role = TextureRole::kBaseColour;
};

TEST(LadderBytes, AllRungsOfAJpegTakeAtMostNineteenTenthsOfIt) {
  const Case cases[] = {{{"colours"}},
                        {{"colours of low quality", 3, 2, 2, false, false, 60}},
                        {{"colours of high quality", 3, 1, 1, false, false, 97}},
                        {{"progressive", 3, 2, 2, true}},
                        {{"grey", 1}},
                        {{"normals"}, TextureRole::kNormal},
                        {{"normals of low quality", 3, 2, 2, false, false, 70}, TextureRole::kNormal},
                        {{"roughness"}, TextureRole::kOcclusionRoughnessMetallic}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.kind.name);
    const Scene scene =
        chain_of(image_of(make_jpeg(c.kind, 512, 512, photograph(512, c.kind.channels))), c.role);
    const Ladder ladder =
        encode_ladder(scene.fragments, scene.pixels, make_previews(scene.fragments, scene.pixels, {}, {}),
                      {scene.image}, {}, {});
    EXPECT_TRUE(ladder.planes[0].source_rung);
    std::size_t bytes = 0;
    for (const PlaneLadder& plane : ladder.planes)
      for (const LadderRung& rung : plane.rungs) bytes += rung.data.size() + rung.table_stream.size();
    EXPECT_LE(static_cast<double>(bytes), 1.9 * static_cast<double>(scene.image.bytes.size()));
    EXPECT_GT(bytes, scene.image.bytes.size() / 2) << "nothing is measured";
  }
}

}  // namespace texmesh::ladder_bytes_test
