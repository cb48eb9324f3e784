#include "stages/poster/poster.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "format/rules/first_look.h"
#include "stages/base/run_context.h"
#include "stages/jpeg/jpeg.h"
#include "stages/poster/poster_camera.h"
#include "stages/render/environment.h"
#include "tests/support/meshes.h"

namespace texmesh::poster_test {

NestedScales scales_of(Mesh mesh) {
  NestedScales out;
  NestedScale s;
  s.triangles = mesh.triangles;
  for (std::uint32_t t = 0; t < s.triangles.size(); ++t) s.triangle_source.push_back(t);
  out.mesh = std::move(mesh);
  out.scales.push_back(std::move(s));
  return out;
}

/// One RGB plane of full size whose texels are value(x, y, channel).
struct Texture {
  Fragments fragments;
  std::vector<Pixels> pixels;
};
Texture texture_of(std::uint32_t side, TextureRole role, auto&& value) {
  Texture out;
  TexturePlane plane;
  plane.role = role;
  plane.width_px = plane.height_px = side;
  plane.channels = role == TextureRole::kAlpha ? 1 : 3;
  plane.columns = plane.rows = 1;
  plane.fragment_width_px = plane.fragment_height_px = (side + 15) / 16 * 16;
  Pixels p{plane.fragment_width_px, plane.fragment_height_px, plane.channels, {}};
  for (std::uint32_t y = 0; y < p.height_px; ++y)
    for (std::uint32_t x = 0; x < p.width_px; ++x)
      for (std::uint32_t c = 0; c < p.channels; ++c)
        p.data.push_back(static_cast<std::uint8_t>(value(x, y, c)));
  out.fragments.planes.push_back(std::move(plane));
  out.pixels.push_back(std::move(p));
  return out;
}

std::vector<Material> textured() {
  std::vector<Material> materials{Material{}};
  materials[0].base_colour_texture.image = 0;
  materials[0].metallic = 0;
  return materials;
}

Poster poster_of(Mesh mesh, const std::vector<Material>& materials = {Material{}},
                 const Texture& texture = {}, const PosterOptions& options = {}, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return make_poster(scales_of(std::move(mesh)), materials, texture.fragments, texture.pixels, options,
                     context);
}

Pixels picture_of(const Poster& poster) { return decode_jpeg(poster.file, 1 << 24); }

/// Pixels that are not the background's grey.
std::size_t shown(const Pixels& p) {
  std::size_t count = 0;
  const std::uint8_t* grey = p.data.data();
  for (std::size_t i = 0; i < p.data.size(); i += 3)
    for (std::size_t c = 0; c < 3; ++c)
      if (std::abs(p.data[i + c] - grey[c]) > 12) {
        ++count;
        break;
      }
  return count;
}

TEST(Poster, IsASquareJpegOfTheWantedSideWithinTheBytes) {
  testing::Random random{5};
  const Texture noise =
      texture_of(1024, TextureRole::kBaseColour, [&](auto, auto, auto) { return random.next() & 255; });
  for (const int max_bytes : {40000, 12000}) {
    const Poster poster = poster_of(testing::bumpy_sphere(40, 80), textured(), noise, {512, max_bytes});
    EXPECT_LE(poster.file.size(), static_cast<std::size_t>(max_bytes));
    EXPECT_GT(poster.file.size(), static_cast<std::size_t>(max_bytes) * 7 / 10) << "the best that fits";
    const Pixels p = picture_of(poster);
    EXPECT_EQ(p.width_px, 512u);
    EXPECT_EQ(poster.width_px, 512u);
    EXPECT_EQ(poster.height_px, p.height_px);
  }
}

TEST(Poster, SidesAreHalvedWhereNoQualityFits) {
  testing::Random random{5};
  const Texture noise =
      texture_of(1024, TextureRole::kBaseColour, [&](auto, auto, auto) { return random.next() & 255; });
  const Poster poster = poster_of(testing::sheet(4), textured(), noise, {1024, 4000});
  EXPECT_LE(poster.file.size(), 4000u);
  EXPECT_LT(poster.width_px, 1024u);
  EXPECT_EQ(picture_of(poster).width_px, poster.width_px);
}

TEST(Poster, ShowsTheObjectAsLargeAsViewersDo) {
  const Pixels p = picture_of(poster_of(testing::sphere(20, 40)));
  std::uint32_t left = p.width_px, right = 0;
  for (std::uint32_t y = 0; y < p.height_px; ++y)
    for (std::uint32_t x = 0; x < p.width_px; ++x)
      if (std::abs(*p.at(x, y) - *p.at(0, 0)) > 12) left = std::min(left, x), right = std::max(right, x + 1);
  // The sphere round the box of a sphere is sqrt(3) times as large.
  const double sine = std::sin(kFirstLookFovDegrees / 2 * std::numbers::pi / 180) / std::sqrt(3.0);
  const double share =
      std::tan(std::asin(sine)) / std::tan(kFirstLookFovDegrees / 2 * std::numbers::pi / 180);
  EXPECT_NEAR(right - left, share * p.width_px, 0.02 * p.width_px);
}

TEST(Poster, ShowsTexturesInTheirColours) {
  const Texture red =
      texture_of(64, TextureRole::kBaseColour, [](auto, auto, std::uint32_t c) { return c == 0 ? 200 : 20; });
  const Pixels p = picture_of(poster_of(testing::sphere(20, 40), textured(), red));
  const std::uint8_t* middle = p.at(256, 256);
  EXPECT_GT(middle[0], middle[1] + 60);
}

TEST(Poster, SameBytesForAnyThreadCount) {
  const Texture waves = texture_of(
      300, TextureRole::kBaseColour,
      [](std::uint32_t x, std::uint32_t y, std::uint32_t c) { return 60 + (x * 3 + y * 5 + c * 40) % 150; });
  const Mesh mesh = testing::bumpy_sphere(40, 80);
  EXPECT_EQ(poster_of(mesh, textured(), waves).file, poster_of(mesh, textured(), waves, {}, 4).file);
}

TEST(Poster, ZeroMeansNone) {
  EXPECT_TRUE(poster_of(testing::cube(), {Material{}}, {}, {0, 40000}).file.empty());
}

TEST(Poster, OneTriangleSeenFromBehindAndATransparentModelGivePictures) {
  Mesh triangle;
  triangle.positions = {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}};  // clockwise from the front
  triangle.wedge_position = {0, 1, 2};
  triangle.triangles = {{0, 1, 2}};
  triangle.triangle_material = {0};
  triangle.normals = {{0, 0, -1}, {0, 0, -1}, {0, 0, -1}};
  EXPECT_GT(shown(picture_of(poster_of(triangle))), 20000u);

