#include "stages/render/visibility.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>

#include "tests/stages/render/render_fixtures.h"

namespace texmesh::visibility_test {

using testing::front_camera;
using testing::joined;
using testing::plain;
using testing::SmallScene;
using testing::square;

std::uint64_t samples_of(const Visibility& seen) {
  std::uint64_t sum = 0;
  for (const RenderFragment& f : seen.fragments) sum += static_cast<std::uint64_t>(std::popcount(f.mask));
  return sum;
}
std::vector<RenderFragment> pixel(const Visibility& seen, std::uint32_t x, std::uint32_t y) {
  const std::size_t p = static_cast<std::size_t>(y) * seen.side_px + x;
  return {seen.fragments.begin() + seen.first[p], seen.fragments.begin() + seen.first[p + 1]};
}
void expect_equal(const Visibility& a, const Visibility& b) {
  EXPECT_EQ(a.first, b.first);
  ASSERT_EQ(a.fragments.size(), b.fragments.size());
  for (std::size_t i = 0; i < a.fragments.size(); ++i) {
    const RenderFragment &f = a.fragments[i], &g = b.fragments[i];
    EXPECT_TRUE(f.triangle == g.triangle && f.weight1 == g.weight1 && f.weight2 == g.weight2 &&
                f.mask == g.mask && f.layer == g.layer && f.back == g.back);
  }
}
RenderMaterial blended() {
  RenderMaterial m = plain({1, 1, 1, 0.5f});
  m.alpha_mode = AlphaMode::kBlend;
  return m;
}

TEST(Visibility, ASquareThatFillsThePictureCoversEverySampleOnce) {
  const SmallScene scene{square(), {plain({1, 1, 1, 1})}, {}};
  for (const std::uint32_t side : {1u, 7u, 32u, 33u, 100u}) {
    const Visibility seen = scene.seen(front_camera(), side);
    EXPECT_EQ(samples_of(seen), 16ull * side * side);
    ASSERT_EQ(seen.first.size(), std::size_t{side} * side + 1);
    for (std::uint32_t p = 0; p + 1 < seen.first.size(); ++p) {
      unsigned mask = 0;
      for (std::uint32_t i = seen.first[p]; i < seen.first[p + 1]; ++i) {
        EXPECT_EQ(mask & seen.fragments[i].mask, 0u);
        mask |= seen.fragments[i].mask;
      }
      EXPECT_EQ(mask, 0xffffu);
    }
  }
}

TEST(Visibility, ACoveredHalfOfAPixelIsHalfItsSamples) {
  SmallScene scene{square(), {plain({1, 1, 1, 1})}, {}};
  // 8 px show -1..1: x < 0.125 ends in the middle of pixel 4.
  for (Vec3f& p : scene.mesh.positions) p.x = std::min(p.x, 0.125f);
  const Visibility seen = scene.seen(front_camera(), 8);
  EXPECT_EQ(samples_of(seen), 16u * 8 * 4 + 8 * 8);
  for (std::uint32_t y = 0; y < 8; ++y) {
    unsigned mask = 0;
    for (const RenderFragment& f : pixel(seen, 4, y)) mask |= f.mask;
    EXPECT_EQ(mask, 0x3333u) << "columns 0 and 1";
    EXPECT_TRUE(pixel(seen, 5, y).empty());
  }
}

TEST(Visibility, NoSampleFallsBetweenTheTrianglesOfAFan) {
  // A blended disc of slivers around a point: every sample within belongs to exactly one.
  SmallScene scene{{}, {blended()}, {}};
  constexpr std::uint32_t kSpokes = 97;
  Mesh& mesh = scene.mesh;
  mesh.positions.push_back({0.013f, -0.007f, 0});
  for (std::uint32_t i = 0; i < kSpokes; ++i) {
    const double a = 2 * 3.14159265358979 * i / kSpokes;
    mesh.positions.push_back({static_cast<float>(3 * std::cos(a)), static_cast<float>(3 * std::sin(a)), 0});
    mesh.triangles.push_back({0, i + 1, (i + 1) % kSpokes + 1});
  }
  for (std::uint32_t i = 0; i <= kSpokes; ++i) mesh.wedge_position.push_back(i);
  mesh.triangle_material.assign(kSpokes, 0);
  for (const double distance : {10., 7.3, 5.1}) {
    const Visibility seen = scene.seen(front_camera(distance), 64);
    EXPECT_EQ(samples_of(seen), 16ull * 64 * 64) << distance;
  }
}

TEST(Visibility, WeightsAreInPerspective) {
  // A square that lies like a floor; the weights give back the place that the ray hits.
  SmallScene scene{square(), {plain({1, 1, 1, 1})}, {}};
  scene.materials[0].double_sided = true;
  for (Vec3f& p : scene.mesh.positions) p = {p.x, -0.3f, p.y};
  const RenderCamera camera = look_at_camera({0.2, 0.6, 1.8}, {0, -0.3, 0}, {0, 1, 0}, 50, 0.01);
  const std::uint32_t side = 40;
  const Visibility seen = scene.seen(camera, side);
  std::size_t checked = 0;
  for (std::uint32_t p = 0; p < side * side; ++p)
    for (std::uint32_t i = seen.first[p]; i < seen.first[p + 1]; ++i) {
      const RenderFragment& f = seen.fragments[i];
      if (f.mask != 0xffff) continue;
      const Triangle& t = scene.mesh.triangles[f.triangle];
      const Vec3d a = to_double(scene.mesh.positions[t[0]]), b = to_double(scene.mesh.positions[t[1]]),
                  c = to_double(scene.mesh.positions[t[2]]);
      const Vec3d hit = a + (b - a) * f.weight1 + (c - a) * f.weight2;
      const double x = ((p % side + 0.5) / side * 2 - 1) * camera.tan_half_fov,
                   y = (1 - (p / side + 0.5) / side * 2) * camera.tan_half_fov;
      const Vec3d ray = camera.x * x + camera.y * y - camera.z;
      const Vec3d expected = camera.eye + ray * ((-0.3 - camera.eye.y) / ray.y);
      EXPECT_NEAR(length(hit - expected), 0, 1e-5);
      ++checked;
    }
  EXPECT_GT(checked, 300u);
}

TEST(Visibility, TheNearestIsSeenWhateverTheOrder) {
  for (const float z : {-0.5f, 0.5f}) {
    const SmallScene scene{joined(square(), square(), 1, {0, 0, z}), {plain({}), plain({})}, {}};
    for (const RenderFragment& f : scene.seen(front_camera(12), 16).fragments)
      EXPECT_EQ(f.triangle / 2, z > 0 ? 1u : 0u);
  }
}

TEST(Visibility, OfEqualOnesTheLowerIndexIsSeen) {
  const SmallScene scene{joined(square(), square(), 1, {}), {plain({}), plain({})}, {}};
  for (const RenderFragment& f : scene.seen(front_camera(), 16).fragments) EXPECT_LT(f.triangle, 2u);
}

TEST(Visibility, BacksAreSeenOfDoubleSidedMaterialsOnly) {
  SmallScene scene{square(), {plain({1, 1, 1, 1})}, {}};
  const RenderCamera behind = look_at_camera({0, 0, -10}, {0, 0, 0}, {0, 1, 0}, 12, 0.01);
  EXPECT_TRUE(scene.seen(behind, 16).fragments.empty());
  scene.materials[0].double_sided = true;
  const Visibility seen = scene.seen(behind, 16);
  EXPECT_FALSE(seen.fragments.empty());
  for (const RenderFragment& f : seen.fragments) EXPECT_EQ(f.back, 1);
  for (const RenderFragment& f : scene.seen(front_camera(), 16).fragments) EXPECT_EQ(f.back, 0);
}

TEST(Visibility, WhatReachesBehindTheEyeIsCutAtTheNearPlane) {
  // The camera stands on an endless floor and looks along it: all below the horizon is floor.
  SmallScene scene{square(), {plain({1, 1, 1, 1})}, {}};
  for (Vec3f& p : scene.mesh.positions) p = {p.x * 1e4f, 0, -p.y * 1e4f};
  const RenderCamera camera = look_at_camera({0, 1, 0}, {0, 1, -1}, {0, 1, 0}, 90, 0.01);
  const Visibility seen = scene.seen(camera, 32);
  for (std::uint32_t y = 0; y < 32; ++y)
    for (std::uint32_t x = 0; x < 32; ++x) {
      unsigned mask = 0;
      for (const RenderFragment& f : pixel(seen, x, y)) mask |= f.mask;
      EXPECT_EQ(mask, y < 16 ? 0u : 0xffffu) << x << " " << y;
    }
  // Nearer than the near plane nothing is seen.
  RenderCamera far_plane = camera;
  far_plane.near = 2;
  const Visibility cut = scene.seen(far_plane, 32);
  EXPECT_FALSE(pixel(cut, 16, 17).empty());
  EXPECT_TRUE(pixel(cut, 16, 31).empty());
}

TEST(Visibility, WhatLiesBehindTheEyeIsNotSeen) {
  const SmallScene scene{square(), {plain({1, 1, 1, 1})}, {}};
  const RenderCamera away = look_at_camera({0, 0, -10}, {0, 0, -20}, {0, 1, 0}, 60, 0.01);
  EXPECT_TRUE(scene.seen(away, 16).fragments.empty());
}

TEST(Visibility, LayersStandFromNearToFarBeforeWhatIsOpaque) {
  Mesh mesh = square();                             // 0, 1: opaque
  mesh = joined(mesh, square(), 1, {0, 0, 0.2f});   // 2, 3: blend
  mesh = joined(mesh, square(), 1, {0, 0, 0.4f});   // 4, 5: blend, nearer
  mesh = joined(mesh, square(), 1, {0, 0, -0.2f});  // 6, 7: hidden
  const SmallScene scene{mesh, {plain({1, 1, 1, 1}), blended()}, {}};
  const std::vector<RenderFragment> at = pixel(scene.seen(front_camera(11), 16), 4, 9);
  ASSERT_EQ(at.size(), 3u);
  EXPECT_EQ(at[0].triangle / 2, 2u);
  EXPECT_EQ(at[1].triangle / 2, 1u);
  EXPECT_EQ(at[2].triangle / 2, 0u);
  EXPECT_EQ(at[0].layer, 1);
  EXPECT_EQ(at[2].layer, 0);
}

TEST(Visibility, TheNearestLayersAreKept) {
  Mesh mesh = square();
  mesh.triangle_material.assign(2, 0);
  for (int i = 1; i < 50; ++i) mesh = joined(mesh, square(), 0, {0, 0, 0.01f * static_cast<float>(i)});
  const SmallScene scene{mesh, {blended()}, {}};
  const std::vector<RenderFragment> at = pixel(scene.seen(front_camera(12), 16), 4, 9);
  ASSERT_EQ(at.size(), kMaxLayers);
  for (std::size_t i = 0; i < at.size(); ++i) EXPECT_EQ(at[i].triangle / 2, 49 - i);
}

TEST(Visibility, SameForAnyNumberOfThreads) {
  Mesh mesh = testing::bumpy_sphere(40, 60);
  mesh.triangle_material.assign(mesh.triangles.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 5) mesh.triangle_material[t] = 1;
  SmallScene scene{mesh, {plain({1, 1, 1, 1}), blended()}, {}};
  scene.materials[1].double_sided = true;
  const RenderCamera camera = perspective_camera(camera_of(3, 7, {}, 1.1));
  expect_equal(scene.seen(camera, 150, 1), scene.seen(camera, 150, 8));
}

TEST(Visibility, OnlyBandsThatAreLookedAtShowSomething) {
  Mesh mesh = testing::bumpy_sphere(20, 30);
  mesh.triangle_material.assign(mesh.triangles.size(), 0);
  const SmallScene scene{mesh, {plain({1, 1, 1, 1})}, {}};
  const RenderCamera camera = perspective_camera(camera_of(3, 7, {}, 1.1));
  constexpr std::uint32_t kSide = 100;
  const std::vector<std::uint8_t> bands{0, 1, 0, 1};
  const Visibility whole = scene.seen(camera, kSide), part = look(scene.scene(), camera, kSide, {}, bands);
  ASSERT_EQ(part.first.size(), whole.first.size());
  for (std::size_t p = 0; p + 1 < whole.first.size(); ++p) {
    const std::uint32_t count = bands[p / kSide / kBandPx] ? whole.first[p + 1] - whole.first[p] : 0;
    ASSERT_EQ(part.first[p + 1] - part.first[p], count) << p;
    for (std::uint32_t k = 0; k < count; ++k)
      EXPECT_EQ(part.fragments[part.first[p] + k].mask, whole.fragments[whole.first[p] + k].mask);
  }
  EXPECT_THROW(look(scene.scene(), camera, kSide, {}, std::vector<std::uint8_t>(3)), std::invalid_argument);
}

TEST(Visibility, AScaleOfANestTakesItsMaterialsFromTheSourceTriangles) {
  const Mesh mesh = joined(square(), square(), 1, {0, 0, 1});
  const std::vector<RenderMaterial> materials{plain({}), blended()};
  const std::vector<Triangle> triangles{{4, 5, 6}};
  const std::vector<std::uint32_t> source{2};
  const RenderScene scene{&mesh, &triangles, &source, &materials, 0};
  const Visibility seen = look(scene, front_camera(12), 16, {});
  EXPECT_FALSE(seen.fragments.empty());
  for (const RenderFragment& f : seen.fragments) EXPECT_EQ(f.layer, 1);
}

TEST(Visibility, HostileGeometryIsNotSeenAndDoesNoHarm) {
  const float nan = std::nanf(""), infinity = std::numeric_limits<float>::infinity();
  for (const Vec3f corner : {Vec3f{nan, 0, 0}, {infinity, 0, 0}, {0, -infinity, 0}, {0, 0, nan}}) {
    SmallScene scene{square(), {plain({1, 1, 1, 1})}, {}};
    scene.mesh.positions[1] = corner;
    const Visibility seen = scene.seen(front_camera(), 16);
    for (const RenderFragment& f : seen.fragments) EXPECT_EQ(f.triangle, 1u);
  }
  SmallScene scene{square(), {plain({1, 1, 1, 1})}, {}};
  scene.mesh.positions[1] = scene.mesh.positions[0];  // no area
  // The diagonal of 64 samples belongs to one of its sides.
  EXPECT_NEAR(static_cast<double>(samples_of(scene.seen(front_camera(), 16))), 8 * 16 * 16, 32);
  for (Vec3f& p : scene.mesh.positions) p = {3e38f, 3e38f, -3e38f};
  EXPECT_TRUE(scene.seen(front_camera(), 16).fragments.empty());
  const SmallScene nothing{{}, {}, {}};
  EXPECT_TRUE(nothing.seen(front_camera(), 16).fragments.empty());
}

TEST(Visibility, WhatCannotBeShownIsRefused) {
  SmallScene scene{square(), {plain({1, 1, 1, 1})}, {}};
  EXPECT_THROW(scene.seen(front_camera(), 0), std::invalid_argument);
  EXPECT_THROW(scene.seen(front_camera(), 8193), std::invalid_argument);
  RenderCamera camera = front_camera();
  camera.eye.x = std::nan("");
  EXPECT_THROW(scene.seen(camera, 8), std::invalid_argument);
  camera = front_camera();
  camera.near = 0;
  EXPECT_THROW(scene.seen(camera, 8), std::invalid_argument);
  scene.mesh.triangle_material[1] = 1;
  EXPECT_THROW(scene.seen(front_camera(), 8), std::invalid_argument);
  scene.mesh.triangle_material.pop_back();
  EXPECT_THROW(scene.seen(front_camera(), 8), std::invalid_argument);
  scene.mesh = square();
  scene.mesh.triangles[0][1] = 4;
  EXPECT_THROW(scene.seen(front_camera(), 8), std::invalid_argument);
}

}  // namespace texmesh::visibility_test
