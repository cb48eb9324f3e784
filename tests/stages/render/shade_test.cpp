#include "stages/render/shade.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "format/base/portable_math.h"
#include "stages/render/render_math.h"
#include "tests/stages/render/render_fixtures.h"

namespace texmesh::shade_test {

using testing::at;
using testing::even_light;
using testing::front_camera;
using testing::joined;
using testing::largest_difference;
using testing::only_key_light;
using testing::plain;
using testing::SmallScene;
using testing::square;
using testing::texture_of;
using testing::unlit;

Mesh ball() {
  Mesh mesh = testing::sphere(64, 128);
  mesh.triangle_material.assign(mesh.triangles.size(), 0);
  return mesh;
}
RenderCamera ball_camera() { return perspective_camera(ViewCamera{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}, 1}); }

/// Calls f(colour, normal, direction to the viewer) for the pixels whose middle shows a unit ball well within
/// its rim.
template <class F>
void for_each_ball_pixel(const Picture& picture, const RenderCamera& camera, F f) {
  const std::uint32_t side = picture.side_px;
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const double px = ((x + 0.5) / side * 2 - 1) * camera.tan_half_fov,
                   py = (1 - (y + 0.5) / side * 2) * camera.tan_half_fov;
      const Vec3d ray = normalized(camera.x * px + camera.y * py - camera.z);
      const double half = dot(ray, camera.eye), root = half * half - dot(camera.eye, camera.eye) + 1;
      if (root < 0.2) continue;
      const Vec3d normal = camera.eye + ray * (-half - std::sqrt(root));
      f(at(picture, x, y), to_float(normal), to_float(ray * -1));
    }
}

TEST(Shade, AWhiteBodyInEvenLightShowsThatLight) {
  const RenderEnvironment even = even_light({0.5f, 0.5f, 0.5f});
  const Vec3f expected = tone_mapped({0.5f, 0.5f, 0.5f});
  for (const float metallic : {0.f, 1.f})
    for (const float roughness : {0.f, 0.5f, 1.f}) {
      const SmallScene scene{ball(), {plain({1, 1, 1, 1}, metallic, roughness)}, {}};
      std::size_t checked = 0;
      for_each_ball_pixel(scene.picture(ball_camera(), 64, even), ball_camera(), [&](Vec3f c, Vec3f, Vec3f) {
        for (int k = 0; k < 3; ++k) EXPECT_NEAR(c[k], expected[k], 0.003);
        ++checked;
      });
      EXPECT_GT(checked, 500u);
    }
}

TEST(Shade, ABallUnderOneLightFollowsTheClosedForm) {
  const Vec3f towards = normalized(Vec3f{0.5f, 0.6f, 0.7f});
  const RenderEnvironment light = only_key_light(towards, {1, 1, 1});
  const SmallScene scene{ball(), {plain({0.8f, 0.4f, 0.2f, 1}, 0, 1)}, {}};
  double error = 0;
  std::size_t checked = 0;
  for_each_ball_pixel(
      scene.picture(ball_camera(), 128, light), ball_camera(), [&](Vec3f c, Vec3f n, Vec3f v) {
        const double nl = std::max(0.0, static_cast<double>(dot(n, towards))),
                     nv = static_cast<double>(dot(n, v));
        const Vec3f h = normalized(towards + v);
        // Roughness 1: D = 1 / pi, V = 1 / (2 (nl + nv))
        const double fresnel = 0.04 + 0.96 * std::pow(1 - static_cast<double>(dot(v, h)), 5);
        const double specular = nl > 0 ? fresnel / (2 * 3.14159265 * (nl + nv)) : 0;
        Vec3f expected;
        const float base[3] = {0.8f, 0.4f, 0.2f};
        for (int k = 0; k < 3; ++k)
          expected[k] = static_cast<float>((base[k] / 3.14159265 * (1 - fresnel) + specular) * nl);
        expected = tone_mapped(expected);
        for (int k = 0; k < 3; ++k)
          error = std::max(error, static_cast<double>(std::fabs(c[k] - expected[k])));
        ++checked;
      });
  EXPECT_GT(checked, 3000u);
  EXPECT_LT(error, 0.004);
}

