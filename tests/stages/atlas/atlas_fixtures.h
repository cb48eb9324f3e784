#pragma once
// Models with atlases that code makes, and images that tell where a texel comes from.
#include <map>

#include "stages/image/png_writer.h"
#include "tests/support/hostile_meshes.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

using Pixel = std::array<std::uint8_t, 3>;

inline Image image_of(std::uint32_t side_px, auto&& texel) {
  Pixels pixels{side_px, side_px, 3, {}};
  for (std::uint32_t y = 0; y < side_px; ++y)
    for (std::uint32_t x = 0; x < side_px; ++x)
      for (const std::uint8_t c : Pixel(texel(x, y))) pixels.data.push_back(c);
  return {"a.png", ImageFormat::kPng, side_px, side_px, 3, 8, false, false, write_png(pixels)};
}

/// Red is u, green is v.
inline Image places(std::uint32_t side_px) {
  return image_of(side_px, [=](std::uint32_t x, std::uint32_t y) {
    return Pixel{static_cast<std::uint8_t>((x + 0.5) * 255 / side_px),
                 static_cast<std::uint8_t>((y + 0.5) * 255 / side_px), 0};
  });
}

/// Every triangle in a cell of its own.
inline Mesh scattered(const Mesh& from) {
  Mesh out = from;
  const auto columns = static_cast<std::uint32_t>(std::ceil(std::sqrt(double(from.triangles.size()))));
  out.wedge_position.clear(), out.uv0.clear(), out.normals.clear();
  for (std::uint32_t t = 0; t < from.triangles.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint32_t wedge = from.triangles[t][k];
      const float x = k == 1 ? 0.8f : 0.2f, y = k == 2 ? 0.8f : 0.2f;
      out.triangles[t][k] = static_cast<std::uint32_t>(out.wedge_position.size());
      out.wedge_position.push_back(from.wedge_position[wedge]);
      if (!from.normals.empty()) out.normals.push_back(from.normals[wedge]);
      out.uv0.push_back(
          {(float(t % columns) + x) / float(columns), (float(t / columns) + y) / float(columns)});
    }
  return out;
}

/// Numbers: no curve of sRGB between the texels and what is compared.
inline Material data_material(std::int32_t image) {
  Material out;
  out.metallic_roughness_texture.image = image;
  return out;
}

/// A thin one: pictures of it have few pixels, and are made soon.
inline Mesh pole() {
  Mesh out = bumpy_sphere(20, 30);
  for (Vec3f& p : out.positions) p = {p.x * 0.12f, p.y, p.z * 0.12f};
  return out;
}

/// A sphere whose triangles lie in `charts` charts of one row of quads or part of it, each in a cell of its
/// own.
inline Mesh in_charts(const Mesh& from, std::uint32_t charts) {
  Mesh out = from;
  out.wedge_position.clear(), out.uv0.clear(), out.normals.clear();
  std::map<std::array<std::uint32_t, 2>, std::uint32_t> ids;
  const auto columns = static_cast<std::uint32_t>(std::ceil(std::sqrt(double(charts))));
  for (std::uint32_t t = 0; t < from.triangles.size(); ++t) {
    const auto chart = static_cast<std::uint32_t>(std::uint64_t{t} * charts / from.triangles.size());
    for (std::uint32_t& w : out.triangles[t]) {
      const auto [at, fresh] =
          ids.try_emplace({w, chart}, static_cast<std::uint32_t>(out.wedge_position.size()));
      const std::uint32_t old = std::exchange(w, at->second);
      if (!fresh) continue;
      out.wedge_position.push_back(from.wedge_position[old]);
      const Vec2f cell{float(chart % columns), float(chart / columns)};
      out.uv0.push_back((cell + from.uv0[old] * 0.9f) * (1 / float(columns)));
    }
  }
  return out;
}

/// With one material and texture coordinates that an atlas has not.
inline std::vector<Mesh> strange_models() {
  Random random{1};
  const auto with_uv = [](Mesh mesh, float scale) {
    mesh.uv0.clear();
    for (const std::uint32_t p : mesh.wedge_position) {
      const Vec3f at = mesh.positions[p];
      mesh.uv0.push_back({at.x * scale, at.y * scale});
    }
    return mesh;
  };
  Mesh far = sheet(6);
  for (Vec3f& p : far.positions) p = p + Vec3f{1e7f, 1e7f, -1e7f};
  Mesh huge = bumpy_sphere(6, 8);
  for (Vec3f& p : huge.positions) p = p * 1e7f;
  Mesh one = sheet(1);
  one.triangles.resize(1), one.triangle_material.resize(1), one.triangle_part.resize(1);
  return {with_uv(cube(), 20),           // tiles
          with_uv(sphere(8, 12), 0.5f),  // two sides share texels
          with_uv(sheet(4), 0),          // no area in the texture
          far,
          huge,
          one,
          with_uv(sliver_sheet(6), 1),
          with_uv(dust(65, 0.01f), 1),    // more components than a word has bits
          with_uv(dust(1500, 0.01f), 1),  // crumbs
          with_uv(random_soup(random, 30, 80), 1)};
}

}  // namespace texmesh::testing
