// Normal maps, roughness of the geometry, and input that means harm.
#include "stages/render/fragment_shader.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/stages/render/render_fixtures.h"

namespace texmesh::fragment_shader_test {

using testing::at;
using testing::front_camera;
using testing::largest_difference;
using testing::plain;
using testing::SmallScene;
using testing::square;
using testing::texture_of;

RenderTexture bumps() {
  return texture_of(16, 16, 3, false, [](auto x, auto y, auto c) {
    return static_cast<std::uint8_t>(c == 2 ? 220 : (x * 37 + y * 59 + c * 101) % 160 + 48);
  });
}
SmallScene bumpy_square() {
  SmallScene scene{square(), {plain({0.7f, 0.7f, 0.7f, 1}, 0.5f, 0.4f)}, {bumps()}};
  scene.materials[0].slot(TextureUse::kNormal).texture = 0;
  return scene;
}
// Tangents for texture coordinates that grow along `u` and `v` in space.
void set_tangents(Mesh& mesh, Vec3f u, Vec3f v) {
  mesh.tangents.clear();
  for (const Vec3f n : mesh.normals) {
    // glTF: the map's +Y is against growing v.
    const float sign = dot(cross(n, u), v) < 0 ? 1.f : -1.f;
    mesh.tangents.push_back({u.x, u.y, u.z, sign});
  }
}

TEST(FragmentShader, AFlatNormalMapChangesNothing) {
  Mesh mesh = testing::sphere(32, 64);
  SmallScene scene{mesh, {plain({0.7f, 0.5f, 0.3f, 1}, 0.5f, 0.4f)}, {}};
  const RenderEnvironment studio = studio_environment();
  const RenderCamera camera = perspective_camera(camera_of(2, 5, {}, 1));
  const Picture without = scene.picture(camera, 48, studio);
  // The levels hold -1 / 255 for 0: the nearest that 8 bits have.
  scene.textures = {texture_of(
      4, 4, 3, false, [](auto, auto, auto c) { return static_cast<std::uint8_t>(c == 2 ? 255 : 127); })};
  scene.materials[0].slot(TextureUse::kNormal).texture = 0;
  EXPECT_LT(largest_difference(without, scene.picture(camera, 48, studio)), 0.02);
  scene.materials[0].normal_scale = 0;
  EXPECT_LT(largest_difference(without, scene.picture(camera, 48, studio)), 1e-5);
}

TEST(FragmentShader, TangentsAndDerivativesAgreeOnAPlane) {
  const RenderEnvironment studio = studio_environment();
  struct Case {
    Vec2f origin, along_x, along_y;  // texture coordinates at the lower left, and along the square's sides
  };
  for (const Case& c : {Case{{0, 1}, {1, 0}, {0, -1}}, Case{{1, 1}, {-1, 0}, {0, -1}},
                        Case{{0, 0}, {0, 1}, {1, 0}}, Case{{0, 0}, {0.6f, 0.8f}, {0.8f, -0.6f}}}) {
    SmallScene scene = bumpy_square();
    for (std::size_t i = 0; i < 4; ++i) {
      const Vec3f p = scene.mesh.positions[i];
      scene.mesh.uv0[i] = c.origin + c.along_x * ((p.x + 1) / 2) + c.along_y * ((p.y + 1) / 2);
    }
    const Picture derived = scene.picture(front_camera(), 32, studio);
    set_tangents(scene.mesh, normalized(Vec3f{c.along_x.x, c.along_y.x, 0}),
                 normalized(Vec3f{c.along_x.y, c.along_y.y, 0}));
    EXPECT_LT(largest_difference(derived, scene.picture(front_camera(), 32, studio)), 1e-4);
  }
}

TEST(FragmentShader, GreenPointsUpThePicture) {
  // A map that leans towards +Y, lit from above, is brighter than flat, and darker lit from below.
  SmallScene scene{square(), {plain({0.7f, 0.7f, 0.7f, 1})}, {}};
  scene.textures = {texture_of(1, 1, 3, false, [](auto, auto, auto c) {
    return static_cast<std::uint8_t>(c == 0 ? 127 : c == 1 ? 200 : 230);
  })};
  const RenderEnvironment above = testing::only_key_light({0, 1, 1}, {1, 1, 1}),
                          below = testing::only_key_light({0, -1, 1}, {1, 1, 1});
  const float flat = at(scene.picture(front_camera(), 8, above), 4, 2).x;
  scene.materials[0].slot(TextureUse::kNormal).texture = 0;
  EXPECT_GT(at(scene.picture(front_camera(), 8, above), 4, 2).x, flat * 1.1f);
  EXPECT_LT(at(scene.picture(front_camera(), 8, below), 4, 2).x, flat * 0.9f);
  set_tangents(scene.mesh, {1, 0, 0}, {0, -1, 0});
  EXPECT_GT(at(scene.picture(front_camera(), 8, above), 4, 2).x, flat * 1.1f);
}

TEST(FragmentShader, BacksShowTheMapMirrored) {
  SmallScene scene = bumpy_square();
  scene.materials[0].double_sided = true;
  const RenderEnvironment even = testing::even_light({0.5f, 0.5f, 0.5f});
  // In even light the lean of the normal alone decides, so both sides look the same.
  RenderCamera behind = look_at_camera({0, 0, -10}, {0, 0, 0}, {0, 1, 0}, 30, 0.01);
  behind.tan_half_fov = 0.1;
  const Picture front = scene.picture(front_camera(), 16, even), back = scene.picture(behind, 16, even);
  for (std::uint32_t x = 0; x < 16; ++x) EXPECT_NEAR(at(front, x, 5).x, at(back, 15 - x, 5).x, 0.01);
}

TEST(FragmentShader, CurvatureWithinAPixelMakesRough) {
  // A mirror seen so small that a pixel turns the normal by much shows no sharp lights.
  const RenderEnvironment key = testing::only_key_light({0.3f, 0.4f, 1}, {1, 1, 1});
  const SmallScene scene{testing::sphere(48, 96), {plain({1, 1, 1, 1}, 1, 0)}, {}};
  const RenderCamera camera = perspective_camera(camera_of(0, 1, {}, 1));
  auto brightest = [&](std::uint32_t side) {
    float most = 0;
    for (const Vec3f c : scene.picture(camera, side, key).linear) most = std::max(most, c.x);
    return most;
  };
  EXPECT_GT(brightest(256), 0.9f);
  EXPECT_LT(brightest(6), 0.6f);
}

void expect_sound(const Picture& picture) {
  for (const Vec3f c : picture.linear)
    for (int k = 0; k < 3; ++k) {
      ASSERT_GE(c[k], 0);  // false for NaN
      ASSERT_LE(c[k], 1);
    }
}

TEST(FragmentShader, HostileAttributesNeverGiveNan) {
  const RenderEnvironment studio = studio_environment();
  const float nan = std::nanf(""), infinity = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, infinity, -infinity, 3e38f, -3e38f, 1e-38f, 0.f}) {
    SmallScene scene = bumpy_square();
    for (TextureSlot& slot : scene.materials[0].textures) slot.texture = 0;
    scene.materials[0].emissive = {1, 1, 1};
    const SmallScene sound = scene;
    for (Vec2f& uv : scene.mesh.uv0) uv = {bad, bad};
    expect_sound(scene.picture(front_camera(), 8, studio));
    scene = sound;
    scene.mesh.normals[2] = {bad, bad, bad};
    expect_sound(scene.picture(front_camera(), 8, studio));
    scene.mesh.normals.assign(4, {bad, 0, 0});
    expect_sound(scene.picture(front_camera(), 8, studio));
    scene = sound;
    scene.mesh.tangents.assign(4, {bad, bad, bad, bad});
    expect_sound(scene.picture(front_camera(), 8, studio));
    scene = sound;
    scene.mesh.colours.assign(4, {bad, bad, bad, bad});
    for (const AlphaMode mode : {AlphaMode::kOpaque, AlphaMode::kMask, AlphaMode::kBlend}) {
      scene.materials[0].alpha_mode = mode;
      expect_sound(scene.picture(front_camera(), 8, studio));
    }
    scene = sound;
    scene.materials[0].metallic = scene.materials[0].roughness = scene.materials[0].normal_scale = bad;
    scene.materials[0].emissive = {bad, bad, bad};
    scene.materials[0].occlusion_strength = bad;
    expect_sound(scene.picture(front_camera(), 8, studio));
    scene = sound;
    for (TextureSlot& slot : scene.materials[0].textures) slot.transform = {{bad, bad}, {bad, bad}, 0};
    expect_sound(scene.picture(front_camera(), 8, studio));
    scene = sound;
    RenderEnvironment light = studio;
    light.key = {{bad, bad, bad}, {bad, bad, bad}};
    expect_sound(scene.picture(front_camera(), 8, light));
  }
}

TEST(FragmentShader, TinyAndHugeObjectsLookTheSame) {
  const RenderEnvironment studio = studio_environment();
  Picture first;
  for (const float size : {1.f, 1e-12f, 1e12f}) {
    SmallScene scene = bumpy_square();
    for (Vec3f& p : scene.mesh.positions) p = p * size;
    const Picture picture =
        scene.picture(perspective_camera(camera_of(0, 1, {}, static_cast<double>(size))), 24, studio);
    if (size == 1) first = picture;
    EXPECT_LT(largest_difference(first, picture), 0.02);
  }
}

}  // namespace texmesh::fragment_shader_test
