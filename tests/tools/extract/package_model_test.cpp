// What of a package the renderer is given.
#include "tools/extract/package_model.h"

#include <gtest/gtest.h>

#include "tests/support/packages.h"

namespace texmesh::testing::package_model_test {

RenderedModel model_of(const Bytes& package, const PackageChoice& choice, int threads = 1) {
  PackageReader reader(open_container(memory_source(package)));
  RunContext context;
  context.threads = threads;
  return package_model(reader, choice, context);
}
const Bytes& small_package() {
  static const Bytes bytes = make_package_parts().build();
  return bytes;
}

TEST(PackageModel, ScalesHaveTheirMeshesAndTheSameBounds) {
  const RenderedModel fine = model_of(small_package(), {}), coarse = model_of(small_package(), {5});
  EXPECT_EQ(fine.mesh.triangles.size(), fine_mesh().triangles.size());
  EXPECT_EQ(coarse.mesh.triangles.size(), coarse_mesh().triangles.size());
  EXPECT_EQ(fine.bounds.centre, coarse.bounds.centre);
  EXPECT_EQ(fine.bounds.radius, coarse.bounds.radius);
}

TEST(PackageModel, TexturesAreThePlanesAtTheRung) {
  PackageReader reader(open_container(memory_source(small_package())));
  for (const std::uint32_t rung : {0u, 1u, kBestRung}) {
    const RenderedModel m = model_of(small_package(), {0, PackageTextures::kRung, rung}, 4);
    ASSERT_EQ(m.textures.size(), 1u);
    EXPECT_TRUE(m.texture_images[0].srgb);
    EXPECT_EQ(m.textures[0].width_px, 64u);
    EXPECT_EQ(m.textures[0].height_px, 48u);
    EXPECT_EQ(m.textures[0].levels.front().data, read_plane(reader, 0, rung, {}).data);
  }
  EXPECT_NE(model_of(small_package(), {0, PackageTextures::kRung, 0}).textures[0].levels.front().data,
            model_of(small_package(), {0, PackageTextures::kRung, 1}).textures[0].levels.front().data);
}

TEST(PackageModel, PreviewsAreSmallAndSourcesFallBackToTheBestRung) {
  const RenderedModel preview = model_of(small_package(), {0, PackageTextures::kPreview});
  const TextureInfo info = make_package_parts().textures.at(0);
  EXPECT_EQ(preview.textures.at(0).width_px, info.preview_width_px);
  EXPECT_EQ(preview.textures.at(0).height_px, info.preview_height_px);
  const RenderedModel source = model_of(small_package(), {0, PackageTextures::kSource});
  EXPECT_EQ(source.textures.at(0).levels.front().data,
            model_of(small_package(), {}).textures.at(0).levels.front().data);
}

TEST(PackageModel, AnotherScaleForTheSameTextures) {
  PackageReader reader(open_container(memory_source(small_package())));
  const RenderedModel fine = package_model(reader, {}, {}), coarse = package_scale(reader, 5, fine, {}),
                      whole = package_model(reader, {5}, {});
  EXPECT_EQ(coarse.mesh.positions, whole.mesh.positions);
  EXPECT_TRUE(coarse.textures.empty());
  EXPECT_EQ(coarse.texture_images, fine.texture_images);
  EXPECT_EQ(coarse.materials.at(0).slot(TextureUse::kBaseColour).texture, 0);
  EXPECT_EQ(coarse.bounds.radius, fine.bounds.radius);
  EXPECT_THROW(package_scale(reader, 3, fine, {}), InputError);
  RenderedModel bare = fine;
  bare.texture_images.clear();
  EXPECT_EQ(package_scale(reader, 5, bare, {}).materials.at(0).slot(TextureUse::kBaseColour).texture, -1);
}

TEST(PackageModel, WhatIsNotThereIsNamed) {
  EXPECT_THROW(model_of(small_package(), {3}), InputError);
  EXPECT_THROW(model_of(small_package(), {0, PackageTextures::kRung, 2}), InputError);
}

}  // namespace texmesh::testing::package_model_test
