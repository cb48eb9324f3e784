#include "stages/render/visibility_tile.h"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/stages/render/render_fixtures.h"
#include "tests/support/meshes.h"

namespace texmesh::visibility_tile_test {

using testing::front_camera;
using testing::plain;
using testing::SmallScene;

/// Triangles of all sizes, some of them across the near plane, some without an area; every third lets see
/// what lies behind it.
SmallScene crowd(std::size_t count) {
  SmallScene scene{{}, {plain({1, 1, 1, 1}), plain({1, 1, 1, 0.5f})}, {}};
  for (RenderMaterial& m : scene.materials) m.double_sided = true;
  scene.materials[1].alpha_mode = AlphaMode::kBlend;
  testing::Random random{3};
  const auto place = [&](double around) { return static_cast<float>((random.uniform() - 0.5) * around); };
  for (std::size_t t = 0; t < count; ++t) {
    const double size = t % 5 == 0 ? 3 : t % 2 == 0 ? 0.3 : 0.02;
    const Vec3f middle{place(2), place(2), place(t % 7 == 0 ? 25 : 2)};
    for (int k = 0; k < 3; ++k)
      scene.mesh.positions.push_back(t % 11 == 0 ? middle
                                                 : middle + Vec3f{place(size), place(size), place(size)});
    const auto first = static_cast<std::uint32_t>(3 * t);
    scene.mesh.triangles.push_back({first, first + 1, first + 2});
    scene.mesh.triangle_material.push_back(t % 3 == 0);
  }
  scene.mesh.wedge_position.resize(3 * count);
  std::iota(scene.mesh.wedge_position.begin(), scene.mesh.wedge_position.end(), 0u);
  return scene;
}

TEST(VisibilityTile, PairsOfSamplesChangeNoBit) {
  constexpr std::uint32_t kSide = 2 * kTilePx;
  const SmallScene scene = crowd(400);
  const RenderScene shown = scene.scene();
  const RenderCamera camera = front_camera();
  TileInput input{&shown, SampleFrame(camera, kSide), camera.near, kSide, {}, {}, true};
  for (const Vec3f p : scene.mesh.positions) input.seen.push_back(seen_from(camera, input.frame, p));
  std::vector<std::uint32_t> all(scene.mesh.triangles.size());
  std::iota(all.begin(), all.end(), 0u);
  for (const std::uint32_t t : all)
    input.boxes.push_back(sample_box(input.corners_of(t), input.frame, camera.near));
  TileInput single = input;
  single.pairs = false;
  for (std::uint32_t tile = 0; tile < 4; ++tile) {
    const TileFragments a = look_into_tile(input, tile % 2, tile / 2, all),
                        b = look_into_tile(single, tile % 2, tile / 2, all);
    ASSERT_EQ(a.count, b.count);
    ASSERT_GT(a.fragments.size(), 1000u);
    for (std::size_t i = 0; i < a.fragments.size(); ++i) {
      const RenderFragment &f = a.fragments[i], &g = b.fragments[i];
      ASSERT_EQ(f.triangle, g.triangle) << i;
      ASSERT_EQ(f.mask, g.mask) << i;
      ASSERT_EQ(f.weight1, g.weight1) << i;
      ASSERT_EQ(f.weight2, g.weight2) << i;
    }
  }
}

}  // namespace texmesh::visibility_tile_test