TEST(Shade, AMirrorShowsItsSurroundingsInTheMetalsColour) {
  // Smooth and low, so that tone mapping does not compress.
  const Radiance radiance = [](Vec3f d) {
    return Vec3f{0.4f + 0.2f * d.x, 0.4f + 0.2f * d.y, 0.4f + 0.2f * d.z};
  };
  const RenderEnvironment light = prepare_environment(radiance, {}, {});
  const SmallScene scene{ball(), {plain({0.9f, 0.6f, 0.3f, 1}, 1, 0)}, {}};
  for_each_ball_pixel(scene.picture(ball_camera(), 128, light), ball_camera(),
                      [&](Vec3f c, Vec3f n, Vec3f v) {
                        if (dot(n, v) < 0.6f) return;  // Fresnel whitens the rim
                        const Vec3f seen = radiance(n * (2 * dot(n, v)) - v);
                        const Vec3f expected = tone_mapped({seen.x * 0.9f, seen.y * 0.6f, seen.z * 0.3f});
                        for (int k = 0; k < 3; ++k) EXPECT_NEAR(c[k], expected[k], 0.02);
                      });
}

TEST(Shade, PixelsAreTheMeanOfTheirSamples) {
  SmallScene scene{square(), {unlit({0.5f, 0.5f, 0.5f, 1})}, {}};
  for (Vec3f& p : scene.mesh.positions) p.x = std::min(p.x, 0.125f);
  RenderEnvironment light = even_light({});
  light.background = {0.1f, 0.2f, 0.3f};
  const Picture picture = scene.picture(front_camera(), 8, light);
  const float full = tone_mapped({0.5f, 0.5f, 0.5f}).x;
  for (std::uint32_t y = 0; y < 8; ++y) {
    EXPECT_NEAR(at(picture, 3, y).y, full, 1e-6);
    EXPECT_NEAR(at(picture, 4, y).y, (full + 0.2f) / 2, 1e-6);
    EXPECT_EQ(at(picture, 5, y), light.background);
    EXPECT_EQ(picture.covered[y * 8 + 4], 1);
    EXPECT_EQ(picture.covered[y * 8 + 5], 0);
  }
}

// By the fragments themselves: their shares of what is covered, as if the four largest were all.
TEST(Shade, FourFragmentsStandForAPixelOfManyTriangles) {
  SmallScene scene{ball(), {}, {}};
  for (int m = 0; m < 7; ++m)
    scene.materials.push_back(
        unlit({0.1f * static_cast<float>(m), 0.5f, 0.7f - 0.1f * static_cast<float>(m), 1}));
  for (std::size_t t = 0; t < scene.mesh.triangles.size(); ++t)
    scene.mesh.triangle_material[t] = static_cast<std::uint16_t>(t * 5 % 7);
  RenderEnvironment light = even_light({});
  light.background = {0.1f, 0.2f, 0.3f};
  RenderCamera far = ball_camera();
  far.tan_half_fov *= 10;  // so that a pixel of a picture that is no small one has many triangles
  const Visibility seen = scene.seen(far, 240);
  const Picture picture = scene.picture(far, 240, light);
  std::size_t crowded = 0, few = 0;
  for (std::size_t p = 0; p < picture.linear.size(); ++p) {
    std::vector<std::pair<int, Vec3f>> shown;  // samples, colour
    int covered = 0, shaded = 0;
    for (std::uint32_t i = seen.first[p]; i < seen.first[p + 1]; ++i) {
      const RenderFragment& f = seen.fragments[i];
      const int samples = __builtin_popcount(f.mask);
      const Vec4f c = scene.scene().material_of(f.triangle).base_colour;
      shown.push_back({samples, tone_mapped({c.x, c.y, c.z})});
      covered += samples;
    }
    (shown.size() > 4 ? crowded : few) += !shown.empty();
    std::stable_sort(shown.begin(), shown.end(), [](auto& a, auto& b) { return a.first > b.first; });
    shown.resize(std::min<std::size_t>(shown.size(), 4));
    Vec3f sum;
    for (const auto& [samples, colour] : shown) {
      sum = sum + colour * static_cast<float>(samples);
      shaded += samples;
    }
    const float share = static_cast<float>(covered) / 16;
    if (shaded > 0) sum = sum * (share / static_cast<float>(shaded));
    EXPECT_NEAR(length(picture.linear[p] - (sum + light.background * (1 - share))), 0, 1e-6) << p;
  }
  EXPECT_GT(crowded, 100u);
  EXPECT_GT(few, 10u);
}

