#include "stages/previews/previews.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "format/base/errors.h"
#include "stages/base/run_context.h"
#include "stages/jpeg/jpeg.h"
#include "tests/support/meshes.h"

namespace texmesh::previews_test {

using testing::Random;

struct Plane {
  Fragments fragments;
  std::vector<Pixels> pixels;
};

/// One plane in fragments of side x side px; value(x, y, channel).
Plane make_plane(std::uint32_t columns, std::uint32_t rows, std::uint32_t side, std::uint32_t channels,
                 auto&& value) {
  TexturePlane plane;
  plane.channels = channels;
  plane.columns = columns;
  plane.rows = rows;
  plane.fragment_width_px = plane.fragment_height_px = side;
  plane.width_px = columns * side;
  plane.height_px = rows * side;
  Pixels pixels{plane.width_px, plane.height_px, channels, {}};
  for (std::uint32_t y = 0; y < plane.height_px; ++y)
    for (std::uint32_t x = 0; x < plane.width_px; ++x)
      for (std::uint32_t c = 0; c < channels; ++c)
        pixels.data.push_back(static_cast<std::uint8_t>(value(x, y, c)));
  Plane out;
  out.fragments.planes.push_back(std::move(plane));
  out.pixels.push_back(std::move(pixels));
  return out;
}

std::uint32_t shade(std::uint32_t x, std::uint32_t y, std::uint32_t c) {
  return 90 + (x * 3 + y * 2 + c * 40) % 97;
}

PlanePreview preview_of(const Plane& p, const PreviewOptions& options = {}, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return make_previews(p.fragments, p.pixels, options, context).planes.at(0);
}

/// Luma's sampling factors in the frame header of a baseline JPEG: 0x22 halves the chroma.
int luma_sampling(const Bytes& jpeg) {
  for (std::size_t at = 2; at + 11 < jpeg.size() && jpeg[at] == 0xff;) {
    if (jpeg[at + 1] == 0xc0) return jpeg[at + 11];
    at += 2 + (std::size_t{jpeg[at + 2]} << 8 | jpeg[at + 3]);
  }
  return -1;
}

TEST(Previews, OfDataAreNotSubsampled) {
  Plane p = make_plane(2, 2, 64, 3, shade);
  const auto sampling = [&](TextureRole role, Subsampling colours = Subsampling::k420) {
    p.fragments.planes[0].role = role;
    return luma_sampling(preview_of(p, {.subsampling = colours}).file);
  };
  for (const TextureRole role : {TextureRole::kBaseColour, TextureRole::kEmissive, TextureRole::kColour})
    EXPECT_EQ(sampling(role), 0x22);
  for (const TextureRole role :
       {TextureRole::kNormal, TextureRole::kOcclusionRoughnessMetallic, TextureRole::kData})
    EXPECT_EQ(sampling(role), 0x11);
  EXPECT_EQ(sampling(TextureRole::kBaseColour, Subsampling::k444), 0x11);
}

TEST(Previews, AreOneEighthWhereThatIsSmallAndOneSixteenthElsewhere) {
  Plane p = make_plane(4, 2, 64, 3, shade);
  p.fragments.planes[0].width_px = 250;  // the plane proper ends in the last fragment
  PlanePreview preview = preview_of(p);
  EXPECT_EQ(preview.width_px, 32u);
  EXPECT_EQ(preview.height_px, 16u);
  const Pixels decoded = decode_jpeg(preview.file, 1 << 20);
  EXPECT_EQ(decoded.width_px, 32u);
  EXPECT_EQ(decoded.height_px, 16u);

  Random random{7};
  const Plane noisy = make_plane(6, 6, 256, 1, [&](auto, auto, auto) { return random.next(); });
  preview = preview_of(noisy, {.quality = 100});
  EXPECT_EQ(preview.width_px, 96u);
  EXPECT_EQ(decode_jpeg(preview.file, 1 << 20).channels, 1u);

  Plane tiny = make_plane(1, 1, 16, 3, shade);
  tiny.fragments.planes[0].width_px = tiny.fragments.planes[0].height_px = 1;
  preview = preview_of(tiny);
  EXPECT_EQ(preview.width_px, 1u);
  const Pixels dot = decode_jpeg(preview.file, 16);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(dot.data[c], tiny.pixels[0].data[c], 12);
}

TEST(Previews, AreMeansOfWhatMipsAreMeansOf) {
  const auto texels = [](TextureRole role, auto value) {
    Plane p = make_plane(2, 2, 64, 3, [&](auto x, auto y, auto c) { return value(x + y, c); });
    p.fragments.planes[0].role = role;
    return decode_jpeg(preview_of(p).file, 1 << 20).data;
  };
  const auto stripes = [](std::uint32_t k, std::uint32_t) { return k % 2 * 255; };
  for (const std::uint8_t v : texels(TextureRole::kBaseColour, stripes))
    EXPECT_NEAR(v, 188, 2) << "half the light, not half the code";
  for (const std::uint8_t v : texels(TextureRole::kOcclusionRoughnessMetallic, stripes))
    EXPECT_NEAR(v, 128, 2);
  const auto ridges = [](std::uint32_t k, std::uint32_t c) {
    return c == 1 ? 128u : c == 2 ? 204u : k % 2 ? 230u : 25u;
  };
  const auto normals = texels(TextureRole::kNormal, ridges);  // their mean is (0, 0, 1)
  for (std::size_t k = 0; k < normals.size(); k += 3) EXPECT_NEAR(normals[k + 2], 255, 3);
}

TEST(Previews, MipsHaveNone) {
  Plane p = make_plane(2, 2, 64, 3, shade);
  p.fragments.planes.push_back(p.fragments.planes[0]);
  p.fragments.planes[1].mip = 1;
  p.pixels.push_back(p.pixels[0]);
  const Previews previews = make_previews(p.fragments, p.pixels, {}, {});
  ASSERT_EQ(previews.planes.size(), 2u);
  EXPECT_FALSE(previews.planes[0].file.empty());
  EXPECT_TRUE(previews.planes[1].file.empty());
  EXPECT_EQ(previews.planes[1].width_px, 0u);
}

TEST(Previews, SameBytesForAnyNumberOfThreadsAndPixelsThatDoNotFitAreRefused) {
  Plane p = make_plane(5, 4, 48, 3, shade);
  EXPECT_EQ(preview_of(p, {}, 1).file, preview_of(p, {}, 8).file);
  p.pixels[0].data.pop_back();
  EXPECT_THROW(preview_of(p), StageError);
  p.pixels.clear();
  EXPECT_THROW(preview_of(p), StageError);
  EXPECT_TRUE(make_previews({}, {}, {}, {}).planes.empty());
}

}  // namespace texmesh::previews_test
