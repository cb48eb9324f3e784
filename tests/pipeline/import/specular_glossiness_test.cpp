#include "pipeline/import/material_images.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh::specular_glossiness_test {

std::int32_t add_image(Model& model, std::uint32_t side_px, std::array<std::uint8_t, 4> texel) {
  Pixels pixels{side_px, side_px, 4, {}};
  for (std::uint32_t i = 0; i < side_px * side_px; ++i)
    pixels.data.insert(pixels.data.end(), texel.begin(), texel.end());
  model.images.push_back(probe_image("image", write_png(pixels), {}));
  return static_cast<std::int32_t>(model.images.size() - 1);
}

TEST(SpecularGlossiness, DielectricsKeepTheirDiffuseColour) {
  const MetallicRoughness m = metallic_roughness_of({{0.5f, 0.2f, 0.1f}, {0.04f, 0.04f, 0.04f}, 0.3f});
  EXPECT_NEAR(m.metallic, 0, 1e-6);
  EXPECT_NEAR(m.roughness, 0.7, 1e-6);
  EXPECT_NEAR(m.base_colour.x, 0.5, 1e-5);
  EXPECT_NEAR(m.base_colour.y, 0.2, 1e-5);
  EXPECT_NEAR(m.base_colour.z, 0.1, 1e-5);
}

TEST(SpecularGlossiness, MetalsTakeTheirSpecularColour) {
  const MetallicRoughness m = metallic_roughness_of({{0, 0, 0}, {0.9f, 0.6f, 0.3f}, 1});
  EXPECT_NEAR(m.metallic, 1, 1e-5);
  EXPECT_EQ(m.roughness, 0);
  EXPECT_NEAR(m.base_colour.x, 0.9, 1e-5);
  EXPECT_NEAR(m.base_colour.z, 0.3, 1e-5);
}

TEST(SpecularGlossiness, EveryPointGivesNumbersWithinTheirRanges) {
  for (int code = 0; code < 6 * 6 * 6 * 6; ++code) {
    const auto at = [&](int divisor) { return static_cast<float>(code / divisor % 6) / 5; };
    const MetallicRoughness m =
        metallic_roughness_of({{at(1), at(6), at(1)}, {at(36), at(216), at(36)}, at(6)});
    for (const float v : {m.base_colour.x, m.base_colour.y, m.base_colour.z, m.metallic, m.roughness})
      ASSERT_TRUE(v >= 0 && v <= 1) << code;
  }
}

TEST(SpecularGlossiness, ImagesOfTwoSizesBecomeOneOfTheLarger) {
  Model model;
  const std::int32_t diffuse = add_image(model, 4, {0, 0, 0, 128});
  const std::int32_t specular = add_image(model, 8, {255, 188, 0, 51});
  const MetallicRoughnessImages made = convert_specular_glossiness(model, {diffuse, specular}, {});
  const Pixels colour = decode_image(model.images.at(static_cast<std::size_t>(made.base_colour)));
  ASSERT_EQ(colour.width_px, 8u);
  ASSERT_EQ(colour.channels, 4u);
  EXPECT_NEAR(colour.data[0], 255, 1);
  EXPECT_NEAR(colour.data[1], 188, 1);
  EXPECT_NEAR(colour.data[2], 0, 1);
  EXPECT_EQ(colour.data[3], 128);
  const Pixels data = decode_image(model.images.at(static_cast<std::size_t>(made.metallic_roughness)));
  EXPECT_EQ(data.data[0], 255);
  EXPECT_EQ(data.data[1], 204);  // 1 - 51 / 255
  EXPECT_NEAR(data.data[2], 255, 1);
}

TEST(SpecularGlossiness, ADamagedPictureIsToldOnce) {
  Pixels noise{64, 64, 3, Bytes(64 * 64 * 3)};
  for (std::size_t i = 0; i < noise.data.size(); ++i) noise.data[i] = static_cast<std::uint8_t>(i * i / 7);
  Bytes jpeg = encode_jpeg(noise, 90, Subsampling::k444);
  jpeg.resize(jpeg.size() * 7 / 8);
  Model model;
  model.images.push_back(probe_image("image", std::move(jpeg), {}));
  model.images[0].accept_damage = true;
  convert_specular_glossiness(model, {0, -1}, {});
  ASSERT_EQ(model.notes.size(), 1u);
  EXPECT_EQ(model.notes[0].code, "damaged-image");
}

TEST(SpecularGlossiness, MeansOfATexture) {
  Model model;
  TextureRef texture;
  texture.image = add_image(model, 3, {255, 0, 255, 51});
  const SpecularGlossiness mean = mean_of_specular(model, texture, 0, {{1, 1, 1}, {0.5f, 1, 1}, 0.5f}, {});
  EXPECT_NEAR(mean.specular.x, 0.5, 1e-6);
  EXPECT_NEAR(mean.specular.y, 0, 1e-6);
  EXPECT_NEAR(mean.specular.z, 1, 1e-6);
  EXPECT_NEAR(mean.glossiness, 0.1, 1e-6);
}

}  // namespace texmesh::specular_glossiness_test