  std::vector<Material> clear{Material{}};
  clear[0].alpha_mode = AlphaMode::kBlend;
  clear[0].base_colour = {1, 1, 1, 0};
  const Pixels p = picture_of(poster_of(testing::cube(), clear));
  EXPECT_EQ(p.width_px, 512u);
  EXPECT_EQ(shown(p), 0u);
}

TEST(Poster, PositionsThatAreNotFiniteDoNotCount) {
  Mesh mesh = testing::sphere(10, 20);
  const auto bad = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.push_back({std::numeric_limits<float>::quiet_NaN(), 0, 0});
  mesh.wedge_position.push_back(bad);
  mesh.uv0.push_back({0, 0});
  mesh.normals.push_back({0, 0, 1});
  mesh.triangles.push_back({0, 1, static_cast<std::uint32_t>(mesh.wedge_position.size() - 1)});
  mesh.triangle_material.push_back(0);
  if (!mesh.triangle_part.empty()) mesh.triangle_part.push_back(0);
  EXPECT_GT(shown(picture_of(poster_of(mesh))), 50000u);
}

TEST(Poster, AStrayFarAwayDoesNotMakeTheObjectTiny) {
  Mesh mesh = testing::sphere(30, 60);
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  const auto wedge = static_cast<std::uint32_t>(mesh.wedge_position.size());
  for (std::uint32_t k = 0; k < 3; ++k) {
    mesh.positions.push_back({1000.f + 0.01f * static_cast<float>(k), k == 1 ? 0.01f : 0.f, 0});
    mesh.wedge_position.push_back(first + k);
    mesh.uv0.push_back({0, 0});
    mesh.normals.push_back({0, 0, 1});
  }
  mesh.triangles.push_back({wedge, wedge + 1, wedge + 2});
  mesh.triangle_material.push_back(0);
  if (!mesh.triangle_part.empty()) mesh.triangle_part.push_back(0);
  EXPECT_GT(shown(picture_of(poster_of(mesh))), 50000u);
}

TEST(Poster, PixelsMustFitThePlanes) {
  Texture small = texture_of(64, TextureRole::kBaseColour, [](auto, auto, auto) { return 100; });
  small.pixels[0].width_px = 32;
  EXPECT_THROW(poster_of(testing::cube(), textured(), small), StageError);
  small.pixels.clear();
  EXPECT_THROW(poster_of(testing::cube(), textured(), small), StageError);
}

// delivery/web/tests/page/framing.test.ts has the same numbers for viewers.
TEST(PosterCamera, IsTheOneThatViewersBeginWith) {
  constexpr double kDegree = std::numbers::pi / 180;
  const double ring = std::cos(kFirstLookElevationDegrees * kDegree);
  const Vec3d direction{ring * std::sin(kFirstLookAzimuthDegrees * kDegree),
                        std::sin(kFirstLookElevationDegrees * kDegree),
                        ring * std::cos(kFirstLookAzimuthDegrees * kDegree)};
  const RenderCamera c = first_look({{-1, 1, 2}, {3, 0, 3}, {0, 0.5, 4}}, direction);
  EXPECT_LT(length(c.eye - Vec3d{4.711566046, 3.068762430, 9.980440491}), 1e-8);
  EXPECT_LT(length(c.z - direction), 1e-12);
  EXPECT_NEAR(c.tan_half_fov, std::tan(16 * kDegree), 1e-12);
}

TEST(PosterCamera, HoldsAllPositionsWithTheMargin) {
  const std::vector<Vec3d> points{{0, 0, 0}, {3, 0, 0}, {0, 1, 2}, {1, 1, -4}};
  const RenderCamera c = fitted_camera(points, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, 0);
  double most = 0;
  for (const Vec3d p : points) {
    const Vec3d d = p - c.eye;
    const double away = -dot(d, c.z);
    EXPECT_GT(away, c.near);
    const double x = dot(d, c.x) / away / c.tan_half_fov, y = dot(d, c.y) / away / c.tan_half_fov;
    most = std::max({most, std::abs(x), std::abs(y)});
  }
  EXPECT_NEAR(most, 0.92, 1e-9);
}

}  // namespace texmesh::poster_test