TEST(Shade, UnlitIsTheToneMappedBaseColour) {
  SmallScene scene{square(), {unlit({0.9f, 0.5f, 0.1f, 1})}, {}};
  scene.materials[0].emissive = {1, 1, 1};
  const Picture picture = scene.picture(front_camera(), 8, studio_environment());
  for (const Vec3f c : picture.linear) EXPECT_NEAR(length(c - tone_mapped({0.9f, 0.5f, 0.1f})), 0, 1e-6);
}

TEST(Shade, ColoursOfVerticesMultiplyTheBaseColour) {
  SmallScene scene{square(), {unlit({0.5f, 1, 1, 1})}, {}};
  scene.mesh.colours = {{0, 0.4f, 0.2f, 1}, {0, 0.4f, 0.2f, 1}, {1, 0.4f, 0.2f, 1}, {1, 0.4f, 0.2f, 1}};
  const Picture picture = scene.picture(front_camera(), 8, even_light({}));
  for (std::uint32_t x = 0; x < 8; ++x)
    EXPECT_NEAR(length(at(picture, x, 5) - tone_mapped({(static_cast<float>(x) + 0.5f) / 16, 0.4f, 0.2f})), 0,
                0.002);
}

TEST(Shade, TexturesOfColourRoughnessAndEmissionReachTheirPlaces) {
  SmallScene scene{square(), {unlit({1, 1, 1, 1})}, {}};
  scene.textures = {texture_of(8, 8, 3, true, [](auto x, auto y, auto c) {
    return static_cast<std::uint8_t>(c == 0 ? 20 * x : c == 1 ? 20 * y : 90);
  })};
  scene.materials[0].slot(TextureUse::kBaseColour).texture = 0;
  const Picture picture = scene.picture(front_camera(), 8, even_light({}));
  for (std::uint32_t y = 0; y < 8; ++y)
    for (std::uint32_t x = 0; x < 8; ++x) {
      const Vec3f texel{static_cast<float>(light_of_srgb(20 * x / 255.)),
                        static_cast<float>(light_of_srgb(20 * y / 255.)),
                        static_cast<float>(light_of_srgb(90 / 255.))};
      // Pixels on the diagonal are shaded twice, beside their middle.
      if (x != y && x + y != 7)
        EXPECT_NEAR(length(at(picture, x, y) - tone_mapped(texel)), 0, 2e-3) << x << " " << y;
    }
  scene.materials[0].slot(TextureUse::kBaseColour).transform.offset = {0.25f, 0};
  const Picture moved = scene.picture(front_camera(), 8, even_light({}));
  EXPECT_NEAR(length(at(moved, 2, 4) - at(picture, 4, 4)), 0, 3e-3);
}

TEST(Shade, OneReadOfOcclusionAndRoughnessIsAsTwo) {
  SmallScene scene{ball(), {plain({0.8f, 0.5f, 0.3f, 1}, 0.7f, 1)}, {}};
  auto noise = [](auto x, auto y, auto c) {
    return static_cast<std::uint8_t>((x * 37 + y * 91 + c * 53) % 256);
  };
  scene.textures = {texture_of(32, 32, 3, false, noise), texture_of(32, 32, 3, false, noise)};
  scene.materials[0].slot(TextureUse::kMetallicRoughness).texture = 0;
  scene.materials[0].slot(TextureUse::kOcclusion).texture = 0;
  const RenderEnvironment studio = studio_environment();
  const Picture shared = scene.picture(ball_camera(), 48, studio);
  scene.materials[0].slot(TextureUse::kOcclusion).texture = 1;
  EXPECT_EQ(largest_difference(shared, scene.picture(ball_camera(), 48, studio)), 0);
  scene.materials[0].slot(TextureUse::kOcclusion).texture = -1;
  EXPECT_GT(largest_difference(shared, scene.picture(ball_camera(), 48, studio)), 0.05);
}

TEST(Shade, AnEmptyTextureIsWhite) {
  SmallScene scene{ball(), {plain({0.8f, 0.5f, 0.3f, 1}, 0.5f, 0.5f)}, {}};
  const RenderEnvironment studio = studio_environment();
  const Picture without = scene.picture(ball_camera(), 32, studio);
  scene.textures.resize(1);
  for (TextureSlot& slot : scene.materials[0].textures) slot.texture = 0;
  EXPECT_EQ(largest_difference(without, scene.picture(ball_camera(), 32, studio)), 0);
  scene.materials[0].textures[0].texture = 1;
  EXPECT_THROW(scene.picture(ball_camera(), 32, studio), std::invalid_argument);
}

