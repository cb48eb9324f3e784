#include "pipeline/import/gltf/import_gltf_assembler.h"

#include <array>

#include "pipeline/import/local_frame.h"

namespace texmesh::gltf {
namespace {

/// Columns of the cofactor matrix: maps normals up to a positive factor when the determinant is positive.
struct NormalMap {
  std::array<Vec3d, 3> column;
  double determinant = 1;
};

NormalMap normal_map(const Affine& a) {
  const auto column = [&](int j) { return Vec3d{a.at(0, j), a.at(1, j), a.at(2, j)}; };
  const Vec3d x = column(0), y = column(1), z = column(2);
  NormalMap n{{cross(y, z), cross(z, x), cross(x, y)}, 0};
  n.determinant = dot(x, n.column[0]);
  return n;
}

}  // namespace

void Assembler::check_room(const Primitive& primitive, std::size_t new_wedges) const {
  const auto check = [&](const char* what, std::size_t count, int limit) {
    if (count > static_cast<std::size_t>(limit)) {
      source_.fail(what, "at most " + std::to_string(limit), std::to_string(count) + " or more");
    }
  };
  check("vertices of all meshes", positions_.size() + primitive.positions.size(),
        source_.options.max_vertices);
  check("wedges of all meshes", mesh_.wedge_count() + new_wedges, source_.options.max_vertices);
  check("triangles of all meshes", mesh_.triangles.size() + primitive.triangles.size(),
        source_.options.max_triangles);
}

/// Attributes that only some primitives have are 0 (colours: white) on the others.
void Assembler::add_wedge(const Primitive& primitive, std::uint32_t vertex, std::uint32_t first_position,
                          Vec3f normal) {
  const std::size_t before = mesh_.wedge_position.size();
  mesh_.wedge_position.push_back(first_position + vertex);
  const auto add_to = [&](auto& all, const auto& given, auto otherwise) {
    if (given.empty() && all.empty()) return;
    all.resize(before, otherwise);
    all.push_back(given.empty() ? otherwise : given[vertex]);
  };
  add_to(mesh_.uv0, primitive.uv0, Vec2f{});
  add_to(mesh_.uv1, primitive.uv1, Vec2f{});
  add_to(mesh_.colours, primitive.colours, Vec4f{1, 1, 1, 1});
  if (with_normals_) mesh_.normals.push_back(normal);
}

/// Directions on the surface go the way of positions. A mirrored surface has its bitangents the
/// other way round.
void Assembler::add_tangents(const Primitive& primitive, const Affine& to_scene, bool mirrored) {
  if (primitive.tangents.empty()) return;
  mesh_.tangents.resize(mesh_.wedge_count() - primitive.tangents.size());
  for (const Vec4f& t : primitive.tangents) {
    Vec3d d;
    for (int i = 0; i < 3; ++i)
      d[i] = to_scene.at(i, 0) * t.x + to_scene.at(i, 1) * t.y + to_scene.at(i, 2) * t.z;
    const Vec3f unit = to_float(normalized(d));
    mesh_.tangents.push_back({unit.x, unit.y, unit.z, mirrored ? -t.w : t.w});
  }
}

void Assembler::add(const Primitive& primitive, const Affine& to_scene, std::uint16_t material,
                    std::uint16_t part) {
  // glTF: without normals a primitive is flat. Where others have normals that means a wedge per corner.
  const bool flat = with_normals_ && primitive.normals.empty();
  check_room(primitive, flat ? primitive.triangles.size() * 3 : primitive.positions.size());
  const NormalMap normals = normal_map(to_scene);
  const double sign = normals.determinant < 0 ? -1 : 1;
  const auto first_position = static_cast<std::uint32_t>(positions_.size());
  const auto first_wedge = static_cast<std::uint32_t>(mesh_.wedge_count());
  for (const Vec3f& p : primitive.positions) positions_.push_back(to_scene * to_double(p));
  for (std::uint32_t v = 0; v < primitive.positions.size() && !flat; ++v) {
    Vec3d n;
    if (with_normals_) {
      const Vec3f& given = primitive.normals[v];
      n = (normals.column[0] * given.x + normals.column[1] * given.y + normals.column[2] * given.z) * sign;
    }
    add_wedge(primitive, v, first_position, to_float(normalized(n)));
  }
  if (!flat) add_tangents(primitive, to_scene, sign < 0);
  for (std::size_t t = 0; t < primitive.triangles.size(); ++t) {
    Triangle corners = primitive.triangles[t];
    if (sign < 0) std::swap(corners[1], corners[2]);  // a mirrored front face would be seen from behind
    Triangle wedges;
    if (flat) {
      const Vec3d a = positions_[first_position + corners[0]];
      const Vec3d n = normalized(
          cross(positions_[first_position + corners[1]] - a, positions_[first_position + corners[2]] - a));
      for (std::size_t i = 0; i < 3; ++i) {
        wedges[i] = static_cast<std::uint32_t>(mesh_.wedge_count());
        add_wedge(primitive, corners[i], first_position, to_float(n));
      }
    } else {
      for (std::size_t i = 0; i < 3; ++i) wedges[i] = first_wedge + corners[i];
    }
    mesh_.triangles.push_back(wedges);
    mesh_.triangle_material.push_back(material);
    mesh_.triangle_part.push_back(part);
  }
}

void Assembler::finish() {
  const std::size_t n = mesh_.wedge_count();
  if (!mesh_.uv0.empty()) mesh_.uv0.resize(n);
  if (!mesh_.uv1.empty()) mesh_.uv1.resize(n);
  if (!mesh_.colours.empty()) mesh_.colours.resize(n, {1, 1, 1, 1});
  if (!mesh_.tangents.empty()) mesh_.tangents.resize(n);
  set_positions(mesh_, positions_, source_.largest_coordinate);
}

}  // namespace texmesh::gltf
