// Mips as planes of their own.
#include "stages/fragmentation/fragmentation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "stages/geometry/texel_coverage.h"
#include "tests/stages/fragmentation/fragmentation_inputs.h"
#include "tests/stages/geometry/texel_triangles.h"

namespace texmesh::fragmentation_mips_test {

using namespace testing;  // NOLINT: fixtures

std::vector<std::array<std::uint32_t, 4>> mips_of(const Fragments& f) {
  std::vector<std::array<std::uint32_t, 4>> out;
  for (const TexturePlane& p : f.planes) out.push_back({p.mip, p.base, p.width_px, p.height_px});
  return out;
}

TEST(Fragmentation, MipsGoDownToThePreview) {
  const ConditionedMesh mesh = conditioned(testing::sheet(4));
  Material m = with_base(0);
  m.normal_texture.image = 1;
  m.alpha_mode = AlphaMode::kBlend;
  const std::vector<Image> images{image_of(1001, 600, 4), image_of(4096, 2048)};
  const Fragments out = run_fragmentation(mesh, {m}, images);
  using Row = std::array<std::uint32_t, 4>;
  EXPECT_EQ(mips_of(out), (std::vector<Row>{{0, 0, 1001, 600},
                                            {0, 0, 1001, 600},
                                            {0, 0, 4096, 2048},
                                            {1, 0, 501, 300},
                                            {2, 0, 251, 150},
                                            {1, 1, 501, 300},
                                            {2, 1, 251, 150},
                                            {1, 2, 2048, 1024},
                                            {2, 2, 1024, 512},
                                            {3, 2, 512, 256}}));
  EXPECT_EQ(out.planes[5].role, TextureRole::kAlpha);
  EXPECT_EQ(out.planes[5].channels, 1u);
  EXPECT_EQ(out.planes[9].role, TextureRole::kNormal);
  for (const TexturePlane& p : out.planes) {
    EXPECT_NEAR(total(p.surface_fraction), 1, 1e-5);
    EXPECT_EQ(p.covered_texels.size(), p.fragment_count());
  }
  FragmentationOptions without;
  without.mips = false;
  EXPECT_EQ(run_fragmentation(mesh, {m}, images, 1, without).planes.size(), 3u);
  // 1/8 is there where the preview may be 1/16; small images have none worth its tables.
  EXPECT_EQ(mips_of(run_fragmentation(mesh, {with_base(0)}, {image_of(2048, 2048)})).size(), 4u);
  EXPECT_EQ(mips_of(run_fragmentation(mesh, {with_base(0)}, {image_of(2048, 1024)})).size(), 3u);
  EXPECT_EQ(mips_of(run_fragmentation(mesh, {with_base(0)}, {image_of(510, 510)})).size(), 3u);
  EXPECT_EQ(mips_of(run_fragmentation(mesh, {with_base(0)}, {image_of(254, 254)})).size(), 1u);
  EXPECT_EQ(mips_of(run_fragmentation(mesh, {with_base(0)}, {image_of(255, 16)})).size(), 2u);
}

TEST(Fragmentation, MipsCoverWhatSamplingThemTouches) {
  Mesh mesh = testing::sheet(1, 0);
  mesh.uv0 = {{0.3f, 0.32f}, {0.71f, 0.3f}, {0.33f, 0.6f}, {0.7f, 0.64f}};
  const Fragments out = run_fragmentation(conditioned(mesh), {with_base(0)}, {image_of(1030, 777)});
  ASSERT_EQ(out.planes.size(), 3u);
  for (std::size_t k = 1; k < 3; ++k) {
    const TexturePlane& p = out.planes[k];
    const TexturePlane& finer = out.planes[k - 1];
    std::vector<std::uint8_t> want(coverage_size_bytes(p.width_px, p.height_px));
    TexelCoverage alone(p.width_px, p.height_px, Wrap::kRepeat, Wrap::kRepeat);
    for (const Triangle& t : mesh.triangles) {
      Corners c;
      for (std::size_t i = 0; i < 3; ++i)
        c[i] = {static_cast<double>(mesh.uv0[t[i]].x) * p.width_px,
                static_cast<double>(mesh.uv0[t[i]].y) * p.height_px};
      alone.add(c);
    }
    EXPECT_EQ(p.coverage, alone.bits());
    // A texel is covered wherever a finer one within it is.
    for (std::uint32_t y = 0; y < finer.height_px; ++y)
      for (std::uint32_t x = 0; x < finer.width_px; ++x)
        if (is_covered(finer.coverage, finer.width_px, x, y))
          EXPECT_TRUE(is_covered(p.coverage, p.width_px, x * p.width_px / finer.width_px,
                                 y * p.height_px / finer.height_px));
  }
}

}  // namespace texmesh::fragmentation_mips_test