TEST(Shade, WithoutNormalsTrianglesAreFlat) {
  SmallScene scene{square(), {plain({0.7f, 0.7f, 0.7f, 1})}, {}};
  const RenderEnvironment studio = studio_environment();
  const Picture with = scene.picture(front_camera(), 16, studio);
  scene.mesh.normals.clear();
  EXPECT_LT(largest_difference(with, scene.picture(front_camera(), 16, studio)), 1e-6);
  scene.mesh.normals.assign(4, {});  // no direction: as without
  EXPECT_LT(largest_difference(with, scene.picture(front_camera(), 16, studio)), 1e-6);
}

TEST(Shade, ABackFaceIsLitFromItsOwnSide) {
  SmallScene scene{square(), {plain({0.7f, 0.7f, 0.7f, 1}, 0, 0.8f)}, {}};
  scene.materials[0].double_sided = true;
  const RenderEnvironment studio = studio_environment();
  RenderCamera behind = look_at_camera({0, 0, -10}, {0, 0, 0}, {0, 1, 0}, 12, 0.01);
  const Picture back = scene.picture(behind, 16, studio);
  for (Vec3f& p : scene.mesh.positions) p.x = -p.x;  // now this side is the front
  for (Vec3f& n : scene.mesh.normals) n.z = -1;
  EXPECT_LT(largest_difference(back, scene.picture(behind, 16, studio)), 1e-5);
}

TEST(Shade, ToneMappingIsKhronosNeutral) {
  EXPECT_NEAR(tone_mapped({0.5f, 0.4f, 0.3f}).x, 0.46, 1e-6);  // below 0.8: less 0.04 alone
  EXPECT_NEAR(tone_mapped({0.5f, 0.4f, 0.05f}).z, 6.25 * 0.05 * 0.05, 1e-6);
  // The formula by hand for (2, 1, 0.5): peak 1.96.
  const double peak = 1.96, mapped = 1 - 0.24 * 0.24 / (peak + 0.24 - 0.76);
  const double grey = 1 - 1 / (0.15 * (peak - mapped) + 1), green = 0.96 * mapped / peak;
  EXPECT_NEAR(tone_mapped({2, 1, 0.5f}).x, mapped, 1e-6);
  EXPECT_NEAR(tone_mapped({2, 1, 0.5f}).y, green + (mapped - green) * grey, 1e-6);
  EXPECT_EQ(tone_mapped({}), (Vec3f{}));
  for (const float v : {1e10f, std::numeric_limits<float>::infinity()})
    EXPECT_LE(tone_mapped({v, v, v}).x, 1);
  EXPECT_EQ(tone_mapped({std::nanf(""), 0, 0}), (Vec3f{}));
}

TEST(Shade, EncodingIsSrgbRoundedToNearest) {
  Picture picture;
  picture.side_px = 16;
  for (int i = 0; i < 256; ++i) {
    const auto light = static_cast<float>(light_of_srgb(i / 255.));
    picture.linear.push_back({light, light * 1.0005f, light * 0.9995f});
  }
  const Pixels pixels = encode_srgb(picture);
  for (std::size_t i = 0; i < 256; ++i)
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(pixels.data[3 * i + k], i);
  picture.linear = {{-1, 7, std::nanf("")}};
  picture.side_px = 1;
  EXPECT_EQ(encode_srgb(picture).data, (std::vector<std::uint8_t>{0, 255, 0}));
}

TEST(Shade, SameBitsForAnyNumberOfThreads) {
  SmallScene scene{ball(), {plain({0.8f, 0.5f, 0.3f, 0.6f}, 0.4f, 0.3f)}, {}};
  scene.materials[0].alpha_mode = AlphaMode::kBlend;
  scene.materials[0].double_sided = true;
  const RenderEnvironment studio = studio_environment();
  const Picture one = scene.picture(ball_camera(), 90, studio, 1),
                many = scene.picture(ball_camera(), 90, studio, 8);
  EXPECT_EQ(one.linear, many.linear);
  EXPECT_EQ(one.covered, many.covered);
}

}  // namespace texmesh::shade_test
