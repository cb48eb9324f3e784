#pragma once
// Small scenes for the tests of the renderer.
#include <functional>

#include "stages/render/shade.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

/// A square of side 2 around the origin that faces +Z, u to the right and v downwards, with normals.
inline Mesh square() {
  Mesh mesh;
  mesh.positions = {{-1, 1, 0}, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}};
  mesh.wedge_position = {0, 1, 2, 3};
  mesh.uv0 = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  mesh.normals.assign(4, {0, 0, 1});
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.triangle_material = {0, 0};
  mesh.triangle_part = {0, 0};
  mesh.part_names = {"square"};
  return mesh;
}

/// `other` behind `mesh` in one, with materials of its own: material numbers of `other` grow by `materials`.
inline Mesh joined(Mesh mesh, const Mesh& other, std::uint16_t materials, Vec3f offset) {
  const auto position = static_cast<std::uint32_t>(mesh.positions.size());
  const auto wedge = static_cast<std::uint32_t>(mesh.wedge_count());
  for (const Vec3f p : other.positions) mesh.positions.push_back(p + offset);
  for (const std::uint32_t p : other.wedge_position) mesh.wedge_position.push_back(p + position);
  mesh.uv0.insert(mesh.uv0.end(), other.uv0.begin(), other.uv0.end());
  mesh.normals.insert(mesh.normals.end(), other.normals.begin(), other.normals.end());
  for (const Triangle& t : other.triangles)
    mesh.triangles.push_back({t[0] + wedge, t[1] + wedge, t[2] + wedge});
  for (const std::uint16_t m : other.triangle_material)
    mesh.triangle_material.push_back(static_cast<std::uint16_t>(m + materials));
  return mesh;
}

/// Looks at the origin from +Z; the square fills the picture when `distance` is 10.
inline RenderCamera front_camera(double distance = 10) {
  RenderCamera camera = look_at_camera({0, 0, distance}, {0, 0, 0}, {0, 1, 0}, 30, 0.01);
  camera.tan_half_fov = 0.1;
  return camera;
}

/// The same light from everywhere, and none from the key light.
inline RenderEnvironment even_light(Vec3f light) {
  return prepare_environment([light](Vec3f) { return light; }, {}, {});
}
inline RenderEnvironment only_key_light(Vec3f towards, Vec3f irradiance) {
  return prepare_environment([](Vec3f) { return Vec3f{}; }, {normalized(towards), irradiance}, {});
}

inline RenderMaterial plain(Vec4f colour, float metallic = 0, float roughness = 1) {
  RenderMaterial material;
  material.base_colour = colour;
  material.metallic = metallic;
  material.roughness = roughness;
  return material;
}
inline RenderMaterial unlit(Vec4f colour) {
  RenderMaterial material = plain(colour);
  material.unlit = true;
  return material;
}

inline RenderTexture texture_of(
    std::uint32_t width, std::uint32_t height, std::uint32_t channels, bool srgb,
    const std::function<std::uint8_t(std::uint32_t x, std::uint32_t y, std::uint32_t channel)>& value) {
  Pixels image{width, height, channels, {}};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x)
      for (std::uint32_t c = 0; c < channels; ++c) image.data.push_back(value(x, y, c));
  return render_texture(std::move(image), srgb, 0, {});
}

/// One picture of a scene of one mesh.
struct SmallScene {
  Mesh mesh;
  std::vector<RenderMaterial> materials;
  std::vector<RenderTexture> textures;
  RenderScene scene() const { return render_scene(mesh, materials, textures.size()); }
  Visibility seen(const RenderCamera& camera, std::uint32_t side_px, int threads = 1) const {
    return look(scene(), camera, side_px, {threads, {}, nullptr});
  }
  Picture picture(const RenderCamera& camera, std::uint32_t side_px, const RenderEnvironment& light,
                  int threads = 1) const {
    return shade(scene(), seen(camera, side_px, threads), textures, light, {threads, {}, nullptr});
  }
};

inline Vec3f at(const Picture& picture, std::uint32_t x, std::uint32_t y) {
  return picture.linear[static_cast<std::size_t>(y) * picture.side_px + x];
}
inline double largest_difference(const Picture& a, const Picture& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.linear.size(); ++i)
    for (int k = 0; k < 3; ++k)
      most = std::max(most, static_cast<double>(std::fabs(a.linear[i][k] - b.linear[i][k])));
  return most;
}

}  // namespace texmesh::testing
